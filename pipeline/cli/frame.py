"""The frame of all commands: exit codes, output options, and how a command is run and reported."""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pmg.pipeline.cli.checks import check_call
from pmg.pipeline.cli.progress_line import progress_line, say
from pmg.pipeline.files.notes import taking_notes
from pmg.pipeline.wording.safe_text import printable, printable_json, printable_lines
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.commands.outcome import Outcome
    from pmg.pipeline.recording.remark import Remark

SCHEMA = "pmg.result/1"
RESUMES = ("ingest", "run", "prove")
"""Commands that go on where an interrupted call of theirs ended."""
ONLY_TELL = ("config", "doctor", "runs")
"""Commands, or groups of them, that name a store and make nothing: they leave no entry in its audit trail."""


class _ExitCode(IntEnum):
    """Exit codes."""

    DONE = 0
    FINDINGS = 1
    COULD_NOT_RUN = 2
    PARTLY_DONE = 3
    INTERNAL_ERROR = 70
    INTERRUPTED = 130


class _FailOn(StrEnum):
    """Reasons for a finished command to exit with 1."""

    NEVER = "never"
    MISMATCH = "mismatch"
    FINDINGS = "findings"


JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
FailOnOption = Annotated[_FailOn, typer.Option("--fail-on", help="Exit with 1 on a mismatch, or on any finding.")]


def command(
    name: str, options: Sequence[Parameter] = (), *, example: str, fails: bool = True
) -> Callable[[Callable[..., Outcome]], Callable[..., None]]:
    """A stage as a command of the terminal, with its own parameters, a group of options and those on output.

    Parameters
    ----------
    name : str
        Words of the command, as results and errors name it.
    options : sequence of Parameter
        The group; the stage takes its values by name in a dict, as ``given``, and the call shows them in its place.
    example : str
        Words of a call, shown by ``--help``.
    fails : bool
        Whether the command takes ``--fail-on``.
    """

    def made(stage: Callable[..., Outcome]) -> Callable[..., None]:
        own = dict(signature(stage, eval_str=True).parameters)
        progress = own.pop("progress", None) is not None
        shown = [one for key, each in own.items() for one in (options if key == "given" else (each,))]

        audited = name.partition(" ")[0] not in ONLY_TELL and {one.name for one in shown} & {"store", "stores"}

        @wraps(stage)
        def carried(*, as_json: bool, fail_on: _FailOn = _FailOn.NEVER, **values: object) -> None:
            settings = dict(values)
            if options:
                values["given"] = {one.name: values.pop(one.name) for one in options}

            def run_stage() -> Outcome:
                if not progress:
                    return stage(**values)
                with progress_line(as_json, name) as line:
                    return stage(**values, progress=line)

            def check() -> None:
                check_call(shown, settings)

            _carry_out(name, (check, run_stage), as_json, fail_on, settings if audited else None)

        output = (("as_json", JsonOption, False), ("fail_on", FailOnOption, _FailOn.NEVER))[: 2 if fails else 1]
        shown += [Parameter(key, Parameter.KEYWORD_ONLY, default=value, annotation=kind) for key, kind, value in output]
        carried.__signature__ = Signature(  # type: ignore[attr-defined]
            [one.replace(kind=Parameter.KEYWORD_ONLY) for one in shown]
        )
        carried.__doc__ = f"{stage.__doc__}\n\n\b\nExample:\n  pmg {example}"
        return carried

    return made


@dataclass(frozen=True)
class _Ending:
    """How a command ended: its exit code, and its outcome or the error that stands for one."""

    code: _ExitCode
    outcome: Outcome | None = None
    error: dict[str, str] | None = None


def _carry_out(
    command: str,
    steps: tuple[Callable[[], None], Callable[[], Outcome]],
    as_json: bool,
    fail_on: _FailOn,
    audited: Mapping[str, object] | None,
) -> None:
    """Check a call, run its stage, leave entries in the audit trail, print what it gave, and exit with its code.

    Parameters
    ----------
    command : str
        Name of the command.
    steps : pair of callables
        What checks the call, and what it does.
    as_json : bool
        Whether the result is printed as JSON.
    fail_on : _FailOn
        Reasons for a finished command to exit with 1.
    audited : mapping or None
        What the call set, for the audit trail; None for a command that leaves no entry.
    """
    check, stage = steps
    refused = _ending(command, check, as_json, fail_on)
    if refused.error is not None:
        ending = refused
    elif audited is None:
        ending = _ending(command, stage, as_json, fail_on)
    else:
        ending = _audited(command, lambda: _ending(command, stage, as_json, fail_on), audited)
    code, outcome = ending.code, ending.outcome
    try:
        if as_json:
            typer.echo(as_text(command, code, outcome, ending.error))
        elif outcome is not None:
            for line in outcome.lines:
                typer.echo(printable_lines(line))
            _tell_findings(outcome.findings)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has read enough, such as head; what is left goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as problem:
        code = output_lost(f"pmg {command}", problem)
    if code:
        raise typer.Exit(int(code))


def _audited(command: str, run: Callable[[], _Ending], settings: Mapping[str, object]) -> _Ending:
    """The ending of a command that leaves entries in its stores as it begins and ends; one that fails is a finding."""
    from pmg.pipeline.commands.audit_entry import AuditedCall

    call = AuditedCall(command, sys.argv[1:], settings)
    with taking_notes(call.begin) as notes:
        call.begin(notes)
        ending = run()
    remarks = call.end(notes, int(ending.code))
    if remarks and ending.outcome is not None:
        return replace(ending, outcome=replace(ending.outcome, findings=ending.outcome.findings + remarks))
    _tell_findings(remarks)
    return ending


def _ending(command: str, stage: Callable[[], Outcome | None], as_json: bool, fail_on: _FailOn) -> _Ending:
    """Run a stage, or the check of a call, which has no outcome; an error is printed on standard error."""
    try:
        outcome = stage()
        if outcome is None:
            return _Ending(_ExitCode.DONE)
        if outcome.refusal is not None:
            return _refused(command, outcome.refusal, outcome)
        code = _exit_code(outcome, fail_on)
        if as_json:  # a value that JSON cannot hold is a defect like any other
            as_text(command, code, outcome, None)
        return _Ending(code, outcome)
    except PmgError as problem:
        return _refused(command, problem)
    except OSError as problem:
        code = _ExitCode.COULD_NOT_RUN
        where, came = str(problem.filename or command), problem.strerror or str(problem)
        error = {"where": where, "came": came, "expected": "a readable, writable place", "do": "Check path and rights."}
        _tell_error(command, f"{where}: {came}.", "Check path, rights and free space.")
    except KeyboardInterrupt:
        code = _ExitCode.INTERRUPTED
        again = "Run it again to resume." if command in RESUMES else "Run it again; it begins anew."
        error = {
            "where": command,
            "came": "interrupted",
            "expected": "to end by itself",
            "do": again,
        }
        _tell_error(command, "interrupted; what has been written is whole.", again)
    except Exception as problem:  # the outermost place: a defect of pmg, shown with its trace
        code = _ExitCode.INTERNAL_ERROR
        do = "Report this as a defect of pmg."
        error = {"where": command, "came": repr(problem), "expected": "no such error", "do": do}
        say(traceback.format_exc())
        _tell_error(command, "internal error, a defect of pmg.", "Please report it with the lines above.")
    return _Ending(code, error=error)


def _refused(command: str, problem: PmgError, outcome: Outcome | None = None) -> _Ending:
    """The ending of a command that cannot do what was asked, with what it had remarked on before."""
    _tell_error(command, f"{problem.where}: {problem.came}; expected {problem.expected}.", problem.do)
    parts = {"where": problem.where, "came": problem.came, "expected": problem.expected, "do": problem.do}
    return _Ending(_ExitCode.COULD_NOT_RUN, outcome, parts)


def output_lost(called: str, problem: OSError) -> _ExitCode:
    """Tell that standard output takes nothing more, so that what is left of it goes nowhere; the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    say(f"{called}: standard output: {problem.strerror or problem}; expected room for the result.")
    say("hint: Free space, or write elsewhere.")
    return _ExitCode.COULD_NOT_RUN


def as_text(command: str, code: int, outcome: Outcome | None, error: dict[str, str] | None) -> str:
    """The one JSON object that ``--json`` promises."""
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "command": command,
        "exit_code": int(code),
        "data": None if outcome is None or error is not None else outcome.data,
        "findings": [] if outcome is None else [remark.to_dict() for remark in outcome.findings],
        "error": error,
    }
    return printable_json(json.dumps(result, indent=1, allow_nan=False, ensure_ascii=False))


def _tell_error(command: str, problem: str, hint: str) -> None:
    """Print what is wrong, and on a line of its own what can be done about it."""
    say(printable(f"pmg {command}: {problem}"))
    say(printable(f"hint: {hint}"))


FINDINGS_SHOWN = 20
"""Findings printed before the rest is counted."""


def _tell_findings(findings: Sequence[Remark]) -> None:
    grave = [remark for remark in findings if remark.severity != "info"]
    for remark in grave[:FINDINGS_SHOWN]:
        say(printable(f"{remark.severity}: {remark.place}: {remark.message}"))
    if len(grave) > FINDINGS_SHOWN:
        say(f"... and {len(grave) - FINDINGS_SHOWN} more; --json and the report list them all.")


def _exit_code(outcome: Outcome, fail_on: _FailOn) -> _ExitCode:
    if outcome.failed:
        return _ExitCode.COULD_NOT_RUN
    if outcome.partial:
        return _ExitCode.PARTLY_DONE
    if fail_on is not _FailOn.NEVER and outcome.mismatch:
        return _ExitCode.FINDINGS
    if fail_on is _FailOn.FINDINGS and outcome.findings:
        return _ExitCode.FINDINGS
    return _ExitCode.DONE

"""A command line whose own errors look like every other error, under ``--json`` as JSON too."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer
from typer.core import TyperGroup

from pmg.pipeline.cli.frame import as_text, output_lost
from pmg.pipeline.cli.here import look_around
from pmg.pipeline.cli.progress_line import say
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.pipeline.wording.safe_text import printable_lines
from pmg.sim.errors import closest, near_miss

if TYPE_CHECKING:
    from collections.abc import Sequence

KINDS = {int: "a whole number", float: "a number"}
"""Names of option values, by type."""


USAGE = typer.BadParameter.__mro__[1]
"""Base class of typer's complaints about the words of a call; typer gives it no public name."""


class AnswersInJson(TyperGroup):
    """The commands of pmg: an unknown option or a missing argument is reported with a hint, and as one object."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,  # noqa: ANN401 - whatever typer hands on
    ) -> Any:  # noqa: ANN401 - as typer has it
        """Run a command; a complaint about its words goes to standard error, under ``--json`` as JSON as well."""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, standalone_mode, windows_expand_args, **extra)
        words = list(sys.argv[1:] if args is None else args)
        try:
            if set(words) <= {"--json"} and "_PMG_COMPLETE" not in os.environ and _printed_here("--json" in words):
                sys.exit(0)
            code = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
        except typer.Abort:
            code = 1
        except Exception as problem:
            if not isinstance(problem, USAGE):
                raise
            try:
                code = _print_problem(problem, words)
            except OSError as full:
                code = output_lost("pmg", full)
        sys.exit(code)


def _printed_here(as_json: bool) -> bool:
    """Whether this folder holds recordings; then what pmg would do with them is printed."""
    try:
        found = look_around(Path.cwd())
    except OSError:  # a folder that was deleted, or that may not be read
        return False
    if found is None:
        return False
    for line in [as_text("", 0, found, None)] if as_json else found.lines:
        typer.echo(line if as_json else printable_lines(line))
    return True


class _Fault(NamedTuple):
    """Fault of the words in three parts: what came, what was expected, what to do."""

    came: str
    expected: str
    do: str


def _print_problem(problem: Any, words: Sequence[str]) -> int:  # noqa: ANN401 - an error of typer's, whose class has no public name
    """Tell what is wrong with the words, under ``--json`` on both streams; the exit code."""
    path: list[str] = []
    context = problem.ctx
    while context is not None and context.parent is not None:
        path.insert(0, context.info_name)
        context = context.parent
    called = " ".join(["pmg", *path])
    named = [word for word in words if not word.startswith("-")][len(path) :]
    if problem.ctx is not None and hasattr(problem.ctx.command, "list_commands") and not (named or words[len(path) :]):
        problem.show()
        hint = f"See '{called} --help'." if path else "Call pmg in a folder of recordings, or try 'pmg demo'."
        fault = _Fault("no command", "one of its commands", hint)
        say(f"hint: {hint}")
    else:
        fault = _fault(problem, words, named, f"See '{called} --help'.")
        say(f"{called}: {fault.came}; expected {fault.expected}.")
        say(f"hint: {fault.do}")
    code = int(problem.exit_code)
    if "--json" in words:
        typer.echo(as_text(" ".join(path), code, None, {"where": called} | fault._asdict()))
    return code


def _fault(problem: Any, words: Sequence[str], named: Sequence[str], see: str) -> _Fault:  # noqa: ANN401 - as above
    """The parts of the message, the best near match first."""
    command: Any = None if problem.ctx is None else problem.ctx.command
    if hasattr(problem, "possibilities"):
        known = [name for each in command.get_params(problem.ctx) for name in each.opts if name.startswith("-")]
        came = f"no option '{problem.option_name}'"
        return _Fault(came, "one of its options", closest(problem.option_name, known) or see)
    param = getattr(problem, "param", None)
    if param is None and named and hasattr(command, "list_commands"):
        do = near_miss(named[0], command.list_commands(problem.ctx))
        return _Fault(f"no command '{named[0]}'", "one of its commands", do)
    if param is None:
        return _Fault(_lower(problem), "its own arguments and options", see)
    option = next((name for name in param.opts if name.startswith("--")), param.metavar or str(param.name).upper())
    if hasattr(problem, "param_type"):
        return _Fault(f"{option} is missing", "a value for it", f"Add {option}. {see}")
    given = _given(param.opts, words)
    taken: Any = getattr(param, "type_descriptor", None) or param.type
    choices = [str(getattr(choice, "value", choice)) for choice in getattr(taken, "choices", None) or ()]
    if choices and given is not None:
        return _Fault(f"{option} '{given}'", f"one of {', '.join(map(repr, choices))}", near_miss(given, choices))
    kind = KINDS.get(getattr(taken, "annotation", str))
    if kind is None or given is None:
        return _Fault(_lower(problem), kind or "a value that it takes", f"Correct it. {see}")
    low, high = (getattr(param, bound, None) for bound in ("min", "max"))
    kind += "" if low is None else f" from {low}"
    kind += "" if high is None else f" to {high}"
    return _Fault(f"{option} '{given}'", kind, f"Correct it. {see}")


def _given(names: Sequence[str], words: Sequence[str]) -> str | None:
    """The value that the words give to an option."""
    for word, following in zip(words, [*words[1:], None], strict=True):
        name, equals, value = word.partition("=")
        if name in names:
            return value if equals else following
    return None


def _lower(problem: Any) -> str:  # noqa: ANN401 - as above
    """Typer's own words, to go on after a colon."""
    return uncapitalised(str(problem.format_message()).rstrip("."))

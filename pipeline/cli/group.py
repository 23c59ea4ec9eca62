"""A command line that tells what is wrong with its words as every other error is told, under ``--json`` as JSON too."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import typer
from typer.core import TyperGroup

from pmg.pipeline.cli.frame import as_text
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from collections.abc import Sequence

KINDS = {"integer": "a whole number", "number": "a number"}
"""What an option takes, by the word for it in typer's message."""


class AnswersInJson(TyperGroup):
    """The commands of pmg: an unknown option or a missing argument is told with a hint, and as one object."""

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
        usage = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")
        try:
            code = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
        except typer.Abort:
            code = 1
        except Exception as problem:
            if not isinstance(problem, usage):
                raise
            code = _told(problem, "--json" in words)
        sys.exit(code)


class _Fault(NamedTuple):
    """What is wrong with the words: what came, what was expected, what to do."""

    came: str
    expected: str
    do: str


def _told(problem: Any, as_json: bool) -> int:  # noqa: ANN401 - an error of typer's, whose class has no public name
    """Tell what is wrong with the words, under ``--json`` on both streams; the exit code."""
    path: list[str] = []
    context = problem.ctx
    while context is not None and context.parent is not None:
        path.insert(0, context.info_name)
        context = context.parent
    called = " ".join(["pmg", *path])
    fault = _fault(problem, called)
    if type(problem).__name__ == "NoArgsIsHelpError":
        problem.show()
    else:
        typer.echo(f"{called}: {fault.came}; expected {fault.expected}.", err=True)
        typer.echo(f"hint: {fault.do}", err=True)
    code = int(problem.exit_code)
    if as_json:
        typer.echo(as_text(" ".join(path), code, None, {"where": called} | fault._asdict()))
    return code


def _fault(problem: Any, called: str) -> _Fault:  # noqa: ANN401 - as above
    """The parts of the message, the best near match first."""
    kind, see = type(problem).__name__, f"See '{called} --help'."
    command: Any = None if problem.ctx is None else problem.ctx.command
    if kind == "NoArgsIsHelpError":
        return _Fault("no command", "one of its commands", see)
    if kind == "NoSuchOption":
        known = [name for each in command.get_params(problem.ctx) for name in each.opts if name.startswith("-")]
        return _Fault(
            f"no option '{problem.option_name}'", "one of its options", _near(problem.option_name, known, see)
        )
    unknown = re.match(r"No such command '(.*?)'", problem.message)
    if unknown and hasattr(command, "list_commands"):
        do = near_miss(unknown[1], command.list_commands(problem.ctx))
        return _Fault(f"no command '{unknown[1]}'", "one of its commands", do)
    param = getattr(problem, "param", None)
    if param is None:
        return _Fault(_lower(problem), "its own arguments and options", see)
    option = next((name for name in param.opts if name.startswith("--")), param.metavar or str(param.name).upper())
    if kind == "MissingParameter":
        return _Fault(f"{option} is missing", "a value for it", f"Add {option}. {see}")
    given = re.search(r"'(.*)' is not one of (.*?)\.?$", problem.message)
    if given:
        return _Fault(
            f"{option} '{given[1]}'", f"one of {given[2]}", near_miss(given[1], re.findall(r"'(.*?)'", given[2]))
        )
    expected = next(
        (word for name, word in KINDS.items() if f"valid {name}" in problem.message), "a value that it takes"
    )
    came = f"{option} with another value" if expected in KINDS.values() else _lower(problem)
    return _Fault(came, expected, f"Correct it. {see}")


def _near(word: str, known: Sequence[str], otherwise: str) -> str:
    """The near match, where there is one."""
    hint = near_miss(word, known)
    return hint if hint.startswith("Did") else otherwise


def _lower(problem: Any) -> str:  # noqa: ANN401 - as above
    """Typer's own words, to go on after a colon."""
    text = str(problem.format_message()).rstrip(".").replace("Input should be", "must be")
    return text[:1].lower() + text[1:]

"""A command line that answers ``--json`` with JSON also where its own words are wrong."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from pmg.pipeline.cli_frame import as_text

if TYPE_CHECKING:
    from collections.abc import Sequence


class AnswersInJson(TyperGroup):
    """The commands of pmg: an unknown option or a missing argument is one object on standard output too."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,  # noqa: ANN401 - whatever typer hands on
    ) -> Any:  # noqa: ANN401 - as typer has it
        """Run a command; typer's own complaint goes to standard error as ever, under ``--json`` as JSON as well."""
        words = list(sys.argv[1:] if args is None else args)
        if not standalone_mode or "--json" not in words:
            return super().main(args, prog_name, complete_var, standalone_mode, windows_expand_args, **extra)
        usage = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")
        try:
            code = super().main(words, prog_name, complete_var, False, windows_expand_args, **extra)
        except Exception as problem:
            if not isinstance(problem, usage):
                raise
            code = _told(problem)
        sys.exit(code)


def _told(problem: Any) -> int:  # noqa: ANN401 - an error of typer's, whose class has no public name
    """Tell what is wrong with the words, on both streams; the exit code."""
    problem.show()
    path: list[str] = []
    context = problem.ctx
    while context is not None and context.parent is not None:
        path.insert(0, context.info_name)
        context = context.parent
    called = " ".join(["pmg", *path])
    error = {
        "where": called,
        "came": problem.format_message(),
        "expected": "a command with its own arguments and options",
        "do": f"See '{called} --help'.",
    }
    code = int(problem.exit_code)
    typer.echo(as_text(" ".join(path), code, None, error))
    return code

"""The commands ``pmg machine``, and ``pmg run`` with a machine of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import Given
from pmg.pipeline.commands.outcome import Outcome
from pmg.sim.errors import BenchError

machine = typer.Typer(
    help="A machine of one's own as a file: begin one, show what it says, check it.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

bench = typer.Typer(help="The bench in numbers.", no_args_is_help=True, rich_markup_mode=None)


@bench.callback()
def _bench() -> None:
    """The bench in numbers."""


@bench.command("show")
@command("bench show")
def show_bench(
    which: Annotated[
        str | None, typer.Option("--machine", help="Machine file, or the name of one that ships.", metavar="MACHINE")
    ] = None,
) -> Outcome:
    """Show the bench on one page: every number with its source, operating modes, cogging factor, harmonics."""
    from pmg.pipeline.commands import terms

    return terms.show_bench(which)


MachineArgument = Annotated[str, typer.Argument(help="Machine file, or the name of one that ships.", metavar="MACHINE")]


@machine.command()
@command("machine new")
def new(
    file: Annotated[Path, typer.Argument(help="File to write; never one that is there.", metavar="FILE")],
    like: Annotated[str, typer.Option("--like", help="Machine that ships, to begin from.")] = "rotary-drive",
) -> Outcome:
    """Write a machine file to begin from: a copy of one that ships, each number with unit and source."""
    from pmg.pipeline.commands.terms import begin_machine

    return begin_machine(file, like)


@machine.command()
@command("machine show")
def show(
    which: Annotated[
        str | None, typer.Argument(help="Machine file, or the name of one that ships.", metavar="[MACHINE]")
    ] = None,
) -> Outcome:
    """Show a machine on one page: shafts, gear, numbers with their sources; without a name, those that ship."""
    from pmg.pipeline.commands.terms import show_machine

    return show_machine(which)


@machine.command()
@command("machine check")
def check(
    which: MachineArgument,
    recordings: Annotated[
        Path | None,
        typer.Argument(help="Recordings: do they hold what the file names?", metavar="[RECORDINGS]"),
    ] = None,
) -> Outcome:
    """Check a machine file; with recordings, whether they hold its channels."""
    from pmg.pipeline.commands.terms import check_machine

    return check_machine(which, recordings)


def run_of(given: Given) -> Outcome | None:
    """The way of another machine through ``pmg run``; None of a magnetic gear, which goes the way of the thesis's."""
    from pmg.pipeline.commands.terms import run_machine
    from pmg.pipeline.machine.machine_file import read_machine
    from pmg.pipeline.machine.magnetic import usual
    from pmg.pipeline.machine.shipped import machine_path

    given = dict(given)
    which = given.pop("machine")
    if which is None or usual(read_machine(machine_path(which))):
        return None
    recordings, report = given.pop("recordings"), given.pop("report")
    useless = [name for name, value in given.items() if value is not None]
    if useless:
        came = ", ".join(f"--{name.replace('_', '-')}" for name in useless)
        raise BenchError("pmg run --machine", came, "RECORDINGS and --report alone", "Leave it out.")
    for name, value in (("RECORDINGS", recordings), ("--report", report)):
        if value is None:
            raise BenchError("pmg run --machine", f"no {name}", "RECORDINGS and --report", f"Name {name}.")
    return run_machine(which, recordings, report)

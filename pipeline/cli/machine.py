"""The commands ``pmg machine``, and ``pmg run`` with a machine of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import Given
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress
from pmg.sim.errors import BenchError

machine = typer.Typer(
    help="Begin, show or check the file of a machine.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

bench = typer.Typer(help="Show the bench in numbers.", no_args_is_help=True, rich_markup_mode=None)


@bench.callback()
def _bench() -> None:
    """The bench in numbers."""


@bench.command("show")
@command("bench show", example="bench show --machine thesis-gear-2")
def show_bench(
    which: Annotated[
        str | None, typer.Option("--machine", help="Name a machine file, or a machine that ships.", metavar="MACHINE")
    ] = None,
) -> Outcome:
    """Show the bench on one page. It lists every number with its source, operating modes and harmonics."""
    from pmg.pipeline.commands.machines.machine import show_bench as shown

    return shown(which)


MachineArgument = Annotated[
    str, typer.Argument(help="Name a machine file, or a machine that ships.", metavar="MACHINE")
]


@machine.command()
@command("machine new", example="machine new my-drive.toml --like rotary-drive")
def new(
    file: Annotated[
        Path, typer.Argument(help="Write this file; one that is there is kept.", metavar="FILE"), checks.FILE_OUT
    ],
    like: Annotated[str, typer.Option("--like", help="Begin from this machine that ships.")] = "rotary-drive",
) -> Outcome:
    """Write a machine file to begin from. It is a copy of one that ships, each number with unit and source."""
    from pmg.pipeline.commands.machines.machine import begin_machine

    return begin_machine(file, like)


@machine.command()
@command("machine show", example="machine show rotary-drive")
def show(
    which: Annotated[
        str | None, typer.Argument(help="Name a machine file, or a machine that ships.", metavar="[MACHINE]")
    ] = None,
) -> Outcome:
    """Show a machine on one page. Without a name it lists the machines that ship."""
    from pmg.pipeline.commands.machines.machine import show_machine

    return show_machine(which)


@machine.command()
@command("machine check", example="machine check my-drive.toml recordings")
def check(
    which: MachineArgument,
    recordings: Annotated[
        Path | None,
        typer.Argument(help="Check that these recordings hold what the file names.", metavar="[RECORDINGS]"),
        checks.PLACE,
    ] = None,
) -> Outcome:
    """Check a machine file. With recordings, it checks that they hold its channels."""
    from pmg.pipeline.commands.machines.machine import check_machine

    return check_machine(which, recordings)


def run_of(given: Given, progress: Progress | None) -> Outcome | None:
    """The way of another machine through ``pmg run``; None of a magnetic gear, which goes the way of the thesis's."""
    given = dict(given)
    which = given.pop("machine")
    if which is None:
        return None
    from pmg.pipeline.commands.machines.terms import run_machine
    from pmg.pipeline.machine.machine_file import read_machine
    from pmg.pipeline.machine.magnetic import usual
    from pmg.pipeline.machine.shipped import machine_path

    if usual(read_machine(machine_path(which))):
        return None
    recordings, report = given.pop("recordings"), given.pop("report")
    useless = [name for name, value in given.items() if value is not None]
    if useless:
        came = ", ".join(f"--{name.replace('_', '-')}" for name in useless)
        raise BenchError("--machine", came, "RECORDINGS and --report alone", "Leave it out.")
    for name, value in (("RECORDINGS", recordings), ("--report", report)):
        if value is None:
            raise BenchError("--machine", f"no {name}", "RECORDINGS and --report", f"Name {name}.")
    return run_machine(which, recordings, report, progress=progress)

"""The commands on what a store holds: list, show, diff, audit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.commands.outcome import Outcome

app = typer.Typer(
    help="List, show, compare and audit what a store holds.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

StoreArgument = Annotated[
    Path, typer.Argument(help="Name a store with ingested recordings.", metavar="STORE"), checks.STORE
]


@app.command("list")
@command("runs list", example='runs list store --where "sun_rpm > 1000" --sort -load')
def listed(
    store: StoreArgument,
    where: Annotated[
        str | None,
        typer.Option(
            "--where", help='List runs that meet this condition in SQL, such as "sun_rpm > 1000 and load = 1.56".'
        ),
    ] = None,
    sort: Annotated[
        str | None, typer.Option("--sort", help="Sort by this column; a minus before it puts the largest first.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option("--columns", help="Show these columns, with commas between; or all.")
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print comma-separated values.")] = False,
) -> Outcome:
    """List the runs of a store. Each test window has a row with set-points, means and remarks."""
    from pmg.pipeline.commands.runs import run_list

    return run_list(store, where, sort, columns, as_csv)


@app.command()
@command("runs show", example="runs show store 0005.mcap")
def show(
    store: StoreArgument,
    name: Annotated[
        str, typer.Argument(help="Name a file, its name in the store, the start of its hash, or a test point.")
    ],
) -> Outcome:
    """Show one recording. It lists calibration, channels, windows with reasons, remarks, hashes and origin."""
    from pmg.pipeline.commands.runs import run_show

    return run_show(store, name)


@app.command()
@command("runs diff", example="runs diff store 0005.mcap 0006.mcap")
def diff(
    store: StoreArgument,
    first: Annotated[str, typer.Argument(help="Name a recording or test point.", metavar="A")],
    second: Annotated[str, typer.Argument(help="Name another one.", metavar="B")],
    store_b: Annotated[
        Path | None, typer.Option("--store-b", help="Look for B in this store instead."), checks.STORE
    ] = None,
) -> Outcome:
    """Compare two recordings or test points. It lists settings that differ, and means that differ by more than U."""
    from pmg.pipeline.commands.runs import run_diff

    return run_diff(store, first, second, store_b)


@app.command()
@command("runs audit", example="runs audit store")
def audit(
    store: StoreArgument,
    head: Annotated[
        str | None,
        typer.Option(
            "--head", help="Check that the entry with this hash, which an earlier call printed, is still in the chain."
        ),
    ] = None,
) -> Outcome:
    """Audit a store. It lists who ran what on which bytes, checks that record, and names files changed since."""
    from pmg.pipeline.commands.audit import run_audit

    return run_audit(store, head)

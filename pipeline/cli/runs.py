"""The commands on what a store holds: list, show, diff, audit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli.frame import command
from pmg.pipeline.commands.outcome import Outcome

app = typer.Typer(
    help="What a store holds: list, show and compare its runs; audit who made it of what.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

StoreArgument = Annotated[Path, typer.Argument(help="Store with ingested recordings.", metavar="STORE")]


@app.command("list")
@command("runs list")
def listed(
    store: StoreArgument,
    where: Annotated[
        str | None, typer.Option("--where", help='Condition in SQL, such as "sun_rpm > 1000 and load = 1.56".')
    ] = None,
    sort: Annotated[str | None, typer.Option("--sort", help="Column; with a minus before it, largest first.")] = None,
    columns: Annotated[str | None, typer.Option("--columns", help="Columns, with commas between; or all.")] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Comma-separated values.")] = False,
) -> Outcome:
    """List runs, one row for each test window: set-points, means and remarks."""
    from pmg.pipeline.commands.runs import run_list

    return run_list(store, where, sort, columns, as_csv)


@app.command()
@command("runs show")
def show(
    store: StoreArgument,
    name: Annotated[str, typer.Argument(help="File, its name in the store, start of its hash, or test point.")],
) -> Outcome:
    """Show one recording: run, calibration, channels, windows with reasons, remarks, hashes, origin."""
    from pmg.pipeline.commands.runs import run_show

    return run_show(store, name)


@app.command()
@command("runs diff")
def diff(
    store: StoreArgument,
    first: Annotated[str, typer.Argument(help="Recording or test point.", metavar="A")],
    second: Annotated[str, typer.Argument(help="Another one.", metavar="B")],
    store_b: Annotated[Path | None, typer.Option("--store-b", help="Store of B, where it is another.")] = None,
) -> Outcome:
    """Compare two recordings or test points: settings that differ, and means that differ by more than U."""
    from pmg.pipeline.commands.runs import run_diff

    return run_diff(store, first, second, store_b)


@app.command()
@command("runs audit")
def audit(
    store: StoreArgument,
    head: Annotated[
        str | None, typer.Option("--head", help="Hash that an earlier call printed: is its entry still in the chain?")
    ] = None,
) -> Outcome:
    """Audit a store: who ran what on which bytes, whether this record is whole, and files changed since."""
    from pmg.pipeline.commands.audit import run_audit

    return run_audit(store, head)

"""Commands at the bench: the example, recordings watched as they land, the next test as a sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import CampaignOption, MachineOption, ModelOption
from pmg.pipeline.cli.progress_line import say
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress
from pmg.pipeline.wording.safe_text import printable


@command("demo", example="demo")
def demo(
    store: Annotated[
        Path, typer.Option("--store", help="Keep decoded runs and results in this folder."), checks.FOLDER_OUT
    ] = Path("pmg-demo-store"),
    report: Annotated[
        Path, typer.Option("--report", help="Write the report to this folder."), checks.FOLDER_OUT
    ] = Path("pmg-demo"),
    progress: Progress | None = None,
) -> Outcome:
    """Run the example that ships with pmg. Its 288 recordings are synthetic, with one physical effect concealed."""
    from pmg.pipeline.commands.at_bench.demo import run_demo

    return run_demo(store, report, progress)


@command("watch", example="watch recordings --store store --page")
def watch(
    folder: Annotated[
        Path, typer.Argument(help="Watch this folder, to which the recorder writes.", metavar="FOLDER"), checks.WATCHED
    ],
    store: Annotated[
        Path, typer.Option("--store", help="Keep decoded runs in this folder; it is made if absent."), checks.FOLDER_OUT
    ],
    page: Annotated[
        bool, typer.Option("--page", help="Serve a page that shows the grid as it fills, to this PC alone.")
    ] = False,
    port: Annotated[
        int | None,
        typer.Option("--port", min=0, max=65535, help="Serve the page at this port; any free one if not given."),
    ] = None,
    settle: Annotated[
        float,
        typer.Option("--settle", help="Read a recording when it has not changed for this many seconds."),
        checks.POSITIVE,
    ] = 3.0,
    idle: Annotated[
        float | None,
        typer.Option("--idle", help="End when nothing has landed for this many minutes; else Ctrl-C ends it."),
        checks.POSITIVE,
    ] = None,
    model: ModelOption = None,
    machine: MachineOption = None,
) -> Outcome:
    """Watch a folder and decode recordings as they land. It shows the grid, cross-checks and the first mismatch."""
    from pmg.pipeline.commands.at_bench.watch import WatchOptions, run_watch
    from pmg.sim.signals import MINUTE

    served = (port or 0) if page or port is not None else None
    chosen = WatchOptions(settle, served, None if idle is None else idle * MINUTE, model, machine)
    return run_watch(folder, store, chosen, lambda line: say(printable(line)))


@command("next", example="next --store store --out next-test")
def next_test(
    store: Annotated[Path, typer.Option("--store", help="Take the analysed campaign of this store."), checks.STORE],
    out: Annotated[
        Path,
        typer.Option("--out", help="Write next.html, a sheet to print and tick, and next.csv to this folder."),
        checks.FOLDER_OUT,
    ],
    campaign: CampaignOption = None,
    model: ModelOption = None,
) -> Outcome:
    """Write the next test as a sheet for the bench. Each point has the torque to expect under every open cause."""
    from pmg.pipeline.commands.at_bench.next_sheet import run_next

    return run_next(store, out, campaign, model)

"""The command that compares two campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import NoteOption
from pmg.pipeline.commands.outcome import Outcome


@command("report", example="report store-before store-after --report difference")
def report(
    stores: Annotated[list[Path], typer.Argument(help="Name two stores with analysed campaigns.", metavar="A B")],
    folder: Annotated[
        Path,
        typer.Option("--report", help="Write report.html, figures, tables and versus.json to this folder."),
        checks.FOLDER_OUT,
    ],
    campaign_a: Annotated[str | None, typer.Option("--campaign-a", help="Choose this campaign of A.")] = None,
    campaign_b: Annotated[str | None, typer.Option("--campaign-b", help="Choose this campaign of B.")] = None,
    speed_tolerance: Annotated[
        str | None, typer.Option("--speed-tolerance", help='Match speeds within this; "5 rpm" if not given.')
    ] = None,
    load_tolerance: Annotated[
        str | None, typer.Option("--load-tolerance", help='Match loads within this; "0.02 N m" if not given.')
    ] = None,
    transducers: Annotated[
        Transducers,
        typer.Option("--transducers", help="Say whether A and B used the same; auto looks at their calibrations."),
    ] = Transducers.AUTO,
    note: NoteOption = None,
) -> Outcome:
    """Compare two campaigns. It matches their points and says what B minus A follows, with its uncertainty."""
    from pmg.pipeline.campaign_comparison.matching import Reach
    from pmg.pipeline.commands.report import run_report

    return run_report(
        stores,
        folder,
        campaigns=(campaign_a, campaign_b),
        reach=Reach.parsed(speed_tolerance, load_tolerance),
        transducers=transducers,
        note=note or "",
    )

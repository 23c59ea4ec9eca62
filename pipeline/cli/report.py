"""The command that compares two campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import NoteOption
from pmg.pipeline.commands.outcome import Outcome


@command("report")
def report(
    stores: Annotated[list[Path], typer.Argument(help="Two stores with analysed campaigns.", metavar="A B")],
    folder: Annotated[Path, typer.Option("--report", help="Folder of report.html, figures, tables, versus.json.")],
    campaign_a: Annotated[str | None, typer.Option("--campaign-a", help="Which campaign of A.")] = None,
    campaign_b: Annotated[str | None, typer.Option("--campaign-b", help="Which campaign of B.")] = None,
    speed_tolerance: Annotated[
        str | None, typer.Option("--speed-tolerance", help='How far speeds may differ; "5 rpm" if absent.')
    ] = None,
    load_tolerance: Annotated[
        str | None, typer.Option("--load-tolerance", help='How far loads may differ; "0.02 N m" if absent.')
    ] = None,
    transducers: Annotated[
        Transducers, typer.Option("--transducers", help="Whether A and B used the same; auto: by their calibrations.")
    ] = Transducers.AUTO,
    note: NoteOption = None,
) -> Outcome:
    """Compare two campaigns: matched points, B minus A with its uncertainty, and the covariate it follows."""
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

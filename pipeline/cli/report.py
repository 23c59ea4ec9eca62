"""The command that sets two campaigns beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.cli.frame import FailOn, FailOnOption, JsonOption, carry_out
from pmg.pipeline.cli.options import NoteOption

if TYPE_CHECKING:
    from pmg.pipeline.commands.outcome import Outcome


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
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Set two campaigns beside each other: points matched, B minus A with its uncertainty, and what it follows."""

    def stage() -> Outcome:
        from pmg.pipeline.campaign_comparison.matching import Reach
        from pmg.pipeline.commands.report import run_report, two

        store_a, store_b = two(stores)
        return run_report(
            store_a,
            store_b,
            folder,
            campaign_a=campaign_a,
            campaign_b=campaign_b,
            reach=Reach.parsed(speed_tolerance, load_tolerance),
            transducers=transducers,
            note=note or "",
        )

    carry_out("report", stage, as_json, fail_on)

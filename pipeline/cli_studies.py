"""Commands beside the way from recordings to a report: simulate, validate, design, prove."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.cli_frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line

if TYPE_CHECKING:
    from pmg.pipeline.stages import Outcome


def simulate(
    scenario: Annotated[Path, typer.Argument(help="Scenario in TOML; examples in raw/scenarios.", metavar="SCENARIO")],
    out: Annotated[Path, typer.Option("--out", help="Folder of tables, recordings, report and summary.json.")],
    campaign: Annotated[
        str | None, typer.Option("--campaign", help="Name of the campaign in the recordings, instead of the file's.")
    ] = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Simulate a scenario: steady points, a run in time, a frequency response; tables, recordings and a report."""

    def stage() -> Outcome:
        from pmg.pipeline.simulation_stage import run_simulate

        return run_simulate(scenario, out, campaign)

    carry_out("simulate", stage, as_json, fail_on)


def validate(
    grids: Annotated[
        Path, typer.Option("--grids", help="Folder with the thesis's neutral_grid.csv and engaged_grid.csv.")
    ] = Path("raw/published"),
    draws: Annotated[
        int | None, typer.Option("--draws", help="Draws within the rounding of the grids; 500 if not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the draws.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Compute every published figure of the thesis from its rounded grids, and say which come out."""

    def stage() -> Outcome:
        from pmg.pipeline.validate.stage import run_validate

        return run_validate(grids, draws, seed, report)

    carry_out("validate", stage, as_json, fail_on)


def design(
    plan: Annotated[
        Path | None, typer.Argument(help="TOML file with a [plan] of points to run.", metavar="[PLAN.toml]")
    ] = None,
    store: Annotated[Path | None, typer.Option("--store", help="Store with an analysed campaign, instead.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Say what a campaign's points can tell apart, before or after it is run, and which tests would add to it."""

    def stage() -> Outcome:
        from pmg.pipeline.design_stage import run_design

        return run_design(plan, store, report)

    carry_out("design", stage, as_json, fail_on)


def prove(
    out: Annotated[Path, typer.Option("--out", help="Folder of seal, results, scores.json, report.html; resumed.")],
    campaigns: Annotated[
        int | None, typer.Option("--campaigns", help="How many concealed campaigns; 200 if not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Master seed of the campaigns.")] = None,
    strata: Annotated[
        str | None, typer.Option("--strata", help="Kinds out of clean,one,outside,two,confounded; all if not given.")
    ] = None,
    route: Annotated[str, typer.Option("--route", help="grid (fast), or recordings: through files.")] = "grid",
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes; all processors if absent.")
    ] = None,
    case: Annotated[int | None, typer.Option("--case", help="Run this campaign only, and say what came.")] = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Try the diagnosis on concealed campaigns with sealed truths, and set each rate beside its aim."""

    def stage() -> Outcome:
        from pmg.pipeline.prove.trial.stage import run_prove

        with progress_line(as_json, "prove") as progress:
            return run_prove(
                out,
                campaigns=campaigns,
                seed=seed,
                strata=strata,
                route=route,
                workers=workers,
                case=case,
                progress=progress,
            )

    carry_out("prove", stage, as_json, fail_on)

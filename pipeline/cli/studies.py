"""Commands for studies: simulate, validate, residuals, orders, design, prove and others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import CampaignOption, Given, MachineOption, ModelOption, WithOption, options_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress


@command("simulate")
def simulate(
    scenario: Annotated[Path, typer.Argument(help="Scenario in TOML; examples in raw/scenarios.", metavar="SCENARIO")],
    out: Annotated[Path, typer.Option("--out", help="Folder of tables, recordings, report and summary.json.")],
    campaign: Annotated[
        str | None, typer.Option("--campaign", help="Name of the campaign in the recordings, instead of the file's.")
    ] = None,
    model: ModelOption = None,
    switched: WithOption = None,
    machine: MachineOption = None,
    beside: Annotated[
        Path | None, typer.Option("--beside", help="A second scenario; the page draws its run over that of the first.")
    ] = None,
) -> Outcome:
    """Simulate a scenario: steady points, a run in time, a frequency response; tables, recordings and a report."""
    from pmg.pipeline.commands.simulate import run_simulate

    return run_simulate(scenario, out, campaign, model=model, switched=switched or (), machine=machine, beside=beside)


@command("validate")
def validate(
    grids: Annotated[
        Path, typer.Option("--grids", help="Folder with the thesis's neutral_grid.csv and engaged_grid.csv.")
    ] = Path("raw/published"),
    draws: Annotated[
        int | None, typer.Option("--draws", help="Draws within the rounding of the grids; 500 if not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the draws.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
) -> Outcome:
    """Recompute every published figure of the thesis from its rounded grids, each with a verdict."""
    from pmg.pipeline.commands.validate import run_validate

    return run_validate(grids, draws, seed, report)


@command("residuals")
def residuals(
    store: Annotated[Path | None, typer.Option("--store", help="Store with an analysed campaign.")] = None,
    grids: Annotated[
        Path | None, typer.Option("--grids", help="Folder with neutral_grid.csv and engaged_grid.csv, instead.")
    ] = None,
    fit: Annotated[
        str | None, typer.Option("--fit", help="curves, plane or baseline; all that apply if not given.")
    ] = None,
    draws: Annotated[
        int | None, typer.Option("--draws", help="Synthetic grids behind the p-values; 1000 if not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the synthetic grids.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
) -> Outcome:
    """Analyse the residuals of the fits: the covariates they follow beyond noise, and outliers."""
    from pmg.pipeline.commands.residuals import run_residuals

    return run_residuals(store, grids, fit=fit, draws=draws, seed=seed, report=report)


@command("orders")
def orders(
    store: Annotated[Path, typer.Option("--store", help="Store with ingested recordings.")],
    campaign: CampaignOption = None,
    point: Annotated[str | None, typer.Option("--point", help="One test point: every line of it.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder of orders.csv, load_angles.csv, orders.json.")
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
) -> Outcome:
    """Order analysis: lines of torque, speed and flux density, and the load angle."""
    from pmg.pipeline.commands.orders import run_orders

    return run_orders(store, campaign=campaign, point=point, out=out, report=report)


@command("design")
def design(
    plan: Annotated[
        Path | None, typer.Argument(help="TOML file with a [plan] of points to run.", metavar="[PLAN.toml]")
    ] = None,
    store: Annotated[Path | None, typer.Option("--store", help="Store with an analysed campaign, instead.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Folder of a report; none if not given.")] = None,
    model: ModelOption = None,
    machine: MachineOption = None,
) -> Outcome:
    """Detectability of effects in a campaign, before or after it is run, and the tests that would improve it."""
    from pmg.pipeline.commands.design import run_design

    return run_design(plan, store, report, model, machine)


@command("terms")
def terms(
    case: Annotated[Path, typer.Argument(help="Case in TOML; an example in raw/emps.", metavar="CASE")],
    out: Annotated[Path, typer.Option("--out", help="Folder of report.html, tables, terms.json, residuals.csv.")],
    data: Annotated[
        Path | None, typer.Option("--data", help="Folder of the recordings, instead of the one the case names.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of synthetic records and decoys.")] = None,
) -> Outcome:
    """Find the terms that the force balance of another machine lacks, by the same rules, from its recordings."""
    from pmg.pipeline.commands.terms import run_terms

    return run_terms(case, out, data, seed)


class _ProveOptions:
    """Options of a trial, by the names of its settings."""

    campaigns: Annotated[
        int | None, typer.Option("--campaigns", help="How many concealed campaigns; 200 if not given.")
    ] = None
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Master seed of the campaigns.")] = None
    strata: Annotated[
        str | None, typer.Option("--strata", help="Kinds out of clean,one,outside,two,confounded; all if not given.")
    ] = None
    laws: Annotated[
        str | None,
        typer.Option("--laws", help="Families of laws: usual if not given; reserved, for a final trial; all."),
    ] = None
    track: Annotated[
        str | None,
        typer.Option("--track", help="steady points if not given; motion: runs in motion; machines."),
    ] = None
    route: Annotated[str, typer.Option("--route", help="grid (fast), or recordings: through files.")] = "grid"
    recordings: Annotated[
        int | None,
        typer.Option("--recordings", help="So many concealed campaigns, and a third as many clean, go both ways."),
    ] = None
    quick: Annotated[
        bool, typer.Option("--quick", help="12 campaigns, one of them both ways, unless set otherwise.")
    ] = False
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Processes; all processors if absent.")] = None
    case: Annotated[int | None, typer.Option("--case", help="Run this campaign only, and say what came.")] = None


@command("prove", options_of(_ProveOptions))
def prove(
    out: Annotated[Path, typer.Option("--out", help="Folder of seal, results, scores.json, report.html; resumed.")],
    given: Given,
    progress: Progress | None = None,
) -> Outcome:
    """Test the diagnosis on concealed campaigns with sealed truths: rates of right and wrong causes, with aims."""
    from pmg.pipeline.trials.score.stage import TrialOptions, run_prove

    return run_prove(out, TrialOptions(**given), progress)

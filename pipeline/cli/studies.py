"""Commands for studies: simulate, validate, residuals, orders, design, prove and others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import CampaignOption, Given, MachineOption, ModelOption, WithOption, options_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress


@command("simulate", example="simulate raw/scenarios/neutral.toml --out simulated")
def simulate(
    scenario: Annotated[
        Path,
        typer.Argument(help="Name a scenario in TOML; raw/scenarios has examples.", metavar="SCENARIO"),
        checks.FILE,
    ],
    out: Annotated[
        Path,
        typer.Option("--out", help="Write tables, recordings, report and summary.json to this folder."),
        checks.FOLDER_OUT,
    ],
    campaign: Annotated[
        str | None,
        typer.Option("--campaign", help="Name the campaign in the recordings so, instead of as the file does."),
    ] = None,
    model: ModelOption = None,
    switched: WithOption = None,
    machine: MachineOption = None,
    beside: Annotated[
        Path | None,
        typer.Option(
            "--beside",
            help="A second scenario; the page draws its run over that of the first. Models act on the first.",
        ),
        checks.FILE,
    ] = None,
) -> Outcome:
    """Simulate a scenario without recordings. It may ask for steady points, a run in time or a frequency response."""
    from pmg.pipeline.commands.simulate import run_simulate

    return run_simulate(scenario, out, campaign, model=model, switched=switched or (), machine=machine, beside=beside)


@command("validate", example="validate --grids raw/published --draws 500")
def validate(
    grids: Annotated[
        Path,
        typer.Option("--grids", help="Take the thesis's neutral_grid.csv and engaged_grid.csv of this folder."),
        checks.GRIDS,
    ] = Path("raw/published"),
    draws: Annotated[
        int | None,
        typer.Option("--draws", help="Draw this often within the rounding of the grids; 500 times if not given."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Begin the draws from this seed.")] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write a report to this folder; none if not given."),
        checks.FOLDER_OUT,
    ] = None,
) -> Outcome:
    """Recompute every published figure of the thesis. Each gets an interval from the rounding, and a verdict."""
    from pmg.pipeline.commands.validate import run_validate

    return run_validate(grids, draws, seed, report)


@command("residuals", example="residuals --store store --fit curves")
def residuals(
    store: Annotated[
        Path | None, typer.Option("--store", help="Take the analysed campaign of this store."), checks.STORE
    ] = None,
    grids: Annotated[
        Path | None,
        typer.Option("--grids", help="Take neutral_grid.csv and engaged_grid.csv of this folder instead."),
        checks.GRIDS,
    ] = None,
    fit: Annotated[
        str | None,
        typer.Option(
            "--fit", help="Look at the fit of curves, plane or baseline only; at all that apply if not given."
        ),
    ] = None,
    draws: Annotated[
        int | None, typer.Option("--draws", help="Draw this many synthetic grids for the p-values; 1000 if not given.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Begin the synthetic grids from this seed.")] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write a report to this folder; none if not given."),
        checks.FOLDER_OUT,
    ] = None,
) -> Outcome:
    """Analyse the residuals of the fits. It names the covariates they follow beyond noise, and outliers."""
    from pmg.pipeline.commands.residuals import run_residuals

    return run_residuals(store, grids, fit=fit, draws=draws, seed=seed, report=report)


@command("orders", example="orders --store store --point P17")
def orders(
    store: Annotated[Path, typer.Option("--store", help="Take the recordings of this store."), checks.STORE],
    campaign: CampaignOption = None,
    point: Annotated[str | None, typer.Option("--point", help="Show every line of this test point.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Write orders.csv, load_angles.csv and orders.json to this folder."),
        checks.FOLDER_OUT,
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write a report to this folder; none if not given."),
        checks.FOLDER_OUT,
    ] = None,
) -> Outcome:
    """Analyse the orders of torque, speed and flux density. It gives the load angle too."""
    from pmg.pipeline.commands.orders import run_orders

    return run_orders(store, campaign=campaign, point=point, out=out, report=report)


@command("design", example="design raw/plans/thesis.toml --report detectability")
def design(
    plan: Annotated[
        Path | None,
        typer.Argument(help="Name a TOML file with a [plan] of points to run.", metavar="[PLAN.toml]"),
        checks.FILE,
    ] = None,
    store: Annotated[
        Path | None, typer.Option("--store", help="Take the analysed campaign of this store instead."), checks.STORE
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write a report to this folder; none if not given."),
        checks.FOLDER_OUT,
    ] = None,
    model: ModelOption = None,
    machine: MachineOption = None,
) -> Outcome:
    """Show which effects a campaign can detect. Ask before or after it is run; it lists tests that would improve it."""
    from pmg.pipeline.commands.design import run_design

    return run_design(plan, store, report, model, machine)


@command("terms", example="terms case.toml --out found")
def terms(
    case: Annotated[
        Path, typer.Argument(help="Name a case in TOML; tests/balance has examples.", metavar="CASE"), checks.FILE
    ],
    out: Annotated[
        Path,
        typer.Option("--out", help="Write report.html, tables, terms.json and residuals.csv to this folder."),
        checks.FOLDER_OUT,
    ],
    data: Annotated[
        Path | None,
        typer.Option("--data", help="Read the recordings of this folder instead of the one the case names."),
        checks.PLACE,
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Begin synthetic records and decoys from this seed.")
    ] = None,
    progress: Progress | None = None,
) -> Outcome:
    """Find what the force balance of another machine lacks. It takes a case file, and its recordings."""
    from pmg.pipeline.commands.machines.terms import run_terms

    return run_terms(case, out, data, seed, progress)


class _ProveOptions:
    """Options of a trial, by the names of its settings."""

    campaigns: Annotated[
        int | None, typer.Option("--campaigns", help="Run this many concealed campaigns; 200 if not given.")
    ] = None
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Draw the campaigns from this master seed.")] = None
    strata: Annotated[
        str | None, typer.Option("--strata", help="Draw these kinds only, out of clean,one,outside,two,confounded.")
    ] = None
    laws: Annotated[
        str | None,
        typer.Option(
            "--laws", help="Draw laws of these families: usual if not given; reserved, for a final trial; all."
        ),
    ] = None
    track: Annotated[
        str | None,
        typer.Option("--track", help="Choose steady points (if not given), motion (runs in motion) or machines."),
    ] = None
    route: Annotated[
        str, typer.Option("--route", help="Go by grid, which is fast, or by recordings, through files.")
    ] = "grid"
    recordings: Annotated[
        int | None,
        typer.Option(
            "--recordings", help="Send this many concealed campaigns, and a third as many clean ones, both ways."
        ),
    ] = None
    quick: Annotated[
        bool, typer.Option("--quick", help="Run 12 campaigns, one of them both ways, unless set otherwise.")
    ] = False
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Run with this many processes; with one a processor if not given."),
    ] = None
    case: Annotated[int | None, typer.Option("--case", help="Run this campaign only, and print its result.")] = None


@command("prove", options_of(_ProveOptions), example="prove --out trial --quick")
def prove(
    out: Annotated[
        Path,
        typer.Option("--out", help="Write seal, results, scores.json and report.html to this folder, or resume there."),
        checks.FOLDER_OUT,
    ],
    given: Given,
    progress: Progress | None = None,
) -> Outcome:
    """Test the diagnosis on concealed campaigns. Their truths are sealed; it counts right and wrong causes."""
    from pmg.pipeline.trials.score.stage import TrialOptions, run_prove

    return run_prove(out, TrialOptions(**given), progress)

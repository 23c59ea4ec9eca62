"""The command line: ``pmg ingest``, ``analyse``, ``compare`` and so on; each command parses and calls a stage."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.cli_frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line

if TYPE_CHECKING:
    from pmg.pipeline.options import AnalysisOptions
    from pmg.pipeline.stages import Outcome

app = typer.Typer(
    help="From recordings of a planetary magnetic gearbox to losses, a simulation beside them, and what explains "
    "the difference.",
    epilog="Exit codes: 0 done, 1 done with findings under --fail-on, 2 could not run, 3 partly done (run again to "
    "resume), 70 internal error, 130 interrupted.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Recordings = Annotated[Path, typer.Argument(help="Folder of .mcap recordings, or one file.", metavar="RECORDINGS")]
StoreOption = Annotated[Path, typer.Option("--store", help="Folder of decoded runs and results; made if absent.")]
ReportOption = Annotated[Path, typer.Option("--report", help="Folder of report.html, figures, tables, diagnosis.json.")]
GridsOption = Annotated[
    Path | None, typer.Option("--grids", help="Folder with neutral_grid.csv and engaged_grid.csv, instead.")
]
CampaignOption = Annotated[str | None, typer.Option("--campaign", help="Which campaign, if the store holds several.")]
TermsSun = Annotated[
    str | None,
    typer.Option("--terms-sun", help="Powers of speed in the sun's loss curve, such as 0,1/2,1,2; or auto."),
]
TermsRing = Annotated[str | None, typer.Option("--terms-ring", help="The same for the ring.")]
CorrectionOption = Annotated[
    str | None,
    typer.Option("--k-corr", help="Correction factor: joint (fitted), rule (largest plausible), or a number."),
]
RestOption = Annotated[
    bool | None, typer.Option("--include-rest/--exclude-rest", help="Use readings of resting shafts in the curves.")
]
RobustOption = Annotated[
    bool, typer.Option("--robust", help="Fit the loss curves by Huber's M-estimate instead of least squares.")
]
NoteOption = Annotated[str, typer.Option("--note", help="Told at the head of the report, such as where data are from.")]
WorkersOption = Annotated[int | None, typer.Option("--workers", min=1, help="Parallel workers of the ingest.")]


@app.command()
def ingest(
    recordings: Recordings,
    store: StoreOption,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Decode recordings into the store: torque [N m] and angle [rad] per run, windows judged, findings kept."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_ingest

        with progress_line(as_json) as progress:
            return run_ingest(recordings, store, workers=workers, progress=progress)

    carry_out("ingest", stage, as_json, fail_on)


@app.command()
def analyse(
    store: StoreOption,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    robust: RobustOption = False,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Average windows into neutral and engaged grids, fit losses, calibrate, balance powers."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_analyse

        options = _options(grids, terms_sun, terms_ring, k_corr, include_rest, robust)
        return run_analyse(store, options, grids=grids, campaign=campaign)

    carry_out("analyse", stage, as_json, fail_on)


@app.command()
def compare(
    store: StoreOption,
    report: ReportOption,
    note: NoteOption = "",
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Set the simulator beside the bench, say whether and where they differ, and write the report."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_compare

        return run_compare(store, report, note)

    carry_out("compare", stage, as_json, fail_on)


@app.command()
def run(
    store: StoreOption,
    report: ReportOption,
    recordings: Annotated[
        Path | None, typer.Argument(help="Folder of .mcap recordings, or one file.", metavar="[RECORDINGS]")
    ] = None,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    robust: RobustOption = False,
    note: NoteOption = "",
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Ingest, analyse and compare in one go; or analyse and compare published grids (--grids)."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_all

        options = _options(grids, terms_sun, terms_ring, k_corr, include_rest, robust)
        with progress_line(as_json) as progress:
            return run_all(
                recordings,
                store,
                report,
                options,
                grids=grids,
                campaign=campaign,
                note=note,
                workers=workers,
                progress=progress,
            )

    carry_out("run", stage, as_json, fail_on)


@app.command()
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


@app.command()
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


@app.command()
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


@app.command()
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


def _options(
    grids: Path | None,
    terms_sun: str | None,
    terms_ring: str | None,
    k_corr: str | None,
    include_rest: bool | None,
    robust: bool,
) -> AnalysisOptions:
    from pmg.pipeline.options import chosen_options

    return chosen_options(
        published=grids is not None,
        terms_sun=terms_sun,
        terms_ring=terms_ring,
        correction=k_corr,
        include_rest=include_rest,
        robust=robust,
    )


def main() -> None:
    """Entry of the console scripts.

    Linear algebra keeps to one thread unless the user says otherwise: its matrices here are small, and on a machine
    that is busy, threads that wait for each other make the analysis several times slower.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()

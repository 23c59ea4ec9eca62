"""The command line: ``pmg ingest``, ``analyse``, ``compare`` and so on; each command parses and calls a stage."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline import cli_exchange, cli_studies
from pmg.pipeline.cli_frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line
from pmg.pipeline.cli_options import (
    CampaignOption,
    CorrectionOption,
    GridsOption,
    LimitsOption,
    ModelOption,
    NoteOption,
    Recordings,
    ReportOption,
    RestOption,
    RobustOption,
    SchedulerOption,
    ShardOption,
    StoreOption,
    SupplyOption,
    TermsRing,
    TermsSun,
    WorkersOption,
)

if TYPE_CHECKING:
    from pmg.pipeline.options import AnalysisOptions
    from pmg.pipeline.outcome import Outcome

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


@app.command()
def ingest(
    recordings: Recordings,
    store: StoreOption,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    shard: ShardOption = None,
    limits: LimitsOption = None,
    chart: SupplyOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Decode recordings into the store: torque [N m] and angle [rad] per run, windows judged, findings kept."""

    def stage() -> Outcome:
        from pmg.pipeline.ingest_stage import run_ingest

        with progress_line(as_json) as progress:
            return run_ingest(
                recordings,
                store,
                workers=workers,
                scheduler=scheduler,
                shard=shard,
                limits=limits,
                chart=chart,
                progress=progress,
            )

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
    model: ModelOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Average windows into neutral and engaged grids, fit losses, calibrate, balance powers."""

    def stage() -> Outcome:
        from pmg.pipeline.modelfile_read import with_model
        from pmg.pipeline.stages import run_analyse

        options = _options(grids, terms_sun, terms_ring, k_corr, include_rest, robust)
        if model is not None:
            options = with_model(options, model, k_corr)
        return run_analyse(store, options, grids=grids, campaign=campaign)

    carry_out("analyse", stage, as_json, fail_on)


@app.command()
def compare(
    store: StoreOption,
    report: ReportOption,
    note: NoteOption = "",
    model: ModelOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Set the simulator beside the bench, say whether and where they differ, and write the report."""

    def stage() -> Outcome:
        from pmg.pipeline.stages import run_compare

        return run_compare(store, report, note, model)

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
    model: ModelOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    limits: LimitsOption = None,
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
                scheduler=scheduler,
                limits=limits,
                progress=progress,
                model=model,
            )

    carry_out("run", stage, as_json, fail_on)


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


simulate = app.command()(cli_studies.simulate)
validate = app.command()(cli_studies.validate)
residuals = app.command()(cli_studies.residuals)
orders = app.command()(cli_studies.orders)
design = app.command()(cli_studies.design)
terms = app.command()(cli_studies.terms)
prove = app.command()(cli_studies.prove)
bring = app.command("import")(cli_exchange.bring)
export = app.command()(cli_exchange.export)


def main() -> None:
    """Entry of the console scripts.

    Linear algebra keeps to one thread unless the user says otherwise: its matrices here are small, and on a machine
    that is busy, threads that wait for each other make the analysis several times slower.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()

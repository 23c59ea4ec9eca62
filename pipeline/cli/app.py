"""The command line: ``pmg ingest``, ``analyse``, ``compare`` and so on; each command parses and calls a stage."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.cli import config as cli_config
from pmg.pipeline.cli import exchange, runs, studies
from pmg.pipeline.cli import report as cli_report
from pmg.pipeline.cli.frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line
from pmg.pipeline.cli.group import AnswersInJson
from pmg.pipeline.cli.options import (
    CampaignOption,
    ConfigOption,
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
    from pmg.pipeline.commands.outcome import Outcome


def _grouped(app: typer.Typer, groups: dict[str, typer.Typer]) -> typer.Typer:
    """The command line with these groups of commands, by name."""
    for name, group in groups.items():
        app.add_typer(group, name=name)
    return app


app = _grouped(
    typer.Typer(
        cls=AnswersInJson,
        help="From recordings of a planetary magnetic gearbox to losses, a simulation beside them, and what explains "
        "the difference.",
        epilog="Exit codes: 0 done, 1 done with findings under --fail-on, 2 could not run, 3 partly done (run again to "
        "resume), 70 internal error, 130 interrupted.",
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    ),
    {"runs": runs.app, "config": cli_config.config},
)


def _tell_version(asked: bool) -> None:
    """Print the version and end, where it is asked for."""
    if asked:
        from importlib.metadata import version

        typer.echo(f"pmg {version('pmg-bench')}")
        raise typer.Exit


@app.callback()
def whole(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Hold what is asked of no command."""


@app.command()
def ingest(
    recordings: Recordings = None,
    store: StoreOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    shard: ShardOption = None,
    limits: LimitsOption = None,
    chart: SupplyOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Decode recordings into the store: torque [N m] and angle [rad] per run, windows judged, findings kept."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.ingest import run_ingest
        from pmg.pipeline.settings.chosen import choose

        chosen = choose(
            config,
            recordings=recordings,
            store=store,
            workers=workers,
            scheduler=scheduler,
            limits=limits,
            map=chart,
        )
        with progress_line(as_json) as progress:
            return run_ingest(
                chosen.needed("recordings"),
                chosen.needed("store"),
                workers=chosen.workers,
                scheduler=chosen.text("scheduler"),
                shard=shard,
                limits=chosen.limits,
                chart=chosen.path("map"),
                progress=progress,
            )

    carry_out("ingest", stage, as_json, fail_on)


@app.command()
def analyse(
    store: StoreOption = None,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    robust: RobustOption = None,
    model: ModelOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Average windows into neutral and engaged grids, fit losses, calibrate, balance powers."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.analyse import run_analyse
        from pmg.pipeline.model.read_model import with_model
        from pmg.pipeline.settings.chosen import choose

        chosen = choose(
            config,
            store=store,
            grids=grids,
            campaign=campaign,
            terms_sun=terms_sun,
            terms_ring=terms_ring,
            k_corr=k_corr,
            include_rest=include_rest,
            robust=robust,
        )
        options = chosen.options()
        if model is not None:  # the option alone: what a campaign file names is for the comparison
            options = with_model(options, model, k_corr)
        return run_analyse(
            chosen.needed("store"), options, grids=chosen.path("grids"), campaign=chosen.text("campaign")
        )

    carry_out("analyse", stage, as_json, fail_on)


@app.command()
def compare(
    store: StoreOption = None,
    report: ReportOption = None,
    note: NoteOption = None,
    model: ModelOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Set the simulator beside the bench, say whether and where they differ, and write the report."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.compare import run_compare
        from pmg.pipeline.settings.chosen import choose

        chosen = choose(config, store=store, report=report, note=note, model=model)
        note_told = chosen.text("note") or ""
        return run_compare(
            chosen.needed("store"),
            chosen.needed("report"),
            note_told,
            chosen.path("model"),
            tolerances=chosen.tolerance,
        )

    carry_out("compare", stage, as_json, fail_on)


@app.command()
def run(
    recordings: Recordings = None,
    store: StoreOption = None,
    report: ReportOption = None,
    grids: GridsOption = None,
    campaign: CampaignOption = None,
    terms_sun: TermsSun = None,
    terms_ring: TermsRing = None,
    k_corr: CorrectionOption = None,
    include_rest: RestOption = None,
    robust: RobustOption = None,
    note: NoteOption = None,
    model: ModelOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    limits: LimitsOption = None,
    chart: SupplyOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Ingest, analyse and compare in one go; or analyse and compare published grids (--grids)."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.run import run_all
        from pmg.pipeline.settings.chosen import choose

        chosen = choose(
            config,
            recordings=recordings,
            grids=grids,
            campaign=campaign,
            store=store,
            report=report,
            workers=workers,
            scheduler=scheduler,
            limits=limits,
            map=chart,
            terms_sun=terms_sun,
            terms_ring=terms_ring,
            k_corr=k_corr,
            include_rest=include_rest,
            robust=robust,
            note=note,
            model=model,
        )
        with progress_line(as_json) as progress:
            return run_all(
                chosen.path("recordings"),
                chosen.needed("store"),
                chosen.needed("report"),
                chosen.options(),
                grids=chosen.path("grids"),
                campaign=chosen.text("campaign"),
                note=chosen.text("note") or "",
                workers=chosen.workers,
                scheduler=chosen.text("scheduler"),
                limits=chosen.limits,
                chart=chosen.path("map"),
                progress=progress,
                model=chosen.path("model"),
                tolerances=chosen.tolerance,
            )

    carry_out("run", stage, as_json, fail_on)


simulate = app.command()(studies.simulate)
validate = app.command()(studies.validate)
residuals = app.command()(studies.residuals)
orders = app.command()(studies.orders)
design = app.command()(studies.design)
terms = app.command()(studies.terms)
prove = app.command()(studies.prove)
bring = app.command("import")(exchange.bring)
export = app.command()(exchange.export)
doctor = app.command()(cli_config.doctor)
report = app.command()(cli_report.report)


def main() -> None:
    """Entry of the console scripts.

    Linear algebra keeps to one thread unless the user says otherwise: its matrices here are small, and on a machine
    that is busy, threads that wait for each other make the analysis several times slower.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()

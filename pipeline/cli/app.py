"""The command line: ``pmg ingest``, ``analyse``, ``compare`` and so on; each command parses and calls a stage."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import bench_side, exchange, runs, studies
from pmg.pipeline.cli import config as cli_config
from pmg.pipeline.cli import machine as cli_machine
from pmg.pipeline.cli import report as cli_report
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.group import AnswersInJson
from pmg.pipeline.cli.options import ANALYSIS, RUN, CampaignOptions, Given, options_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress
from pmg.pipeline.files.threads import keep_to_one_thread


def _grouped(app: typer.Typer, groups: dict[str, typer.Typer]) -> typer.Typer:
    """The command line with these groups of commands, by name."""
    for name, group in groups.items():
        app.add_typer(group, name=name)
    return app


app = _grouped(
    typer.Typer(
        cls=AnswersInJson,
        help="Turn recordings of a planetary magnetic gearbox into losses, compare them with the simulation, and name "
        "the cause of the difference.",
        epilog="Exit codes: 0 done, 1 done with findings under --fail-on, 2 could not run, 3 partly done (run again to "
        "resume), 70 internal error, 130 interrupted.",
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    ),
    {"runs": runs.app, "config": cli_config.config, "machine": cli_machine.machine, "bench": cli_machine.bench},
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
@command(
    "ingest",
    options_of(CampaignOptions, "recordings store workers scheduler shard limits map machine config"),
    example="ingest raw/example --store store",
)
def ingest(given: Given, progress: Progress | None = None) -> Outcome:
    """Decode recordings into a store. It keeps torque and angle of each run, steady windows and remarks on the data."""
    from pmg.pipeline.commands.ingest import ingest_chosen
    from pmg.pipeline.settings.chosen import choose

    shard = given.pop("shard")
    return ingest_chosen(choose(**given), progress, shard)


@app.command()
@command(
    "analyse",
    options_of(CampaignOptions, f"store {ANALYSIS} model machine config"),
    example="analyse --store store --k-corr joint",
)
def analyse(given: Given) -> Outcome:
    """Fit the losses of a campaign. This gives mean torques, loss curves, calibration and power balance."""
    from pmg.pipeline.commands.analyse import run_analyse
    from pmg.pipeline.model.read_model import with_model
    from pmg.pipeline.settings.chosen import choose

    model = given.pop("model")
    chosen = choose(**given)
    options = chosen.options()
    if model is not None:  # the option alone: what a campaign file names is for the comparison
        options = with_model(options, model, given["k_corr"])
    store, grids = chosen.needed("store"), chosen.path("grids")
    return run_analyse(store, options, grids=grids, campaign=chosen.text("campaign"), machine=chosen.text("machine"))


@app.command()
@command(
    "compare",
    options_of(CampaignOptions, "store report campaign note model machine config"),
    example="compare --store store --report report",
)
def compare(given: Given, progress: Progress | None = None) -> Outcome:
    """Compare bench and simulation, and write the report. It says where they differ and names the cause."""
    from pmg.pipeline.commands.compare import compare_chosen
    from pmg.pipeline.settings.chosen import choose

    return compare_chosen(choose(**given), progress=progress)


@app.command()
@command(
    "run",
    options_of(CampaignOptions, f"recordings {RUN} config"),
    example="run raw/example --store store --report report",
)
def run(given: Given, progress: Progress | None = None) -> Outcome:
    """Run ingest, analyse and compare in one go. It takes published grids or another machine too."""
    outcome = cli_machine.run_of(given, progress)
    if outcome is not None:
        return outcome
    from pmg.pipeline.files.parallel import keeping_workers
    from pmg.pipeline.settings.chosen import choose

    chosen = choose(**given)
    here = chosen.path("recordings") is not None and chosen.text("scheduler") is None
    with keeping_workers(chosen.workers, loading="pmg.pipeline.commands.ingest_files" if here else ""):
        from pmg.pipeline.commands.compare import run_all

        return run_all(chosen, progress)


demo = app.command()(bench_side.demo)
watch = app.command()(bench_side.watch)
next_test = app.command("next")(bench_side.next_test)
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
    """Entry of the console scripts."""
    keep_to_one_thread()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller: no file of a store may be opened in its place
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 (as long as the process)
    app()

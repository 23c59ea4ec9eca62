"""The commands ``pmg config`` and ``pmg doctor``: what is set, and what recordings permit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.cli.frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line
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
    StoreOption,
    SupplyOption,
    TermsRing,
    TermsSun,
    WorkersOption,
)

if TYPE_CHECKING:
    from pmg.pipeline.commands.outcome import Outcome

config = typer.Typer(
    help="The settings of a campaign: what holds, where it comes from, whether a file is sound.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@config.command()
def show(
    recordings: Recordings = None,
    config: ConfigOption = None,
    origin: Annotated[bool, typer.Option("--origin", help="Say where each setting comes from.")] = False,
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
    as_json: JsonOption = False,
) -> None:
    """Print every setting of 'pmg run' as it would hold with this file and these options."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.config import run_show
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
        return run_show(chosen, origin)

    carry_out("config show", stage, as_json, FailOn.NEVER)


@config.command()
def check(
    file: Annotated[Path, typer.Argument(help="Campaign file in TOML.", metavar="FILE")],
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Say whether a campaign file is sound, and whether what it names is there."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.config import run_check

        return run_check(file)

    carry_out("config check", stage, as_json, fail_on)


@config.command()
def template(as_json: JsonOption = False) -> None:
    """Print a campaign file to begin with: every key with its meaning, commented out."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.config import run_template

        return run_template()

    carry_out("config template", stage, as_json, FailOn.NEVER)


def doctor(
    place: Annotated[
        Path | None, typer.Argument(help="Folder of recordings, one recording, or a store.", metavar="[PLACE]")
    ] = None,
    store: Annotated[
        Path | None, typer.Option("--store", help="Where the store would be: is it writable, is there room?")
    ] = None,
    chart: SupplyOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Say what a set of recordings permits before anything is run, and which recording would permit more."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.doctor import run_doctor
        from pmg.pipeline.settings.chosen import choose

        chosen = choose(config, recordings=place, store=store, map=chart)
        looked_at = chosen.needed("recordings", "PLACE")
        with progress_line(as_json, "doctor") as progress:
            return run_doctor(looked_at, chosen.path("store"), progress, chosen.path("map"))

    carry_out("doctor", stage, as_json, fail_on)

"""The commands ``pmg config`` and ``pmg doctor``: what is set, and what recordings permit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import RUN, CampaignOptions, ConfigOption, Given, MachineOption, SupplyOption, options_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress

config = typer.Typer(
    help="The settings of a campaign: what holds, where it comes from, whether a file is sound.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@config.command()
@command("config show", options_of(CampaignOptions, f"recordings config origin {RUN}"), fails=False)
def show(given: Given) -> Outcome:
    """Print the settings that 'pmg run' would use with this file and these options."""
    from pmg.pipeline.commands.config import run_show
    from pmg.pipeline.settings.chosen import choose

    origin = given.pop("origin")
    return run_show(choose(**given), origin)


@config.command()
@command("config check")
def check(
    file: Annotated[Path, typer.Argument(help="Campaign file in TOML.", metavar="FILE")],
) -> Outcome:
    """Check a campaign file, and that the files it names exist."""
    from pmg.pipeline.commands.config import run_check

    return run_check(file)


@config.command()
@command("config template", fails=False)
def template() -> Outcome:
    """Print a campaign file to start from: every key with its meaning, commented out."""
    from pmg.pipeline.commands.config import run_template

    return run_template()


@command("doctor")
def doctor(
    place: Annotated[
        Path | None, typer.Argument(help="Folder of recordings, one recording, or a store.", metavar="[PLACE]")
    ] = None,
    store: Annotated[
        Path | None, typer.Option("--store", help="Where the store would be: is it writable, is there room?")
    ] = None,
    chart: SupplyOption = None,
    machine: MachineOption = None,
    config: ConfigOption = None,
    progress: Progress | None = None,
) -> Outcome:
    """Check recordings before a run: the chapters they allow, what is missing, and this machine."""
    from pmg.pipeline.commands.doctor import run_doctor
    from pmg.pipeline.settings.chosen import choose

    chosen = choose(config, recordings=place, store=store, map=chart, machine=machine)
    looked_at = chosen.needed("recordings", "PLACE")
    return run_doctor(looked_at, chosen.path("store"), progress, chosen.path("map"), chosen.text("machine"))

"""The commands ``pmg config`` and ``pmg doctor``: what is set, and what recordings permit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import RUN, CampaignOptions, ConfigOption, Given, MachineOption, SupplyOption, options_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress

config = typer.Typer(
    help="Show the settings of a campaign, check its file, or begin one.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@config.command()
@command(
    "config show",
    options_of(CampaignOptions, f"recordings config origin {RUN}"),
    fails=False,
    example="config show --config campaign.toml --origin",
)
def show(given: Given) -> Outcome:
    """Print the settings of a run. They are those that 'pmg run' would use with this file and these options."""
    from pmg.pipeline.commands.config import run_show
    from pmg.pipeline.settings.chosen import choose

    origin = given.pop("origin")
    return run_show(choose(**given), origin)


@config.command()
@command("config check", example="config check campaign.toml")
def check(
    file: Annotated[Path, typer.Argument(help="Name a campaign file in TOML.", metavar="FILE"), checks.FILE],
) -> Outcome:
    """Check a campaign file. All its faults are listed at once, with the files it names that are missing."""
    from pmg.pipeline.commands.config import run_check

    return run_check(file)


@config.command()
@command("config template", fails=False, example="config template > campaign.toml")
def template() -> Outcome:
    """Print a campaign file to start from. Every key stands there with its meaning, commented out."""
    from pmg.pipeline.commands.config import run_template

    return run_template()


@command("doctor", example="doctor raw/example")
def doctor(
    place: Annotated[
        Path | None,
        typer.Argument(
            help="Name recordings of any format, a store, a folder of grids, or a machine, model or campaign file.",
            metavar="[PLACE]",
        ),
        checks.PLACE,
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option("--store", help="Check that a store here would be writable and have room."),
        checks.FOLDER_OUT,
    ] = None,
    chart: SupplyOption = None,
    machine: MachineOption = None,
    config: ConfigOption = None,
    progress: Progress | None = None,
) -> Outcome:
    """Check what is to be run. It lists the chapters that recordings allow, and what is missing."""
    from pmg.pipeline.commands.doctor import run_doctor
    from pmg.pipeline.settings.chosen import choose

    chosen = choose(config, recordings=place, store=store, map=chart, machine=machine)
    looked_at = chosen.path("recordings") or chosen.path("grids") or chosen.needed("recordings", "PLACE")
    return run_doctor(looked_at, chosen.path("store"), progress, chosen.path("map"), chosen.text("machine"))

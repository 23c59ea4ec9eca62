"""Arguments and options that several commands share."""

from __future__ import annotations

from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from pmg.pipeline.cli import checks

ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help="Take settings from this campaign file in TOML; options win over it."),
    checks.FILE,
]
CampaignOption = Annotated[
    str | None, typer.Option("--campaign", help="Choose this campaign where the store holds several.")
]
NoteOption = Annotated[
    str | None, typer.Option("--note", help="Print this at the head of the report, such as where the data come from.")
]
LimitsOption = Annotated[
    Path | None,
    typer.Option("--limits", help="Judge windows by the limits in the table [windows] of this TOML file."),
    checks.FILE,
]
SupplyOption = Annotated[
    Path | None,
    typer.Option("--map", help="Take what recordings lack (run, calibration, channel names) from this TOML file."),
    checks.FILE,
]
ModelOption = Annotated[
    Path | None,
    typer.Option("--model", help="Simulate the losses and mechanisms of this model file, which 'pmg compare' wrote."),
    checks.FILE,
]
WithOption = Annotated[
    list[str] | None,
    typer.Option("--with", help="Switch on a mechanism, as id or id:key=value,key=value; repeat for more."),
]


MachineOption = Annotated[
    str | None,
    typer.Option("--machine", help="Name a machine file, or a machine that ships; without it the thesis bench holds."),
]


ANALYSIS = "grids campaign terms_sun terms_ring k_corr include_rest robust damping"
RUN = f"store report {ANALYSIS} note model workers scheduler limits map machine"
"""Options of the analysis, and of a campaign's whole way."""

Given = dict[str, Any]
"""Values of a group of options, by their names."""


class CampaignOptions:
    """Options on a campaign that several commands share, by the names of their settings."""

    recordings: Annotated[
        Path | None,
        typer.Argument(
            help="Name a folder of recordings (.mcap; with --machine any format), or one file.",
            metavar="[RECORDINGS]",
        ),
        checks.RECORDINGS,
    ]
    config: ConfigOption
    store: Annotated[
        Path | None,
        typer.Option("--store", help="Keep decoded runs and results in this folder; it is made if absent."),
        checks.STORE,
    ]
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write report.html, figures, tables and diagnosis.json to this folder."),
        checks.FOLDER_OUT,
    ]
    grids: Annotated[
        Path | None,
        typer.Option(
            "--grids", help="Take neutral_grid.csv and engaged_grid.csv of this folder instead of recordings."
        ),
        checks.GRIDS,
    ]
    campaign: CampaignOption
    terms_sun: Annotated[
        str | None,
        typer.Option(
            "--terms-sun", help="Fit these powers of speed in the sun's loss curve, such as 0,1/2,1,2; or auto."
        ),
        checks.TERMS,
    ]
    terms_ring: Annotated[
        str | None, typer.Option("--terms-ring", help="Fit these powers in the ring's loss curve."), checks.TERMS
    ]
    k_corr: Annotated[
        str | None,
        typer.Option(
            "--k-corr", help="Find the correction factor by joint fit or by rule, or hold it: joint, rule or a number."
        ),
        checks.CORRECTION,
    ]
    include_rest: Annotated[
        bool | None, typer.Option("--include-rest/--exclude-rest", help="Use readings of resting shafts in the curves.")
    ]
    robust: Annotated[
        bool | None,
        typer.Option("--robust/--no-robust", help="Fit the loss curves by Huber's M-estimate, not by least squares."),
    ]
    damping: Annotated[
        str | None,
        typer.Option(
            "--damping", help="Weigh the fit of K_corr and the damping constants by least-squares or bisquare."
        ),
        checks.DAMPING,
    ]
    note: NoteOption
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Decode with this many processes.")]
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", help="Let the workers of the dask cluster at this address decode, such as tcp://host:8786."
        ),
        checks.SCHEDULER,
    ]
    machine: MachineOption
    origin: Annotated[bool, typer.Option("--origin", help="Say where each setting comes from.")] = False
    shard: Annotated[
        str | None,
        typer.Option("--shard", help="Take part i of n only, as i/n with i from 1; for jobs that share a store."),
        checks.SHARD,
    ]
    limits: LimitsOption
    map: SupplyOption
    model: ModelOption


def options_of(options: type, names: str = "") -> tuple[Parameter, ...]:
    """Options of a class by these names, in this order, all where none are given; None is what is not given."""
    hints = get_type_hints(options, include_extras=True)
    return tuple(
        Parameter(name, Parameter.KEYWORD_ONLY, default=getattr(options, name, None), annotation=hints[name])
        for name in names.split() or hints
    )

"""Arguments and options that several commands share."""

from __future__ import annotations

from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

ConfigOption = Annotated[
    Path | None, typer.Option("--config", help="Campaign file in TOML; options win over what it sets.")
]
CampaignOption = Annotated[str | None, typer.Option("--campaign", help="Which campaign, if the store holds several.")]
NoteOption = Annotated[
    str | None, typer.Option("--note", help="Told at the head of the report, such as where data are from.")
]
LimitsOption = Annotated[
    Path | None, typer.Option("--limits", help="TOML file with limits, [windows], by which windows are judged.")
]
SupplyOption = Annotated[
    Path | None,
    typer.Option("--map", help="TOML file with what recordings lack: run, calibration, channels under other names."),
]
ModelOption = Annotated[
    Path | None, typer.Option("--model", help="Model file that 'pmg compare' wrote: losses and mechanisms are its.")
]
WithOption = Annotated[
    list[str] | None,
    typer.Option("--with", help="Switch on a mechanism, as id or id:key=value,key=value; repeat for more."),
]


MachineOption = Annotated[
    str | None,
    typer.Option("--machine", help="Machine file, or one that ships, of another magnetic gear; else the thesis bench."),
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
            help="Folder of recordings (.mcap; of a machine of one's own any format), or one file.",
            metavar="[RECORDINGS]",
        ),
    ]
    config: ConfigOption
    store: Annotated[Path | None, typer.Option("--store", help="Folder of decoded runs and results; made if absent.")]
    report: Annotated[
        Path | None, typer.Option("--report", help="Folder of report.html, figures, tables, diagnosis.json.")
    ]
    grids: Annotated[
        Path | None, typer.Option("--grids", help="Folder with neutral_grid.csv and engaged_grid.csv, instead.")
    ]
    campaign: CampaignOption
    terms_sun: Annotated[
        str | None,
        typer.Option("--terms-sun", help="Powers of speed in the sun's loss curve, such as 0,1/2,1,2; or auto."),
    ]
    terms_ring: Annotated[str | None, typer.Option("--terms-ring", help="The same for the ring.")]
    k_corr: Annotated[
        str | None,
        typer.Option("--k-corr", help="Correction factor: joint (fitted), rule (largest plausible), or a number."),
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
        typer.Option("--damping", help="Weights of K_corr and the damping constants: least-squares or bisquare."),
    ]
    note: NoteOption
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Parallel workers of the ingest.")]
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", help="Let the workers of a dask cluster do it; its address, such as tcp://host:8786."
        ),
    ]
    machine: MachineOption
    origin: Annotated[bool, typer.Option("--origin", help="Say where each setting comes from.")] = False
    shard: Annotated[
        str | None, typer.Option("--shard", help="Only part i of n, as i/n with i from 1; for jobs that share a store.")
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

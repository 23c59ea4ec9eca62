"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Recordings = Annotated[
    Path | None, typer.Argument(help="Folder of .mcap recordings, or one file.", metavar="[RECORDINGS]")
]
ConfigOption = Annotated[
    Path | None, typer.Option("--config", help="Campaign file in TOML; options win over what it sets.")
]
StoreOption = Annotated[
    Path | None, typer.Option("--store", help="Folder of decoded runs and results; made if absent.")
]
ReportOption = Annotated[
    Path | None, typer.Option("--report", help="Folder of report.html, figures, tables, diagnosis.json.")
]
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
    bool | None,
    typer.Option("--robust/--no-robust", help="Fit the loss curves by Huber's M-estimate, not by least squares."),
]
NoteOption = Annotated[
    str | None, typer.Option("--note", help="Told at the head of the report, such as where data are from.")
]
WorkersOption = Annotated[int | None, typer.Option("--workers", min=1, help="Parallel workers of the ingest.")]
SchedulerOption = Annotated[
    str | None,
    typer.Option("--scheduler", help="Let the workers of a dask cluster do it; its address, such as tcp://host:8786."),
]
ShardOption = Annotated[
    str | None, typer.Option("--shard", help="Only part i of n, as i/n with i from 1; for jobs that share a store.")
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

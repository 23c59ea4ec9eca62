"""Commands that bring recordings of other formats in, and write derived signals for general viewers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import LimitsOption
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress


@command("import")
def bring(
    source: Annotated[
        Path, typer.Argument(help="CSV, TDMS, MF4, HDF5, MAT or Parquet file, or a folder of them.", metavar="SOURCE")
    ],
    chart: Annotated[
        Path | None, typer.Option("--map", help="Channel map in TOML; see pipeline/importers/README.md.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder of the recordings, called like their sources; with --guess, the new map."),
    ] = None,
    words: Annotated[
        list[str] | None, typer.Option("--set", help="Key of the run, such as point=P17, instead of the map's; repeat.")
    ] = None,
    guess: Annotated[
        bool, typer.Option("--guess", help="Propose a channel map for a file, to be completed; nothing is imported.")
    ] = False,
    progress: Progress | None = None,
) -> Outcome:
    """Convert recordings in CSV, TDMS, MF4, HDF5, MAT or Parquet to MCAP of layout pmg.v1, by a channel map."""
    from pmg.pipeline.commands.exchange import run_guess, run_import

    if guess:
        return run_guess(source, chart, out, words or ())
    return run_import(source, chart, out, words or (), progress)


@command("export")
def export(
    recording: Annotated[Path, typer.Argument(help="Recording of layout pmg.v1.", metavar="RECORDING")],
    out: Annotated[Path, typer.Option("--out", help="MCAP file to write.")],
    rate: Annotated[
        float | None, typer.Option("--rate", help="Rate of the derived signals [Hz]; that of the samples if absent.")
    ] = None,
    limits: LimitsOption = None,
) -> Outcome:
    """Write torques, speeds, powers and flags of a recording as MCAP, with a 50 Hz preview for viewers."""
    from pmg.pipeline.commands.exchange import run_export

    return run_export(recording, out, rate, limits)

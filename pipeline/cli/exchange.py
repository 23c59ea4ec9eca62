"""Commands that bring recordings of other formats in, and write derived signals for general viewers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmg.pipeline.cli import checks
from pmg.pipeline.cli.frame import command
from pmg.pipeline.cli.options import LimitsOption
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.progress import Progress
from pmg.sim.errors import BenchError


@command("import", example="import log.csv --map map.toml --out recordings")
def bring(
    source: Annotated[
        Path,
        typer.Argument(help="Name a CSV, TDMS, MF4, HDF5, MAT or Parquet file, or a folder of them.", metavar="SOURCE"),
        checks.PLACE,
    ],
    chart: Annotated[
        Path | None,
        typer.Option("--map", help="Read the channels by this map in TOML; see pipeline/importers/README.md."),
        checks.FILE,
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Write recordings to this folder, named like their sources; with --guess, the map to this file.",
        ),
    ] = None,
    words: Annotated[
        list[str] | None,
        typer.Option("--set", help="Set a key of the run instead of the map, such as point=P17; repeat for more."),
        checks.SETTING,
    ] = None,
    guess: Annotated[
        bool, typer.Option("--guess", help="Propose a channel map for a file, to be completed; import nothing.")
    ] = False,
    machine: Annotated[
        bool, typer.Option("--machine", help="With --guess, propose the file of a machine of one's own instead.")
    ] = False,
    progress: Progress | None = None,
) -> Outcome:
    """Convert recordings of other formats to MCAP. A channel map says which column is which signal of layout pmg.v1."""
    from pmg.pipeline.commands.exchange import run_guess, run_import

    if guess or machine:
        if not guess:
            raise BenchError("--machine", "without --guess", "both", "A machine's own recordings need no import.")
        return run_guess(source, chart, out, words or (), machine=machine)
    return run_import(source, chart, out, words or (), progress)


@command("export", example="export raw/example/0005.mcap --out signals.mcap --rate 50")
def export(
    recording: Annotated[
        Path, typer.Argument(help="Name a recording of layout pmg.v1.", metavar="RECORDING"), checks.FILE
    ],
    out: Annotated[Path, typer.Option("--out", help="Write this MCAP file."), checks.FILE_OUT],
    rate: Annotated[
        float | None,
        typer.Option("--rate", help="Write the signals at this rate [Hz]; without it, at that of the samples."),
        checks.POSITIVE,
    ] = None,
    limits: LimitsOption = None,
) -> Outcome:
    """Write derived signals of a recording as MCAP. It holds torques, speeds, powers, flags and a 50 Hz preview."""
    from pmg.pipeline.commands.exchange import run_export

    return run_export(recording, out, rate, limits)

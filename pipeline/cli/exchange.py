"""Commands that bring recordings of other formats in, and write derived signals for general viewers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pmg.pipeline.cli.frame import FailOn, FailOnOption, JsonOption, carry_out, progress_line
from pmg.pipeline.cli.options import LimitsOption

if TYPE_CHECKING:
    from pmg.pipeline.commands.outcome import Outcome


def bring(
    source: Annotated[Path, typer.Argument(help="CSV, TDMS or MF4 file, or a folder of them.", metavar="SOURCE")],
    chart: Annotated[Path, typer.Option("--map", help="Channel map in TOML; see pipeline/importers/README.md.")],
    out: Annotated[Path, typer.Option("--out", help="Folder of the recordings, called like their sources.")],
    words: Annotated[
        list[str] | None, typer.Option("--set", help="Key of the run, such as point=P17, instead of the map's; repeat.")
    ] = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Bring recordings in CSV, TDMS or MF4 into layout pmg.v1, by a channel map."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.exchange import run_import

        with progress_line(as_json, "import") as progress:
            return run_import(source, chart, out, words or (), progress)

    carry_out("import", stage, as_json, fail_on)


def export(
    recording: Annotated[Path, typer.Argument(help="Recording of layout pmg.v1.", metavar="RECORDING")],
    out: Annotated[Path, typer.Option("--out", help="MCAP file to write.")],
    rate: Annotated[
        float | None, typer.Option("--rate", help="Rate of the derived signals [Hz]; that of the samples if absent.")
    ] = None,
    limits: LimitsOption = None,
    as_json: JsonOption = False,
    fail_on: FailOnOption = FailOn.NEVER,
) -> None:
    """Write torques, speeds, powers and flags of a recording as MCAP, with a 50 Hz preview that viewers plot."""

    def stage() -> Outcome:
        from pmg.pipeline.commands.exchange import run_export

        return run_export(recording, out, rate, limits)

    carry_out("export", stage, as_json, fail_on)

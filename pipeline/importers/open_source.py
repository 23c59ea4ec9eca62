"""The reader for a recording of another format, and whole channels of one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.importers.csv_source import CsvSource
from pmg.pipeline.importers.hdf5_source import Hdf5Source, is_hdf5
from pmg.pipeline.importers.mf4_source import Mf4Source
from pmg.pipeline.importers.source import Wanted
from pmg.pipeline.importers.table_source import TableSource
from pmg.pipeline.importers.tdms_source import TdmsSource
from pmg.sim.errors import RecordingError, near_miss

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.pipeline.importers.csv_dialect import CsvForm
    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

FORMATS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".asc"), "csv"),
    ".tdms": "tdms",
    **dict.fromkeys((".mf4", ".mdf"), "mf4"),
    **dict.fromkeys((".h5", ".hdf5"), "hdf5"),
    ".mat": "mat",
    ".parquet": "parquet",
}
"""Format of a file by the end of its name; a MAT file of version 7.3 is HDF5."""
KINDS_OF_FILE = "CSV, TDMS, MF4, HDF5, MAT or Parquet"
"""The formats, for messages."""


def open_source(path: Path, form: CsvForm, findings: Findings) -> ForeignSource:
    """The reader for a file, by the end of its name.

    Parameters
    ----------
    path : Path
        The file.
    form : CsvForm
        What is said about it, if it is CSV.
    findings : Findings
        Receives what is lost.

    Raises
    ------
    RecordingError
        When the end is of no known format, or the file cannot be read.
    """
    kind = FORMATS.get(path.suffix.lower())
    if kind == "tdms":
        return TdmsSource(path, findings)
    if kind == "mf4":
        return Mf4Source(path)
    if kind == "csv":
        return CsvSource(path, form, findings)
    if kind == "hdf5" or (kind == "mat" and is_hdf5(path)):
        return Hdf5Source(path, findings)
    if kind is not None:
        return TableSource(path, kind)
    came, expected = f"the ending '{path.suffix}'", f"a file in {KINDS_OF_FILE}"
    raise RecordingError(str(path), came, expected, near_miss(path.suffix, FORMATS))


def whole_channels(source: ForeignSource, names: Sequence[str]) -> dict[str, Array]:
    """Channels of a file from the first row to the last, as numbers (n,); NaN where a value is missing."""
    wanted = [Wanted(name) for name in names]
    parts = [block.columns for block in source.blocks(wanted)]
    return {
        want.name: np.concatenate([np.asarray(part[want], dtype=np.float64) for part in parts] or [np.zeros(0)])
        for want in wanted
    }

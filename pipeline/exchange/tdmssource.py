"""Recordings in TDMS, read by npTDMS, which is installed only where it is wanted."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.exchange.source import ROWS, Block, SourceChannel, Wanted, channel_of, optional, quiet, unreadable
from pmg.pipeline.recording.findings import Code
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings

UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
"""Properties in which recorders keep the unit of a channel."""


@dataclass
class TdmsSource:
    """A TDMS file; channels are called ``group/channel``.

    Parameters
    ----------
    path : Path
        The file.
    findings : Findings
        Receives what the file lacks.
    """

    path: Path
    findings: Findings
    format: str = "tdms"
    place: str = "sample"
    reader: str = field(init=False)
    channels: tuple[SourceChannel, ...] = field(init=False)
    properties: Mapping[str, str] = field(init=False)
    reading: Mapping[str, str] = field(default_factory=dict, init=False)
    started_at: datetime | None = field(default=None, init=False)
    _library: Any = field(init=False, repr=False)
    _cut: bool = field(default=False, init=False, repr=False)
    _paths: dict[str, tuple[str, str]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._library = optional("nptdms", "tdms", self.path)
        self.reader = f"npTDMS {self._library.__version__}"
        try:
            with quiet("nptdms"), self.path.open("rb") as stream, self._library.TdmsFile.open(stream) as tdms:
                found = [channel for group in tdms.groups() for channel in group.channels()]
                self.channels = tuple(map(_described, found))
                self._paths = {_name(channel): (channel.group_name, channel.name) for channel in found}
                self.properties = {str(key): str(value) for key, value in tdms.properties.items()}
                starts = {channel.properties.get("wf_start_time") for channel in found} - {None}
                status = tdms.file_status
        except Exception as fault:
            raise unreadable(self.path, "npTDMS", fault) from fault
        if len(starts) == 1:
            self.started_at = _utc(starts.pop())
        if status.incomplete_final_segment:
            self._cut = True
            statuses = (status.channel_statuses or {}).items()
            cut = [f"{name}: {told.read_length} of {told.expected_length}" for name, told in statuses]
            self.findings.error(
                Code.TRUNCATED,
                "last segment",
                f"it is cut ({'; '.join(cut) or 'no channel in it can be read'}); expected a whole segment. What "
                "stands before is read",
                "Copy the file again; the recorder may have been stopped while writing.",
            )

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns, at most `ROWS` rows at a time; values are scaled as the file says.

        Where the last segment is cut, channels that end early are NaN from there on.

        Raises
        ------
        RecordingError
            When a channel is missing, channels differ in length, or the library gives up.
        """
        rows = self._rows(wanted)
        try:
            with quiet("nptdms"), self.path.open("rb") as stream, self._library.TdmsFile.open(stream) as tdms:
                data = {w: tdms[self._paths[w.name][0]][self._paths[w.name][1]] for w in wanted}
                for first in range(0, rows, ROWS):
                    stop = min(first + ROWS, rows)
                    parts = {w: np.asarray(data[w][first * w.columns : stop * w.columns]) for w in wanted}
                    columns = {w: _padded(part[w.column - 1 :: w.columns], stop - first) for w, part in parts.items()}
                    yield Block(np.arange(first + 1, stop + 1), columns)
        except (OSError, ValueError, EOFError, KeyError, IndexError) as fault:
            raise unreadable(self.path, "npTDMS", fault) from fault

    def _rows(self, wanted: Sequence[Wanted]) -> int:
        lengths: dict[str, int] = {}
        for want in wanted:
            length = channel_of(self, want.name, f"{self.path.name}: channel").length or 0
            rows, rest = divmod(length, want.columns)
            lengths[want.name] = rows
            if rest:
                self.findings.warning(
                    Code.SAMPLES_RAGGED,
                    want.name,
                    f"{length} values in {want.columns} interleaved columns; expected a multiple. The last {rest} are "
                    "left out",
                    "Check the number of columns.",
                )
        if len(set(lengths.values())) > 1 and not self._cut:
            told = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            do = "Check `columns` in the map, or whether the recorder stopped early."
            raise RecordingError(str(self.path), f"rows of {told}", "as many rows in each channel", do)
        return max(lengths.values())


def _described(channel: Any) -> SourceChannel:  # noqa: ANN401 - npTDMS has no types
    properties = channel.properties
    unit = next((str(properties[key]) for key in UNITS if properties.get(key)), "")
    step = float(properties.get("wf_increment") or 0.0)
    rate = 1.0 / step if step > 0.0 else None
    if rate is not None and abs(rate - round(rate)) <= 1e-9 * rate:
        rate = float(round(rate))
    return SourceChannel(_name(channel), unit, len(channel), rate)


def _name(channel: Any) -> str:  # noqa: ANN401 - npTDMS has no types
    return f"{channel.group_name}/{channel.name}"


def _padded(values: npt.NDArray[Any], rows: int) -> npt.NDArray[Any]:
    """The values, with NaN behind them where the file ends before the others' last row."""
    if len(values) == rows:
        return values
    return np.concatenate((values.astype(np.float64), np.full(rows - len(values), np.nan)))


def _utc(stamp: Any) -> datetime | None:  # noqa: ANN401 - a numpy or Python time, by version of the library
    """A start as npTDMS gives it, which is UTC without saying so; LabVIEW's zero is no start."""
    found = np.datetime64(stamp, "us").astype(datetime)
    return found.replace(tzinfo=UTC) if isinstance(found, datetime) and found.year >= 1970 else None

"""Recordings in TDMS, read by npTDMS, which is installed only where it is wanted."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pmg.pipeline.importers.library import LibrarySource
from pmg.pipeline.importers.source import SourceChannel, Wanted
from pmg.pipeline.recording.findings import Code
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings

UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
"""Properties in which recorders keep the unit of a channel."""


@dataclass
class TdmsSource(LibrarySource):
    """A TDMS file; channels are called ``group/channel``.

    Where its last segment is cut, channels that end early are NaN from there on.

    Parameters
    ----------
    path : Path
        The file.
    findings : Findings
        Receives what the file lacks.
    """

    findings: Findings
    format: str = field(default="tdms", init=False)
    _module: str = field(default="nptdms", init=False, repr=False)
    _title: str = field(default="npTDMS", init=False, repr=False)
    _licence: str = field(default="LGPL-3.0-only", init=False, repr=False)
    _cut: bool = field(default=False, init=False, repr=False)
    _paths: dict[str, tuple[str, str]] = field(init=False, repr=False)

    def _open(self, stream: BinaryIO) -> Any:  # noqa: ANN401 - npTDMS has no types
        return self._library.TdmsFile.open(stream)

    def _describe(self, opened: Any) -> None:  # noqa: ANN401
        found = [channel for group in opened.groups() for channel in group.channels()]
        self.channels = tuple(map(_described, found))
        self._paths = {_name(channel): (channel.group_name, channel.name) for channel in found}
        self.properties = {str(key): str(value) for key, value in opened.properties.items()}
        starts = {channel.properties.get("wf_start_time") for channel in found} - {None}
        if len(starts) == 1:
            self.started_at = _utc(starts.pop())
        if opened.file_status.incomplete_final_segment:
            self._cut = True
            statuses = (opened.file_status.channel_statuses or {}).items()
            cut = [f"{name}: {status.read_length} of {status.expected_length}" for name, status in statuses]
            self.findings.error(
                Code.TRUNCATED,
                "last segment",
                f"it is cut ({'; '.join(cut) or 'no channel in it can be read'}); expected a whole segment. What "
                "stands before is read",
                "Copy the file again; the recorder may have been stopped while writing.",
            )

    def _read(
        self,
        opened: Any,  # noqa: ANN401
        wanted: Sequence[Wanted],
        first: int,
        count: int,
    ) -> dict[Wanted, npt.NDArray[Any]]:
        columns = {}
        for want in wanted:
            group, name = self._paths[want.name]
            part = np.asarray(opened[group][name][first * want.columns : (first + count) * want.columns])
            columns[want] = _padded(part[want.column - 1 :: want.columns], count)
        return columns

    def _rows(self, wanted: Sequence[tuple[Wanted, SourceChannel]]) -> int:
        lengths: dict[str, int] = {}
        for want, channel in wanted:
            length = channel.length or 0
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
            text = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            do = "Check `columns` in the map, or whether the recorder stopped early."
            raise RecordingError(str(self.path), f"rows of {text}", "as many rows in each channel", do)
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

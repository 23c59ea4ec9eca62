"""Recordings in MDF (MF4), read by asammdf, which is installed only where it is wanted."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pmg.pipeline.importers.library import LibrarySource
from pmg.pipeline.importers.source import SourceChannel, Wanted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

MASTERS = (2, 3)
"""Channel types that hold the time of a group: recorded, and counted."""
ONE_TIME = 0.25
"""Share of a sample by which the times of two groups may differ and still be one."""


@dataclass
class Mf4Source(LibrarySource):
    """An MDF file; a channel that is in several groups is called ``name@group``, with the group's number from 0 on.

    Parameters
    ----------
    path : Path
        The file.
    """

    format: str = field(default="mf4", init=False)
    _module: str = field(default="asammdf", init=False, repr=False)
    _title: str = field(default="asammdf", init=False, repr=False)
    _licence: str = field(default="LGPL-3.0-or-later", init=False, repr=False)
    _paths: dict[str, tuple[int, int]] = field(init=False, repr=False)

    def _open(self, stream: BinaryIO) -> Any:  # noqa: ANN401 - asammdf's own class
        return self._library.MDF(stream)

    def _describe(self, opened: Any) -> None:  # noqa: ANN401
        found = [
            (group, index, channel)
            for group, entries in enumerate(opened.groups)
            for index, channel in enumerate(entries.channels)
        ]
        often = Counter(channel.name for _, _, channel in found)
        masters = {group: channel.name for group, _, channel in found if channel.channel_type in MASTERS}
        rows = [int(entries.channel_group.cycles_nr) for entries in opened.groups]
        self._paths, listed = {}, []
        for group, index, channel in found:
            name = _name(channel.name, group, often)
            clock = _name(masters[group], group, often) if group in masters else ""
            self._paths[name] = group, index
            listed.append(SourceChannel(name, str(channel.unit or ""), rows[group], clock=clock))
        self.channels = tuple(listed)
        self.properties = _properties(opened)
        start = opened.start_time
        self.started_at = start.astimezone(UTC) if start is not None and start.year > 1970 else None

    def _rows(self, wanted: Sequence[tuple[Wanted, SourceChannel]]) -> int:
        for want, _ in wanted:
            if want.columns > 1:
                came, do = f"columns = {want.columns}", "Leave out columns and column."
                raise RecordingError(f"{self.path.name}: {want.name}", came, "one value in each record", do)
        lengths = {self._paths[want.name][0]: channel.length or 0 for want, channel in reversed(wanted)}
        if len(set(lengths.values())) > 1:
            text = ", ".join(f"group {group}: {lengths[group]}" for group in sorted(lengths))
            do = "Resample to one raster where the file is made; pmg does not invent samples."
            raise RecordingError(str(self.path), f"rows of {text}", "as many rows in each group", do)
        return min(lengths.values())

    def _read(
        self,
        opened: Any,  # noqa: ANN401
        wanted: Sequence[Wanted],
        first: int,
        count: int,
    ) -> dict[Wanted, npt.NDArray[Any]]:
        self._one_time(opened, sorted({self._paths[want.name][0] for want in wanted}), first, count)
        return {want: self._column(opened, want, first, count) for want in wanted}

    def _column(self, mdf: Any, want: Wanted, first: int, count: int) -> npt.NDArray[Any]:  # noqa: ANN401
        group, index = self._paths[want.name]
        samples, invalid = mdf.get(
            group=group,
            index=index,
            record_offset=first,
            record_count=count,
            samples_only=True,
            ignore_invalidation_bits=True,
        )
        values = np.asarray(samples)
        values = values.astype(np.uint8) if values.dtype.kind == "b" else values
        if values.ndim != 1 or values.dtype.kind not in "fiu" or len(values) != count:
            came, do = f"{len(values)} values of type {values.dtype}", "Map another channel."
            raise RecordingError(f"{self.path.name}: {want.name}", came, f"{count} numbers", do)
        bad = None if invalid is None else np.asarray(invalid, dtype=np.bool_)
        return values if bad is None or not bad.any() else np.where(bad, np.nan, values.astype(np.float64))

    def _one_time(self, mdf: Any, groups: list[int], first: int, count: int) -> None:  # noqa: ANN401
        """Whether the groups were sampled at the same times."""
        if len(groups) < 2:
            return
        times = [np.asarray(mdf.get_master(group, record_offset=first, record_count=count)) for group in groups]
        step = float(np.median(np.diff(times[0]))) if count > 1 else 0.0
        for group, time in zip(groups[1:], times[1:], strict=True):
            apart = np.abs(time - times[0])
            if (row := int(np.argmax(apart))) < count and apart[row] > ONE_TIME * step:
                came = f"{apart[row]:.6g} s apart from group {groups[0]} at sample {first + row + 1}"
                do = "Resample to one raster where the file is made; pmg does not invent samples."
                raise RecordingError(f"{self.path}: group {group}", came, "groups sampled at the same times", do)


def _name(name: str, group: int, often: Counter[str]) -> str:
    return name if often[name] == 1 else f"{name}@{group}"


def _properties(mdf: Any) -> dict[str, str]:  # noqa: ANN401 - asammdf's header differs by version of the format
    """Author, project and so on, and the named common properties of the header."""
    header = mdf.header
    found = {key: str(getattr(header, key, "") or "") for key in ("author", "department", "project", "subject")}
    common = getattr(header, "_common_properties", None) or {}
    found |= {str(key): str(value) for key, value in common.items() if not isinstance(value, dict)}
    return {key: value for key, value in found.items() if value}

"""Recordings in MDF (MF4), read by asammdf, which is installed only where it is wanted."""

from __future__ import annotations

import gc
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pmg.pipeline.exchange.source import ROWS, Block, SourceChannel, Wanted, channel_of, optional, quiet, unreadable
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

MASTERS = (2, 3)
"""Channel types that hold the time of a group: recorded, and counted."""
ONE_TIME = 0.25
"""Share of a sample by which the times of two groups may differ and still be one."""


@dataclass
class Mf4Source:
    """An MDF file; a channel that is in several groups is called ``name@group``, with the group's number from 0 on.

    Parameters
    ----------
    path : Path
        The file.
    """

    path: Path
    format: str = "mf4"
    place: str = "sample"
    reader: str = field(init=False)
    channels: tuple[SourceChannel, ...] = field(init=False)
    properties: Mapping[str, str] = field(init=False)
    reading: Mapping[str, str] = field(default_factory=dict, init=False)
    started_at: datetime | None = field(default=None, init=False)
    _library: Any = field(init=False, repr=False)
    _paths: dict[str, tuple[int, int]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._library = optional("asammdf", "mf4", self.path)
        self.reader = f"asammdf {self._library.__version__}"
        with self._opened() as mdf:
            found = [
                (group, index, channel)
                for group, entries in enumerate(mdf.groups)
                for index, channel in enumerate(entries.channels)
            ]
            often = Counter(channel.name for _, _, channel in found)
            masters = {group: channel.name for group, _, channel in found if channel.channel_type in MASTERS}
            rows = [int(entries.channel_group.cycles_nr) for entries in mdf.groups]
            self._paths, listed = {}, []
            for group, index, channel in found:
                name = _name(channel.name, group, often)
                clock = _name(masters[group], group, often) if group in masters else ""
                self._paths[name] = group, index
                listed.append(SourceChannel(name, str(channel.unit or ""), rows[group], clock=clock))
            self.channels = tuple(listed)
            self.properties = _properties(mdf)
            start = mdf.start_time
            self.started_at = start.astimezone(UTC) if start is not None and start.year > 1970 else None

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns, at most `ROWS` rows at a time; values are converted as the file says.

        Raises
        ------
        RecordingError
            When a channel is missing, the groups have no common time, or the library gives up.
        """
        described = [channel_of(self, want.name, f"{self.path.name}: channel") for want in wanted]
        for want in wanted:
            if want.columns > 1:
                came, do = f"columns = {want.columns}", "Leave out columns and column."
                raise RecordingError(f"{self.path.name}: {want.name}", came, "one value in each record", do)
        groups = sorted({self._paths[want.name][0] for want in wanted})
        lengths = {
            group: next(c.length or 0 for w, c in zip(wanted, described, strict=True) if self._of(w) == group)
            for group in groups
        }
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"group {group}: {length}" for group, length in lengths.items())
            do = "Resample to one raster where the file is made; pmg does not invent samples."
            raise RecordingError(str(self.path), f"rows of {told}", "as many rows in each group", do)
        rows = lengths[groups[0]]
        with self._opened() as mdf:
            for first in range(0, rows, ROWS):
                count = min(ROWS, rows - first)
                self._one_time(mdf, groups, first, count)
                columns = {want: self._read(mdf, want, first, count) for want in wanted}
                yield Block(np.arange(first + 1, first + count + 1), columns)

    def _of(self, want: Wanted) -> int:
        return self._paths[want.name][0]

    def _read(self, mdf: Any, want: Wanted, first: int, count: int) -> npt.NDArray[Any]:  # noqa: ANN401
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

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """The file, opened by the library without its own talk; whatever the library raises is told as one error."""
        with quiet("asammdf"), self.path.open("rb") as stream:
            mdf = self._made(stream)
            try:
                yield mdf
            except (RecordingError, GeneratorExit):
                raise
            except Exception as fault:
                raise unreadable(self.path, "asammdf", fault) from fault
            finally:
                mdf.close()

    def _made(self, stream: BinaryIO) -> Any:  # noqa: ANN401 - asammdf's own class
        """The library's object; one that it leaves half-made is thrown away here, where its talk is not heard."""
        try:
            return self._library.MDF(stream)
        except Exception as fault:
            problem = unreadable(self.path, "asammdf", fault)
        gc.collect()
        raise problem


def _name(name: str, group: int, often: Counter[str]) -> str:
    return name if often[name] == 1 else f"{name}@{group}"


def _properties(mdf: Any) -> dict[str, str]:  # noqa: ANN401 - asammdf's header differs by version of the format
    """Author, project and so on, and the named common properties of the header."""
    header = mdf.header
    found = {key: str(getattr(header, key, "") or "") for key in ("author", "department", "project", "subject")}
    common = getattr(header, "_common_properties", None) or {}
    found |= {str(key): str(value) for key, value in common.items() if not isinstance(value, dict)}
    return {key: value for key, value in found.items() if value}

"""Recordings in HDF5, and in MAT of version 7.3, which is HDF5: read by h5py, installed only where it is wanted."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pmg.pipeline.importers.hdf5_members import DatasetPlace, Unread, members
from pmg.pipeline.importers.hdf5_words import text_of
from pmg.pipeline.importers.library import LibrarySource
from pmg.pipeline.importers.source import SourceChannel, Wanted
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings

    Written = npt.NDArray[np.bool_]

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of HDF5; they stand at the beginning, or at 512, 1024, 2048 and so on."""
FURTHEST = 1 << 20
"""Last place at which they are looked for [bytes]."""
MATLAB_HEADS = (b"\x00\x02IM", b"\x02\x00MI")
"""Version 2 in the head of a MAT file, which names itself 7.3, in both orders of bytes."""
SMALLEST_CACHE = 1 << 20
"""Least memory for chunks of a dataset [bytes]; it grows to the largest chunk, which is read as a whole."""
WIDEST_BAND = 32
"""Columns of a matrix that are read together where several of them are wanted."""
BELIEVED = 1000
"""Values for each byte of the file up to which a dataset with chunks that were never written is believed."""
MOST_CHUNKS = 100_000_000
"""Chunks of a dataset up to which it is looked up which of them were written."""


@dataclass
class Hdf5Source(LibrarySource):
    """An HDF5 file; channels are called by their path, columns of a matrix ``group/x(:,2)`` or ``group/x(2,:)``.

    What holds no rows of numbers keeps its name, and is refused with the reason when it is asked for.

    Parameters
    ----------
    path : Path
        The file.
    findings : Findings
        Receives what was never written.
    """

    findings: Findings
    format: str = field(default="hdf5", init=False)
    _module: str = field(default="h5py", init=False, repr=False)
    _title: str = field(default="h5py", init=False, repr=False)
    _licence: str = field(default="BSD-3-Clause", init=False, repr=False)
    _cache: int = field(default=SMALLEST_CACHE, init=False, repr=False)
    _places: dict[str, DatasetPlace] = field(default_factory=dict, init=False, repr=False)
    _unread: dict[str, Unread] = field(default_factory=dict, init=False, repr=False)
    _written: dict[str, Written | None] = field(default_factory=dict, init=False, repr=False)

    def _open(self, stream: BinaryIO) -> Any:  # noqa: ANN401 - h5py has no types
        return self._library.File(stream, "r", rdcc_nbytes=self._cache)

    def _describe(self, opened: Any) -> None:  # noqa: ANN401
        found = list(members(self._library, opened))
        often = Counter(member.name for member in found)
        channels = []
        for member in found:
            if often[member.name] > 1:
                do = "Rename one of them in the file."
                self._unread[member.name] = Unread(f"{often[member.name]} datasets of this name", do)
            elif isinstance(member.place, Unread):
                self._unread[member.name] = member.place
            else:
                self._places[member.name] = member.place
                self._cache = max(self._cache, member.place.chunk_bytes)
            place = self._places.get(member.name)
            channels.append(SourceChannel(member.name, member.unit, place.length if place else None))
        self.channels = tuple(dict.fromkeys(channels))
        self.properties = {
            str(key): text for key in opened.attrs if (text := text_of(opened.attrs, key)) is not None
        } | {member.name: member.fact for member in found if member.fact}

    def _rows(self, wanted: Sequence[tuple[Wanted, SourceChannel]]) -> int:
        lengths: dict[str, int] = {}
        for want, _ in wanted:
            where = f"{self.path.name}: {want.name}"
            if want.name in self._unread:
                unread = self._unread[want.name]
                raise RecordingError(where, unread.came, "rows of numbers", unread.do)
            if want.columns > 1:
                came, do = f"columns = {want.columns}", "Name the column by its own name, such as x(:,2)."
                raise RecordingError(where, came, "one value in each row", do)
            lengths[want.name] = self._places[want.name].length
        if len(set(lengths.values())) > 1:
            text = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            do = "Export them anew, at one rate; pmg does not invent samples."
            raise RecordingError(str(self.path), f"rows of {text}", "as many rows in each channel", do)
        return max(lengths.values(), default=0)

    def _read(
        self,
        opened: Any,  # noqa: ANN401
        wanted: Sequence[Wanted],
        first: int,
        count: int,
    ) -> dict[Wanted, npt.NDArray[Any]]:
        lines: dict[str, list[int]] = {}
        for want in wanted:
            place = self._places[want.name]
            lines.setdefault(place.path, []).append(place.line)
        columns = {}
        bands: dict[str, npt.NDArray[Any]] = {}
        for want in wanted:
            place = self._places[want.name]
            dataset, low, high = opened[place.path], min(lines[place.path]), max(lines[place.path]) + 1
            if high - low > WIDEST_BAND:
                values = place.band(dataset, place.line, place.line + 1, first, count)[0]
            else:
                if place.path not in bands:
                    bands[place.path] = place.band(dataset, low, high, first, count)
                values = bands[place.path][place.line - low]
            columns[want] = self._known(dataset, want.name, values, first)
        return columns

    def _known(self, dataset: Any, name: str, values: npt.NDArray[Any], first: int) -> npt.NDArray[Any]:  # noqa: ANN401
        """The values, NaN where they were never written and HDF5 would give its fill value instead."""
        place = self._places[name]
        if name not in self._written:
            written = _written_chunks(dataset, self.path)
            self._written[name] = None if written is None else place.in_chunks(written)
            self._tell_unwritten(name, self._written[name], place)
        written = self._written[name]
        if written is None:
            return values
        rows = np.arange(first, first + len(values)) // place.chunk_rows
        return np.where(written[rows], values.astype(np.float64), np.nan)

    def _tell_unwritten(self, name: str, written: Written | None, place: DatasetPlace) -> None:
        if written is None or written.all():
            return
        ends = np.append(np.arange(1, len(written)) * place.chunk_rows, place.length)
        lost = int(np.diff(ends, prepend=0)[~written].sum())
        begin = int(np.argmin(written)) * place.chunk_rows + 1
        self.findings.error(
            Code.TRUNCATED,
            f"{name}, from sample {begin}",
            f"{counted(lost, 'value')} were never written; expected {place.length}. They become a gap",
            "The recorder may have been stopped, or may have announced more than it wrote.",
            lost=counted(lost, "sample"),
        )


def is_hdf5(path: Path) -> bool:
    """Whether a file is HDF5, or says in the head of a MAT file that it is one of version 7.3."""
    with path.open("rb") as stream:
        head = stream.read(128)
        if head.startswith((SIGNATURE, b"MATLAB 7.3")) or head[124:] in MATLAB_HEADS:
            return True
        at = 512
        while at <= FURTHEST:
            stream.seek(at)
            if stream.read(len(SIGNATURE)) == SIGNATURE:
                return True
            at *= 2
    return False


def _written_chunks(dataset: Any, path: Path) -> Written | None:  # noqa: ANN401 - h5py has no types
    """Which chunks were written, by their place in the dataset; None where all were.

    Raises
    ------
    RecordingError
        When a dataset is so much larger than its file that its size is damage.
    """
    whole = dataset.id
    if dataset.chunks is None:
        return np.zeros((1,) * dataset.ndim, dtype=np.bool_) if dataset.size and not whole.get_storage_size() else None
    grid = tuple(-(-length // chunk) for length, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    expected = int(np.prod([float(n) for n in grid]))
    if whole.get_num_chunks() == expected:
        return None
    size = path.stat().st_size
    if dataset.size > BELIEVED * size or expected > MOST_CHUNKS:
        came = f"{dataset.size} values announced in a file of {size} bytes"
        raise RecordingError(f"{path.name}: {dataset.name}", came, "as many as it holds", "Copy the file again.")
    written = np.zeros(grid, dtype=np.bool_)

    def mark(chunk: Any) -> None:  # noqa: ANN401
        written[tuple(at // rows for at, rows in zip(chunk.chunk_offset, dataset.chunks, strict=True))] = True

    whole.chunk_iter(mark)
    return written

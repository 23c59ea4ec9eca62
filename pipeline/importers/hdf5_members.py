"""Members of an HDF5 file: where each channel lies, its unit, and what holds no rows of numbers, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.hdf5_words import Handle, fact_of, text_of, units_of, word
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

OF_MATLAB = ("#refs#", "#subsystem#")
"""Groups in which MATLAB keeps what cells and objects refer to."""
NUMBERS_OF_MATLAB = (
    "double",
    "single",
    "logical",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)
MOST_MEMBERS = 100_000
"""Datasets and groups that are listed; groups that hold one another may otherwise never end."""
MOST_LINES = 1000
"""Columns of a matrix up to which each is a channel; beyond, it is a picture or a map."""
APART = "Write each row of numbers as a dataset of its own."


@dataclass(frozen=True)
class Unread:
    """What stands in place of rows of numbers.

    Parameters
    ----------
    came, do : str
        What it is, and what can be done about it.
    """

    came: str
    do: str = APART


@dataclass(frozen=True)
class DatasetPlace:
    """Place of a channel in the file.

    Parameters
    ----------
    path : str
        Dataset.
    dimensions : int
        1 or 2.
    axis : int
        Along which the samples lie.
    line : int
        Which line along it, from 0 on.
    length : int
        Samples.
    chunk : tuple of int
        Shape of its chunks; that of the whole where it has none.
    chunk_bytes : int
        Their size [bytes]; 0 where it has none.
    """

    path: str
    dimensions: int
    axis: int
    line: int
    length: int
    chunk: tuple[int, ...]
    chunk_bytes: int

    @property
    def chunk_rows(self) -> int:
        """Samples of a chunk."""
        return max(self.chunk[self.axis], 1)

    def band(self, dataset: Handle, low: int, high: int, first: int, count: int) -> npt.NDArray[Any]:
        """That many samples of neighbouring lines (lines, samples), in the order of bytes of this machine."""
        rows, lines = slice(first, first + count), slice(low, high)
        if self.dimensions == 1:
            values = np.asarray(dataset[rows])[np.newaxis]
        else:
            values = np.asarray(dataset[(rows, lines) if self.axis == 0 else (lines, rows)])
            values = values.T if self.axis == 0 else values
        return values.astype(np.uint8 if values.dtype.kind == "b" else values.dtype.newbyteorder("="), copy=False)

    def in_chunks(self, written: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether each chunk along the channel was written (n,), from the same of all chunks of the dataset."""
        if self.dimensions == 1:
            return written
        across = self.line // max(self.chunk[1 - self.axis], 1)
        return np.asarray(np.take(written, across, axis=1 - self.axis), dtype=np.bool_)


@dataclass(frozen=True)
class Hdf5Member:
    """A channel, or what could not become one.

    Parameters
    ----------
    name : str
        Path in the file, with the column where it is one.
    place : DatasetPlace or Unread
        Where it lies, or what it is instead.
    unit : str
        Unit that an attribute names.
    fact : str
        What it says, where it is a single number or word.
    """

    name: str
    place: DatasetPlace | Unread
    unit: str = ""
    fact: str = ""


def members(library: Handle, opened: Handle) -> Iterator[Hdf5Member]:
    """Everything in a file that could be a channel, group after group.

    Raises
    ------
    RecordingError
        When it holds more than `MOST_MEMBERS`.
    """
    home = library.h5o.get_info(opened.id).fileno
    waiting: list[tuple[str, Handle, frozenset[int]]] = [("", opened, frozenset())]
    seen = 0
    while waiting:
        prefix, group, above = waiting.pop()
        above |= {library.h5o.get_info(group.id).addr}
        inside = []
        for key in group:
            seen += 1
            if seen > MOST_MEMBERS:
                do = "Export the channels of the bench alone."
                raise RecordingError(prefix or "/", "groups without end", f"up to {MOST_MEMBERS} members", do)
            name = f"{prefix}{key}"
            if not prefix and key in OF_MATLAB:
                continue
            if not name.isprintable():
                yield Hdf5Member(repr(name), Unread("a name that is no text", "Rename it in the file."))
                continue
            try:
                item = _opened(library, group, key, home)
                if isinstance(item, Unread):
                    yield Hdf5Member(name, item)
                elif isinstance(item, library.Dataset):
                    yield from _described(library, name, item)
                elif not isinstance(item, library.Group):
                    yield Hdf5Member(name, Unread("a type of values, and no values"))
                elif "MATLAB_sparse" in item.attrs:
                    yield Hdf5Member(name, Unread("a sparse matrix", "Save it with full()."))
                elif library.h5o.get_info(item.id).addr in above:
                    yield Hdf5Member(name, Unread("a group that holds itself"))
                else:
                    inside.append((f"{name}/", item, above))
            except RecordingError:
                raise
            except Exception as fault:  # one damaged member ends h5py in errors of any kind; the others are sound
                text = " ".join(str(fault).split())[:200]
                yield Hdf5Member(
                    name, Unread(f"it cannot be opened ({type(fault).__name__}: {text})", "Copy the file again.")
                )
        waiting += reversed(inside)


def _opened(library: Handle, group: Handle, key: str, home: Any) -> Handle | Unread:  # noqa: ANN401
    """The member of that name; one that lies in another file is none."""
    link = group.get(key, getlink=True)
    elsewhere = "Copy it into the file: its hash stands for all that was read."
    if isinstance(link, library.ExternalLink):
        return Unread(f"a link to another file, '{link.filename}'", elsewhere)
    try:
        item = group[key]
    except KeyError:
        if isinstance(link, library.SoftLink):
            return Unread(f"a link to '{link.path}', which is not there", "Correct the export.")
        raise
    if library.h5o.get_info(item.id).fileno != home:
        return Unread("a link into another file", elsewhere)
    return item


def _described(library: Handle, name: str, dataset: Handle) -> Iterator[Hdf5Member]:
    """The channels of a dataset: itself, or each line of a matrix along its longer side."""
    unread = _unread(library, dataset)
    if unread is not None:
        yield Hdf5Member(name, unread, fact=fact_of(dataset))
        return
    stored = dataset.shape
    of_matlab = text_of(dataset.attrs, "MATLAB_class") is not None
    rows, columns = (1, *stored)[-2:] if len(stored) == 1 else stored[::-1] if of_matlab else stored
    wide = columns > rows
    axis = 0 if len(stored) == 1 else int(wide != of_matlab)
    chunk = dataset.chunks or tuple(max(length, 1) for length in stored)
    size = 0 if dataset.chunks is None else int(np.prod(dataset.chunks)) * dataset.dtype.itemsize
    if len(stored) == 2 and (lines := min(stored)) > 1:
        units = units_of(dataset, lines)
        for line in range(lines):
            place = DatasetPlace(dataset.name, 2, axis, line, max(stored), chunk, size)
            yield Hdf5Member(f"{name}({line + 1},:)" if wide else f"{name}(:,{line + 1})", place, units[line])
    else:
        length = 0 if 0 in stored else max(stored)
        yield Hdf5Member(
            name, DatasetPlace(dataset.name, len(stored), axis, 0, length, chunk, size), units_of(dataset, 1)[0]
        )


def _unread(library: Handle, dataset: Handle) -> Unread | None:
    """Why a dataset is no channel; None where it is one."""
    kind = text_of(dataset.attrs, "MATLAB_class")
    if kind is not None and kind not in NUMBERS_OF_MATLAB:
        return Unread({"char": "text", "cell": "a cell array"}.get(kind, f"values of the class {kind}"))
    if "MATLAB_empty" in dataset.attrs or dataset.shape is None:
        return Unread("no values")
    if (kept := _kept(dataset.dtype)) is not None:
        return kept
    if dataset.shape == ():
        return Unread("a single number", "Name a dataset with a value for each row.")
    if len(dataset.shape) > 2:
        shape = " by ".join(map(str, dataset.shape))
        return Unread(f"an array of {len(dataset.shape)} dimensions, {shape}")
    if len(dataset.shape) == 2 and min(dataset.shape) > MOST_LINES:
        return Unread(f"a matrix of {dataset.shape[0]} by {dataset.shape[1]}")
    if dataset.is_virtual or dataset.external:
        return Unread("values that lie in other files", "Copy them into the file, with h5repack or h5py.")
    if {text_of(dataset.attrs, "scale_factor"), text_of(dataset.attrs, "add_offset")} - {None, "1", "1.0", "0", "0.0"}:
        return Unread("packed values, with scale_factor or add_offset", "Write them in their unit.")
    made = dataset.id.get_create_plist()
    for code, _, _, title in (made.get_filter(n) for n in range(made.get_nfilters())):
        if not library.h5z.filter_avail(code):
            came = f"values compressed by filter {code} '{(word(title) or '')}', which h5py lacks"
            return Unread(came, "Write it with gzip, or without compression: h5repack -f GZIP=4.")
    return None


def _kept(dtype: np.dtype[Any]) -> Unread | None:
    """What values are that are no numbers."""
    if dtype.names is not None:
        return Unread(f"compound values with the fields {', '.join(dtype.names)}")
    if dtype.kind in "fiub" and dtype.subdtype is None:
        return None
    words = {"c": "complex numbers", "S": "text", "U": "text", "V": "values without a type"}
    return Unread(
        words.get(dtype.kind, "text, or references to other datasets") if dtype.subdtype is None else "arrays"
    )

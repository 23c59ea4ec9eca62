"""A recording of another format: its channels, and its samples block by block, whatever the format."""

from __future__ import annotations

import logging
import re
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Protocol

from pmg.sim.errors import RecordingError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path
    from types import ModuleType

    import numpy as np
    import numpy.typing as npt

BRACKETED = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")
"""A name with its unit, as headers have it."""

ROWS = 64_000
"""Rows of a block: what is in memory at a time, and a multiple of the samples of a written block."""


@dataclass(frozen=True)
class SourceChannel:
    """A channel as its file describes it.

    Parameters
    ----------
    name : str
        Name under which a channel map asks for it.
    unit : str
        Unit that the file declares; empty where it does not.
    length : int, optional
        Values in it, where the file says so.
    rate_hz : float, optional
        Sample rate that the file declares for it [Hz].
    clock : str
        Name of the channel that holds its times; empty where there is none.
    """

    name: str
    unit: str = ""
    length: int | None = None
    rate_hz: float | None = None
    clock: str = ""


@dataclass(frozen=True)
class Wanted:
    """Request for a channel: all of its values, or one of the columns that are interleaved in it.

    Parameters
    ----------
    name : str
        Channel.
    columns : int
        How many columns are interleaved.
    column : int
        Which of them, from 1 on.
    """

    name: str
    columns: int = 1
    column: int = 1


@dataclass(frozen=True)
class Block:
    """Some rows of a file.

    Parameters
    ----------
    places : (n,) array of int
        Where each row stands: its line or its sample number, from 1 on.
    columns : mapping of Wanted to (n,) array
        The values, in the type of the file; NaN where a cell is empty.
    """

    places: npt.NDArray[np.int64]
    columns: Mapping[Wanted, npt.NDArray[Any]]


class ForeignSource(Protocol):
    """Interface of every reader."""

    path: Path
    format: str
    """``csv``, ``tdms``, ``mf4``, ``hdf5``, ``mat`` or ``parquet``."""
    reader: str
    """Library that reads it, with its version."""
    place: str
    """Unit of `Block.places`: ``line`` or ``sample``."""
    channels: tuple[SourceChannel, ...]
    properties: Mapping[str, str]
    """Facts that the file states itself."""
    reading: Mapping[str, str]
    """Dialect that was found, where the format leaves it open; else empty."""
    started_at: datetime | None
    """Start of the recording [UTC], where the file says so."""

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns from the first row to the last, at most `ROWS` rows at a time."""


def channel_of(source: ForeignSource, name: str, where: str) -> SourceChannel:
    """The channel of that name, which may stand with its unit in brackets.

    Raises
    ------
    RecordingError
        When the file holds none; near misses are named.
    """
    found = [channel for channel in source.channels if channel.name == name]
    with_unit = BRACKETED.fullmatch(name)
    if not found and with_unit is not None:  # as the header has it, unit and all
        asked = with_unit["name"].strip(), with_unit["unit"].strip()
        found = [channel for channel in source.channels if (channel.name, channel.unit) == asked]
    if not found:
        names = [channel.name for channel in source.channels]
        do = near_miss(name, names) if names else "The file holds no channel: check the recorder."
        raise RecordingError(where, f"'{name}'", f"a channel of {source.path.name}", do)
    return found[0]


def optional(library: str, extra: str, licence: str, path: Path) -> ModuleType:
    """A library that is installed only where it is wanted, loaded when it is first needed.

    Raises
    ------
    RecordingError
        When it is not installed; the message names the extra that brings it.
    """
    if find_spec(library) is None:
        came = f"the library that reads this format, '{library}', is not installed"
        install = f"{sys.executable} -m pip install {library}"
        do = f"Install it: {install} (the extra pmg-bench[{extra}]). Its licence: {licence}."
        raise RecordingError(str(path), came, "a format that can be read", do)
    return import_module(library)


def _unheard(_: object) -> None:
    """No action on a fault in an object that is thrown away."""


@contextmanager
def quiet(library: str) -> Iterator[None]:
    """Keep a library from talking on standard error: what it says is reported as a finding or an error.

    That includes faults of its half-made objects when they are thrown away.
    """
    names = [name for name in logging.root.manager.loggerDict if name == library or name.startswith(f"{library}.")]
    levels = {name: logging.getLogger(name).level for name in names}
    hook = sys.unraisablehook
    try:
        sys.unraisablehook = _unheard
        for name in levels:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        yield
    finally:
        sys.unraisablehook = hook
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def unreadable(path: Path, library: str, fault: Exception) -> RecordingError:
    """The error for a file that its library cannot read."""
    text = " ".join(str(fault).split())[:300]
    came = f"{library} cannot read it ({type(fault).__name__}: {text})"
    return RecordingError(str(path), came, "a whole file of its format", "Copy it again from the recorder.")

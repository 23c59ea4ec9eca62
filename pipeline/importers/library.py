"""Recordings that a library reads which is installed only where it is wanted: what is the same of all such formats."""

from __future__ import annotations

import gc
from abc import ABC, abstractmethod
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from pmg.pipeline.importers.source import (
    ROWS,
    Block,
    SourceChannel,
    Wanted,
    channel_of,
    optional,
    quiet,
    unreadable,
)
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    import numpy.typing as npt


@dataclass
class LibrarySource(ABC):
    """A file of samples in records, opened by a library; it is described when it is made, and read block by block.

    Parameters
    ----------
    path : Path
        The file.
    """

    path: Path
    format: str = field(init=False)
    place: str = field(default="sample", init=False)
    reader: str = field(init=False)
    channels: tuple[SourceChannel, ...] = field(init=False)
    properties: Mapping[str, str] = field(init=False)
    reading: Mapping[str, str] = field(default_factory=dict, init=False)
    started_at: datetime | None = field(default=None, init=False)
    _module: str = field(init=False, repr=False)
    _title: str = field(init=False, repr=False)
    _licence: str = field(init=False, repr=False)
    _library: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._library = optional(self._module, self.format, self._licence, self.path)
        self.reader = f"{self._title} {self._library.__version__}"
        with self._opened() as opened:
            self._describe(opened)

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns, at most `ROWS` rows at a time; values are as the file says they are to be scaled.

        Raises
        ------
        RecordingError
            When a channel is missing, the channels do not belong to the same rows, or the library gives up.
        """
        rows = self._rows([(want, channel_of(self, want.name, f"{self.path.name}: channel")) for want in wanted])
        with self._opened() as opened:
            for first in range(0, rows, ROWS):
                count = min(ROWS, rows - first)
                columns = self._read(opened, wanted, first, count)
                yield Block(np.arange(first + 1, first + count + 1), columns)

    @abstractmethod
    def _open(self, stream: BinaryIO) -> Any:  # noqa: ANN401 - an object of the library, which has no types
        """The library's object of an open file."""

    @abstractmethod
    def _describe(self, opened: Any) -> None:  # noqa: ANN401
        """Set `channels`, `properties` and `started_at`."""

    @abstractmethod
    def _rows(self, wanted: Sequence[tuple[Wanted, SourceChannel]]) -> int:
        """Rows that the wanted columns have in common."""

    @abstractmethod
    def _read(
        self,
        opened: Any,  # noqa: ANN401
        wanted: Sequence[Wanted],
        first: int,
        count: int,
    ) -> dict[Wanted, npt.NDArray[Any]]:
        """That many rows of the wanted columns from a row on, counted from 0."""

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """The file, opened by the library without its own talk; what the library raises becomes one error."""
        with quiet(self._module), self.path.open("rb") as stream:
            opened = self._made(stream)
            try:
                yield opened
            except RecordingError:
                raise
            except Exception as fault:
                raise unreadable(self.path, self._title, fault) from fault
            finally:
                opened.close()

    def _made(self, stream: BinaryIO) -> Any:  # noqa: ANN401
        """The library's object; one that it leaves half-made is thrown away here, where its talk is not heard."""
        try:
            return self._open(stream)
        except Exception as fault:
            problem = unreadable(self.path, self._title, fault)
        gc.collect()
        raise problem

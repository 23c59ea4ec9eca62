"""Messages of one channel, held one behind another in a few arrays instead of as many objects."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy.typing as npt

    Bytes = npt.NDArray[np.uint8]
    Places = npt.NDArray[np.int64]

TOGETHER = 1 << 15
"""Small messages that are read together: a bound on what is held of them a second time."""
SMALLEST, GROWTH, LARGEST = 1 << 16, 4, 1 << 24
"""Length of the first array, by how much each is longer than the one before, and how long at most [bytes]: systems hand
out memory for long arrays in large pages, of which a channel of few bytes would fill a part only."""


class Messages:
    """Messages of one channel, in file order.

    Notes
    -----
    They stand in arrays of up to `LARGEST` bytes, so that a chunk is let go once its messages are taken, and so that
    messages of one length are a matrix, one message a row, without being touched one by one.
    """

    __slots__ = ("_arrays", "_firsts", "_lengths", "_room", "_used", "_view")

    def __init__(self) -> None:
        self._arrays: list[Bytes] = []
        self._firsts: list[int] = []
        self._lengths = array("I")
        self._used = self._room = 0
        self._view = memoryview(b"")

    @classmethod
    def of(cls, payloads: Iterable[bytes]) -> Messages:
        """Those messages."""
        made = cls()
        made.join(payloads)
        return made

    def __len__(self) -> int:
        return len(self._lengths)

    @property
    def size(self) -> int:
        """Bytes of all messages together."""
        return int(self.lengths().sum())

    def append(self, data: memoryview, start: int, stop: int) -> None:
        """Take the message that lies between two places of some bytes."""
        used = self._used + stop - start
        if used > self._room or not self._arrays:
            self._next(stop - start)
            used = stop - start
        self._view[self._used : used] = data[start:stop]
        self._used = used
        self._lengths.append(stop - start)

    def append_many(self, payloads: list[memoryview]) -> None:
        """Take these messages, of whatever lengths."""
        lengths = array("I", map(len, payloads))
        used = self._used + sum(lengths)
        if used > self._room or not self._arrays:
            for payload, length in zip(payloads, lengths, strict=True):
                self.append(payload, 0, length)
            return
        self._view[self._used : used] = b"".join(payloads)
        self._used = used
        self._lengths.extend(lengths)

    def extend(self, rows: Bytes) -> None:
        """Take messages of one length, (n, length)."""
        count, length = rows.shape
        taken = 0
        while taken < count:
            fitting = min((self._room - self._used) // max(length, 1), count - taken) if self._arrays else 0
            if not fitting:
                self._next(length)
                continue
            stop = self._used + fitting * length
            self._arrays[-1][self._used : stop].reshape(fitting, length)[:] = rows[taken : taken + fitting]
            self._used = stop
            self._lengths.extend(array("I", [length]) * fitting)
            taken += fitting

    def join(self, payloads: Iterable[bytes]) -> None:
        """Take further messages behind these."""
        for payload in payloads:
            self.append(memoryview(payload), 0, len(payload))

    def _next(self, least: int) -> None:
        """Begin another array."""
        self._firsts.append(len(self._lengths))
        self._room = max(least, min(LARGEST, GROWTH * len(self._arrays[-1])) if self._arrays else SMALLEST)
        self._arrays.append(np.empty(self._room, dtype=np.uint8))
        self._view = self._arrays[-1].data
        self._used = 0

    def let_go(self) -> None:
        """Forget all messages, so that their memory serves what was made of them."""
        self.__init__()  # type: ignore[misc]

    def lengths(self) -> Places:
        """Length of each message [bytes]."""
        return np.array(self._lengths, dtype=np.int64)

    def _parts(self) -> Iterator[tuple[int, int, Bytes]]:
        """First message and message after the last of each array, and the array."""
        yield from zip(self._firsts, [*self._firsts[1:], len(self)], self._arrays, strict=False)

    def __iter__(self) -> Iterator[bytes]:
        for first, stop, stored in self._parts():
            view, at = stored.data, 0
            for length in self._lengths[first:stop]:
                yield view[at : at + length].tobytes()
                at += length

    def those(self, wanted: npt.NDArray[np.bool_]) -> Iterator[tuple[int, bytes]]:
        """The wanted messages, each with its place."""
        lengths = self.lengths()
        for first, stop, stored in self._parts():
            own, view = lengths[first:stop], stored.data
            places = np.flatnonzero(wanted[first:stop])
            ends = np.cumsum(own)[places]
            for place, end, length in zip(places.tolist(), ends.tolist(), own[places].tolist(), strict=True):
                yield first + place, view[end - length : end].tobytes()

    def by_length(self, most: int = 0) -> Iterator[tuple[Places, Bytes]]:
        """Messages of one length, whatever lies between them: their places, and (n, length); a part at a time.

        Parameters
        ----------
        most : int
            Messages that are looked at together, so that copies of them stay small; 0 for as many as there are.
        """
        lengths = self.lengths()
        for first, stop, stored in self._parts():
            at, step = 0, most or max(stop - first, 1)
            for low in range(first, stop, step):
                own = lengths[low : min(low + step, stop)]
                part = stored[at : at + int(own.sum())]
                at += len(part)
                yield from _by_length(low, own, part)


def _by_length(first: int, own: Places, stored: Bytes) -> Iterator[tuple[Places, Bytes]]:
    """The same of messages of some lengths that fill an array, the first of them at a place."""
    starts = np.cumsum(own) - own
    for length in np.unique(own).tolist():
        rows = np.flatnonzero(own == length)
        if length == 0 or len(rows) == len(own):
            data = stored.reshape(len(rows), length) if length else stored[:0].reshape(len(rows), 0)
        else:
            data = np.lib.stride_tricks.sliding_window_view(stored, length)[starts[rows]]
        yield first + rows, data

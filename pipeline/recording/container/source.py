"""Bytes of a file by place, and the records that begin there."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from deflate import crc32

from pmg.pipeline.recording.container.records import HEAD, Frame
from pmg.pipeline.recording.container.trail import Trail

if TYPE_CHECKING:
    from concurrent.futures import Future

BLOCK = 1 << 20
"""Bytes read at once when a long stretch is passed over."""

PIECE = 1 << 18
"""Bytes read at once when they are only summed."""

KEPT = 16 << 20
"""Longest stretch whose memory is kept for the next one [bytes]."""

SMALL = 1 << 16
"""Reads up to this length are served from bytes held [bytes]."""


class ShrunkError(OSError):
    """A file that ends before the length it had when it was opened.

    Parameters
    ----------
    end : int
        Place after the last byte that can be read [bytes].
    size : int
        Length when it was opened [bytes].
    """

    def __init__(self, end: int, size: int) -> None:
        super().__init__(f"it ends at byte {end}, and had {size} bytes when it was opened")
        self.end = end
        self.size = size


class ByteSource:
    """A file that is read by place.

    Parameters
    ----------
    stream : binary file
        Seekable.
    size : int
        Its length [bytes].
    """

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self.stream = stream
        self.size = size
        self._cached = (0, b"")
        self._summed = (0, 0, 0)
        self._trail = Trail()
        self._followed = 0
        self._lent = [memoryview(bytearray())] * 2
        self._busy: list[Future[None] | None] = [None, None]
        self._room = memoryview(bytearray())

    def read(self, start: int, stop: int) -> bytes:
        """The bytes from a place to another; fewer where the file ends.

        Raises
        ------
        ShrunkError
            When the file has fewer bytes than when it was opened.
        """
        stop = max(start, min(stop, self.size))
        if stop - start > SMALL:
            return self._whole(start, stop, stop - start)
        first, cached = self._cached
        if start < first or stop > first + len(cached):
            first, cached = self._cached = start, self._whole(start, stop, SMALL)
        return cached[start - first : stop - first]

    def lend(self, start: int, stop: int) -> memoryview:
        """The same in memory that the next calls take again.

        Raises
        ------
        ShrunkError
            When the file has fewer bytes than when it was opened.
        """
        count = max(start, min(stop, self.size)) - start
        # Two memories in turn: the other one may still be hashed while this one is filled.
        self._lent.reverse()
        self._busy.reverse()
        if (busy := self._busy[0]) is not None:
            busy.result()
            self._busy[0] = None
        if count > len(self._lent[0]) or len(self._lent[0]) > KEPT:
            self._lent[0] = memoryview(bytearray(count))
        into = self._lent[0][:count]
        self.stream.seek(start)
        filled = self.stream.readinto(into)  # type: ignore[attr-defined]
        if filled < count:
            raise ShrunkError(min(start + filled, self.stream.seek(0, 2)), self.size)
        self._busy[0] = self._follow(start, into)
        return into

    def _follow(self, start: int, data: memoryview) -> Future[None] | None:
        """Hash and sum what is read, as long as it is read from the beginning on; short stretches between as well.

        Gives what must be done before the bytes may change.
        """
        if start - SMALL <= self._followed < start:
            self._add(self.read(self._followed, start))
        if start <= self._followed < start + len(data):
            return self._add(data[self._followed - start :])
        return None

    def _add(self, data: bytes | memoryview) -> Future[None] | None:
        self._followed += len(data)
        return self._trail.add(data)

    def close(self) -> None:
        """Let go of what works during the reading."""
        self._trail.close()

    def _follow_to(self, stop: int) -> None:
        while self._followed < stop:
            self.lend(self._followed, min(self._followed + PIECE, stop))

    def digest(self) -> str:
        """SHA-256 of the whole file; what was read in order is not read again."""
        self._follow_to(self.size)
        return self._trail.digest()

    def room(self, count: int) -> memoryview:
        """Memory for what is made of bytes of the file; the next call takes it again."""
        if count > len(self._room) or len(self._room) > KEPT:
            self._room = memoryview(bytearray(count))
        return self._room[:count]

    def _whole(self, start: int, stop: int, count: int) -> bytes:
        """So many bytes from a place, and not fewer than to another."""
        self.stream.seek(start)
        data = self.stream.read(count)
        if len(data) < stop - start:
            raise ShrunkError(min(start + len(data), self.stream.seek(0, 2)), self.size)
        return data

    def frame(self, at: int) -> Frame | None:
        """The record that begins at a place; None where no head can stand or its body would not fit."""
        head = self.read(at, at + HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        end = at + HEAD.size + length
        return None if opcode == 0 or end > self.size else Frame(at, opcode, end)

    def crc(self, start: int, stop: int) -> int:
        """CRC-32 of a stretch; one that begins where the last did goes on from its end."""
        if start == 0 and stop >= self._followed:
            self._follow_to(min(stop, self.size))
            return self._trail.crc()
        first, last, crc = self._summed
        if start != first or stop < last:
            last, crc = start, 0
        stop = min(stop, self.size)
        for at in range(last, stop, PIECE):
            crc = crc32(self.lend(at, min(at + PIECE, stop)), crc)
        self._summed = (start, stop, crc)
        return crc

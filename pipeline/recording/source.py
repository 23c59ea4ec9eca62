"""Bytes of a file by place, and the records that begin there."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING, BinaryIO

from pmg.pipeline.recording.records import HEAD, Frame

if TYPE_CHECKING:
    from collections.abc import Iterator

BLOCK = 1 << 20
"""Bytes read at once when a long stretch is passed over."""

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


class Source:
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
        self._held = (0, b"")
        self._summed = (0, 0, 0)

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
        first, held = self._held
        if start < first or stop > first + len(held):
            first, held = self._held = start, self._whole(start, stop, SMALL)
        return held[start - first : stop - first]

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

    def blocks(self, start: int, stop: int) -> Iterator[bytes]:
        """The bytes of a stretch, a block at a time."""
        for at in range(start, min(stop, self.size), BLOCK):
            yield self.read(at, min(at + BLOCK, stop))

    def crc(self, start: int, stop: int) -> int:
        """CRC-32 of a stretch; one that begins where the last did goes on from its end."""
        first, last, crc = self._summed
        if start != first or stop < last:
            last, crc = start, 0
        for block in self.blocks(last, stop):
            crc = zlib.crc32(block, crc)
        self._summed = (start, min(stop, self.size), crc)
        return crc

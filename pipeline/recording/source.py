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
        """The bytes from a place to another; fewer where the file ends."""
        stop = max(start, min(stop, self.size))
        if stop - start > SMALL:
            self.stream.seek(start)
            return self.stream.read(stop - start)
        first, held = self._held
        if start < first or stop > first + len(held):
            self.stream.seek(start)
            first, held = self._held = start, self.stream.read(SMALL)
        return held[start - first : stop - first]

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

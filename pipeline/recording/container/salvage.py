"""Past damage: the next place of a file from which its records can be read again."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording.container.chunk import COMPRESSIONS, Allowance, ChunkError, chunk_head, expand
from pmg.pipeline.recording.container.records import HEAD, LAYOUT, MAGIC, Op, RecordError, parse
from pmg.pipeline.recording.container.source import BLOCK, SMALL

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.recording.container.chunk import ChunkHead
    from pmg.pipeline.recording.container.records import Frame
    from pmg.pipeline.recording.container.source import ByteSource

CHAIN = 3
"""Records in a row that must parse to the byte where no CRC proves the first of them."""

LONGEST_PADDING = 64
"""Most bytes after the known fields of a record; the format allows some, for fields of the future [bytes]."""

LONGEST_PLAIN = 64 << 20
"""Longest record other than a chunk that is looked into during a search [bytes]."""

WORK = 16
"""Bytes looked at during all searches in a file, in sizes of the file; a file made to be slow ends there."""

SEARCH = 1 << 8
"""Bytes that a search counts for however near the next record is."""

INSIDE = (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE)
"""Kinds of records that stand inside chunks. In a chunked file no search ends at one: it may lie in a chunk whose
CRC does not hold."""


@dataclass
class SalvageSearch:
    """Searches in one file, with the work they may still do [bytes]."""

    source: ByteSource
    left: int
    allowance: Allowance

    @classmethod
    def of(cls, source: ByteSource) -> SalvageSearch:
        """A search with the work that the size of the file allows."""
        return cls(source, WORK * source.size + BLOCK, Allowance.of(source.size))

    @property
    def given_up(self) -> bool:
        """Whether the file took more work than is done."""
        return self.left <= 0 or self.allowance.spent

    def next_record(self, start: int, stop: int, chunked: bool) -> int | None:
        """The first place in a stretch at which reading can go on; None without one.

        Parameters
        ----------
        start, stop : int
            Where a record may begin.
        chunked : bool
            Whether messages stand in chunks.
        """
        for at in self._candidates(start, stop):
            if self.given_up:
                return None
            frame = self.source.frame(at)
            if frame is not None and self.sound(frame, chunked, CHAIN):
                return at
        return None

    def sound(self, frame: Frame, chunked: bool, depth: int) -> bool:
        """Whether a record is what it says: by its CRC, or by itself and those that follow it."""
        if frame.opcode == Op.CHUNK:
            return self.proven(frame)
        if frame.opcode not in LAYOUT or (chunked and frame.opcode in INSIDE):
            return False
        self.left -= min(frame.end - frame.at, LONGEST_PLAIN)
        if frame.end - frame.body > LONGEST_PLAIN:
            return False
        body = self.source.read(frame.body, frame.end)
        try:
            _, known = parse(frame.opcode, body)
        except RecordError:
            return False
        if len(body) - known > LONGEST_PADDING:
            return False
        if frame.opcode == Op.FOOTER:
            return self.source.read(frame.end, frame.end + len(MAGIC)) == MAGIC
        if depth == 1:
            return True
        following = self.source.frame(frame.end)
        if following is None:
            return False
        # Later links of the chain may be of any kind: messages follow a header, channels the end of the data.
        return self.sound(following, False, depth - 1)

    def proven(self, frame: Frame) -> bool:
        """Whether a chunk opens and its CRC holds, by its own length of the records."""
        try:
            head = chunk_head(self.source, frame)
            if head.crc == 0 or head.end > self.source.size or head.compression not in COMPRESSIONS:
                return frame.opcode == Op.CHUNK and head.crc == 0 and self._fills(frame, head)
            self.left -= head.end - head.at
            return bool(expand(self.source, head, head.end, self.allowance))
        except (RecordError, ChunkError, MemoryError):
            return False

    def _fills(self, frame: Frame, head: ChunkHead) -> bool:
        """Whether a chunk without a CRC fills its record, and its records fill it."""
        return head.end == frame.end and bool(expand(self.source, head, head.end, self.allowance))

    def _candidates(self, start: int, stop: int) -> Iterator[int]:
        """Places where a known operation code stands before a length that the file could hold."""
        width = min(8, (self.source.size.bit_length() + 7) // 8)
        pattern = re.compile(rb"(?=[\x01-\x0f][\s\S]{%d}\x00{%d})" % (width, 8 - width))
        self.left -= SEARCH
        at, step = start, SMALL - HEAD.size
        while at < stop:
            end = min(at + step, stop)
            seen = at
            for match in pattern.finditer(self.source.read(at, end + HEAD.size - 1)):
                place = at + match.start()
                if place < end:
                    # What is looked at counts, not what was read ahead: many small damages cost little each.
                    self.left -= place - seen
                    seen = place
                    yield place
            self.left -= end - seen
            at, step = end, BLOCK

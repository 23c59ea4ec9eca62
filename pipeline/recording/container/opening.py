"""Chunks of a file taken one after another: opened within limits, proven, and none of them twice."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from pmg.pipeline.recording.container.chunk import (
    CHUNK_LIMIT,
    Allowance,
    ChunkError,
    ChunkHead,
    TooLargeError,
    chunk_head,
    expand,
)
from pmg.pipeline.recording.container.file_limits import MESSAGES
from pmg.pipeline.recording.container.records import PRIVATE, Op, RecordError
from pmg.pipeline.recording.container.taking import take_inside
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.gathered import WholeRecords
    from pmg.pipeline.recording.container.records import Frame
    from pmg.pipeline.recording.container.source import ByteSource


class Opening:
    """The chunks of a file so far.

    Parameters
    ----------
    source : Source
        The file.
    gathered : WholeRecords
        Receives their records.
    """

    def __init__(self, source: ByteSource, gathered: WholeRecords) -> None:
        self.source = source
        self.gathered = gathered
        self.allowance = Allowance.of(source.size)
        """Bytes that may still be expanded."""
        self.met = False
        """Whether the file has chunks."""
        self.unproven = 0
        """Chunks without a CRC."""
        self._seen: dict[tuple[int, int, int, int, int], ChunkHead] = {}
        self._hashes: set[bytes] = set()

    def take(self, frame: Frame) -> int | None:
        """Keep the records of a chunk and give the place where it really ends; None when it cannot be used.

        A record of a reserved kind is tried too: it may be a chunk whose code is damaged.
        """
        chunk = frame.opcode == Op.CHUNK
        self.met |= chunk
        try:
            head, data = self._opened(frame)
        except (RecordError, ChunkError, MemoryError) as fault:
            if chunk:
                self._refused(frame, fault)
            elif frame.opcode < PRIVATE:
                self._unknown(frame)
            return None
        if not chunk:
            came = f"its code is {frame.opcode}; expected {int(Op.CHUNK)}, for it is a chunk whose CRC holds"
            self.used(frame, frame.end, came, Code.RECORD_UNKNOWN)
        if len(data) != head.size:
            came = f"it declares {head.size} bytes expanded; expected {len(data)}, over which its CRC holds"
            self.used(frame, head.end, came)
        self.unproven += head.crc == 0
        if self._twice(head):
            self._repeated(frame, head)
        elif (left := MESSAGES.of(self.source.size) - self.gathered.messages) <= 0:
            self._refused(frame, TooLargeError(f"{self.gathered.messages} messages before it, in so small a file"))
        else:
            take_inside(self.gathered, frame.at, data, left)
        return head.end

    def used(self, frame: Frame, end: int, came: str, code: Code = Code.LENGTH, why: str = "It is used.") -> None:
        """Report a chunk that is used although its head is damaged.

        Parameters
        ----------
        frame : Frame
            The record as its head declares it.
        end : int
            Place after the bytes that the finding names.
        came : str
            What the head says and what was expected.
        code : Code
            ``LENGTH``, or ``RECORD_UNKNOWN`` where the record does not say that it is a chunk.
        why : str
            That it is used, and the reason where `came` does not give it.
        """
        self.gathered.findings.warning(
            code,
            f"{'chunk' if code is Code.LENGTH else 'record'} at byte {frame.at}",
            came,
            f"{why} The file is damaged: copy it again.",
            byte_range=(frame.at, end),
            kept="the chunk",
        )

    def lost(self, frame: Frame, fault: str) -> None:
        """Report a record that is not used."""
        self.gathered.findings.error(
            Code.RECORD_LOST,
            f"record at byte {frame.at}",
            f"{frame.end - frame.body} bytes with code {frame.opcode} cannot be used ({fault}); "
            "expected a whole record",
            "What it said is missing. Copy the file again from the recorder.",
            byte_range=(frame.at, frame.end),
            kept="the records around it",
            lost="the record",
        )

    def _opened(self, frame: Frame) -> tuple[ChunkHead, memoryview]:
        """The chunk by its own length of the records, else by the length of the record around them."""
        head = chunk_head(self.source, frame)
        if frame.opcode != Op.CHUNK and (head.crc == 0 or head.end > frame.end):
            raise RecordError("it cannot be proven to be a chunk")
        try:
            return head, expand(self.source, head, head.end, self.allowance)
        except ChunkError:
            if head.end == frame.end or head.at > frame.end:
                raise
        data = expand(self.source, head, frame.end, self.allowance)
        came = f"it declares {head.end - head.at} bytes of records; expected {frame.end - head.at}, as its CRC says"
        self.used(frame, frame.end, came)
        known = ChunkHead(head.start_time, head.end_time, head.size, head.crc, head.compression, head.at, frame.end)
        return known, data

    def _twice(self, head: ChunkHead) -> bool:
        """Whether the same bytes were taken before."""
        key = (head.start_time, head.end_time, head.size, head.crc, head.end - head.at)
        first = self._seen.setdefault(key, head)
        if first is head or head.end == head.at:
            return False
        # Only chunks that look alike are hashed, each once: comparing each with all before it takes too long.
        self._hashes.add(self._hash(first))
        found = self._hash(head)
        same = found in self._hashes
        self._hashes.add(found)
        return same

    def _hash(self, head: ChunkHead) -> bytes:
        return hashlib.sha256(self.source.read(head.at, head.end)).digest()

    def _refused(self, frame: Frame, fault: Exception) -> None:
        large = isinstance(fault, (TooLargeError, MemoryError))
        text = str(fault) or "the memory does not suffice"
        self.gathered.findings.error(
            Code.TOO_LARGE if large else Code.CHUNK_LOST,
            f"chunk at byte {frame.at}",
            f"{frame.end - frame.body} bytes cannot be used ({text}); expected a whole chunk of at most "
            f"{CHUNK_LIMIT} bytes with the CRC it declares",
            "Its samples are missing and shown as a gap. Copy the file again from the recorder.",
            byte_range=(frame.at, frame.end),
            kept="the chunks around it",
            lost="the messages of the chunk",
        )

    def _repeated(self, frame: Frame, head: ChunkHead) -> None:
        self.gathered.findings.warning(
            Code.CHUNK_DUPLICATE,
            f"chunk at byte {frame.at}",
            "the same chunk stands earlier in the file; expected it once. Its messages are taken once",
            "Nothing is lost. Copy the file again from the recorder.",
            byte_range=(frame.at, head.end),
            kept="the first of the two",
        )

    def _unknown(self, frame: Frame) -> None:
        self.gathered.findings.warning(
            Code.RECORD_UNKNOWN,
            f"record at byte {frame.at}",
            f"its code is {frame.opcode}; expected one that the format names",
            "It is passed over: damaged, or of a later version of the format. Copy the file again.",
            byte_range=(frame.at, frame.end),
            kept="the records around it",
            lost="the record",
        )

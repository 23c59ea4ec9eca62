"""One pass over the records of an MCAP file, which keeps everything that can be proven whole.

Neither the index nor the end of the file is relied on, so a file whose writer was killed gives what had been
written. A chunk is opened within limits and used when its CRC holds. Past a damaged place the pass goes on at the
next record that can be proven. What is lost becomes a finding with the bytes it lay in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from pmg.pipeline.recording.container.opening import Opening
from pmg.pipeline.recording.container.records import HEAD, LAYOUT, MAGIC, PRIVATE, Frame, Op, RecordError
from pmg.pipeline.recording.container.salvage import LONGEST_PLAIN, SalvageSearch
from pmg.pipeline.recording.container.source import BLOCK, ByteSource
from pmg.pipeline.recording.container.summary import Summary
from pmg.pipeline.recording.container.taking import take
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.gathered import WholeRecords

SMALLEST_CHUNK = 40
"""Length of the body of a chunk without records [bytes]."""

INDEX_ENTRY = 16
"""Length of an entry in an index of messages [bytes]."""

SEARCHED_START = 16 * BLOCK
"""Part of a file that does not begin as a recording, which is searched for one [bytes]."""


def walk_records(stream: BinaryIO, size: int, gathered: WholeRecords) -> ByteSource:
    """Gather what the records of a file say; damage is reported and passed over.

    Parameters
    ----------
    stream : binary file
        Seekable.
    size : int
        Its length [bytes].
    gathered : WholeRecords
        Receives what is whole.

    Returns
    -------
    Source
        The file, which knows the hash of what was read.

    Raises
    ------
    UnusableRecordingError
        When it is no MCAP file.
    ShrunkError
        When it ends before its length while it is read.
    """
    source = ByteSource(stream, size)
    try:
        _FileWalk(source, gathered).run()
    except BaseException:
        source.close()
        raise
    return source


class _FileWalk:
    """The pass: where it is, and whether the file keeps its messages in chunks."""

    def __init__(self, source: ByteSource, gathered: WholeRecords) -> None:
        self.source = source
        self.gathered = gathered
        self.findings = gathered.findings
        self.search = SalvageSearch.of(source)
        self.opening = Opening(source, gathered)
        self.summary = Summary(source, gathered)
        self.plain_messages = False

    def run(self) -> None:
        """Go through the file from its beginning."""
        at: int | None = self._begin()
        while at is not None and at < self.source.size:
            frame = self.source.frame(at) or self._hidden_chunk(at, self.source.size)
            if frame is not None and frame.opcode == Op.FOOTER and self._closes(frame):
                self.summary.close(frame)
                self._trailing(frame.end + len(MAGIC))
                break
            at = self._broken(at, at) if frame is None or not self._possible(frame) else self._step(frame)
        else:
            if at is not None:
                self._truncated(at)
        self.summary.compare(self.plain_messages, self.opening.unproven)

    def _begin(self) -> int:
        """Place of the first record; behind the signature, or where one is found in a file that lost its beginning."""
        start = self.source.read(0, len(MAGIC))
        if start == MAGIC:
            return len(MAGIC)
        came = "the file is empty" if not start else f"it begins with {start!r}"
        at = self.search.next_record(0, min(self.source.size, SEARCHED_START), chunked=False)
        if at is None:
            self.findings.error(
                Code.NOT_MCAP,
                "byte 0",
                f"{came}; expected the MCAP signature {MAGIC!r}",
                "Take the file from the recorder again, or remove it from the folder.",
            )
            raise self.findings.give_up()
        self._skipped(0, at, came)
        return at

    def _hidden_chunk(self, at: int, end: int) -> Frame | None:
        """A chunk whose CRC holds, whatever code and length its head gives; only its own lengths are looked at."""
        frame = Frame(at, self.source.read(at, at + 1)[0] if at < self.source.size else 0, end)
        return frame if self.search.proven(frame) else None

    def _closes(self, footer: Frame) -> bool:
        return self.source.read(footer.end, footer.end + len(MAGIC)) == MAGIC

    def _possible(self, frame: Frame) -> bool:
        """Whether something can be made of a record: a footer is one only before the end mark."""
        if frame.opcode == Op.FOOTER or frame.opcode == 0:
            return self._disguised(frame)
        return frame.opcode in LAYOUT or frame.opcode >= PRIVATE or self._follows(frame) or self._disguised(frame)

    def _disguised(self, frame: Frame) -> bool:
        """Whether a record is a chunk under another code. One changed bit makes no chunk a message."""
        large = frame.end - frame.body > SMALLEST_CHUNK and frame.opcode != Op.MESSAGE
        return large and self._hidden_chunk(frame.at, frame.end) is not None

    def _follows(self, frame: Frame) -> bool:
        """Whether a record can begin where this one ends."""
        following = self.source.frame(frame.end)
        return following is not None and (following.opcode in LAYOUT or following.opcode >= PRIVATE)

    def _step(self, frame: Frame) -> int | None:
        """Take a record and give the place of the next; None when there is none."""
        if frame.opcode == Op.CHUNK or frame.opcode not in LAYOUT or self._disguised(frame):
            end = self.opening.take(frame)
            if end is not None:
                self.summary.reopen()
                return self._after_chunk(frame, end)
            if frame.opcode == Op.CHUNK:
                return frame.end if self._follows(frame) else self._broken(frame.body, frame.end)
            return frame.end
        if not self._follows(frame) and self._hidden_chunk(frame.end, self.source.size) is None:
            # Its own length may be what is damaged: then a record is found inside it, and it is not taken.
            at = self.search.next_record(frame.body, self.source.size, self._chunked)
            if at is not None and at < frame.end:
                self._skipped(frame.at, at, f"a record with code {frame.opcode} of {frame.end - frame.body} bytes")
                return at
            self._take(frame)
            return self._resume(frame.end, at)
        self._take(frame)
        return frame.end

    @property
    def _chunked(self) -> bool:
        return not self.plain_messages and self.opening.met

    def _after_chunk(self, frame: Frame, end: int) -> int:
        """Where the chunk's records end if another record begins there, else where its length says."""
        if end == frame.end:
            return end
        following = self.source.frame(end)
        if end > frame.end or (following is not None and self.search.sound(following, chunked=False, depth=1)):
            came = f"its head says {frame.end - frame.body} bytes; expected {end - frame.body}, where its records end"
            self.opening.used(frame, end, came, why="Its CRC holds and it is used.")
            return end
        return frame.end

    def _take(self, frame: Frame) -> None:
        """Keep what a record outside chunks says."""
        if frame.end - frame.body > LONGEST_PLAIN and frame.opcode != Op.ATTACHMENT:
            fault = f"it is longer than the {LONGEST_PLAIN} bytes that are read"
            return self.opening.lost(frame, fault)
        body = self.source.read(frame.body, frame.end)
        try:
            if frame.opcode == Op.DATA_END:
                self.summary.data_end(frame, body)
            elif self.summary.begun and frame.opcode in (Op.CHANNEL, Op.SCHEMA, Op.STATISTICS):
                self.summary.take(frame, body)
            else:
                if frame.opcode == Op.MESSAGE and self.opening.met and _is_index(body):
                    raise RecordError("it has the shape of an index of messages, with one bit changed")
                if frame.opcode == Op.MESSAGE:
                    self.plain_messages = True
                    self.summary.reopen()
                take(self.gathered, frame.at, frame.opcode, body)
        except RecordError as fault:
            self.opening.lost(frame, str(fault))
        return None

    def _broken(self, start: int, lost_from: int) -> int | None:
        """Go on past bytes that are no record."""
        chunked = self._chunked or self.source.read(lost_from, lost_from + 1) == bytes([Op.CHUNK])
        at = self.search.next_record(start + (start == lost_from), self.source.size, chunked)
        return self._resume(lost_from, at)

    def _resume(self, lost_from: int, at: int | None) -> int | None:
        if at is None:
            self._truncated(lost_from)
        elif at > lost_from:
            self._skipped(lost_from, at, f"the bytes {self.source.read(lost_from, lost_from + HEAD.size).hex(' ')}")
        return at

    def _skipped(self, start: int, stop: int, came: str) -> None:
        self.findings.error(
            Code.SKIPPED,
            f"bytes {start} to {stop}",
            f"{came}; expected a record of MCAP. Reading goes on {stop - start} bytes later",
            "What lay there is missing. Copy the file again from the recorder.",
            byte_range=(start, stop),
            kept="what lies before and behind",
            lost=f"{stop - start} bytes",
        )

    def _truncated(self, start: int) -> None:
        size, messages = self.source.size, self.gathered.messages
        text = self.findings.warning if self.summary.begun else self.findings.error
        ended = "" if not self.search.given_up else "; the search past damage was given up, as too long"
        text(
            Code.TRUNCATED,
            f"byte {start}",
            f"the file ends after {size} bytes without its end mark{ended}; expected a closed recording. "
            f"Kept: {messages} messages before that place",
            "The recorder was stopped hard or the copy was cut short: copy the file again; if it is the "
            "original, what is kept is all there is.",
            byte_range=(start, size),
            kept=f"{messages} messages",
            lost="nothing but the summary" if self.summary.begun else f"what lay in the last {size - start} bytes",
        )

    def _trailing(self, at: int) -> None:
        if at < self.source.size:
            second = self.source.read(at, at + len(MAGIC)) == MAGIC
            self.findings.error(
                Code.TRAILING,
                f"byte {at}",
                f"{self.source.size - at} bytes follow the end mark{', as a second recording' if second else ''}; "
                "expected the end of the file",
                "They are not read. Take the files apart, or copy the file again.",
                byte_range=(at, self.source.size),
                kept="the recording before them",
                lost=f"{self.source.size - at} bytes",
            )


def _is_index(body: bytes) -> bool:
    """Whether a body is that of an index: a channel, a length, and as many bytes of pairs of time and place."""
    length = int.from_bytes(body[2:6], "little")
    return length > 0 and length % INDEX_ENTRY == 0 and len(body) == 6 + length

"""End of a file: what its writer says it wrote, held against what was read. It is a witness, never a guide."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.recording.container.records import ChannelRecord, Op, Schema, parse
from pmg.pipeline.recording.findings import Code, Severity

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.gathered import WholeRecords
    from pmg.pipeline.recording.container.records import Frame
    from pmg.pipeline.recording.container.source import ByteSource

FOOTER_BEFORE_CRC = 16
"""Bytes of the body of a footer that its CRC covers."""


class Summary:
    """Summary after the data.

    Parameters
    ----------
    source : Source
        The file.
    gathered : WholeRecords
        What was read; receives channels whose first description is lost.

    Notes
    -----
    Nothing of it is used before the footer has proven it by its CRC, or declared that there is none.
    """

    def __init__(self, source: ByteSource, gathered: WholeRecords) -> None:
        self.source = source
        self.gathered = gathered
        self.start: int | None = None
        self.crc_known = False
        self.declared: int | None = None
        self._waiting: list[tuple[int, ChannelRecord | Schema | int]] = []

    @property
    def begun(self) -> bool:
        """Whether the end of the data has been passed."""
        return self.start is not None

    def data_end(self, frame: Frame, body: bytes) -> None:
        """Check the CRC over all data."""
        (declared,), _ = parse(Op.DATA_END, body)
        self.start = frame.end
        self.crc_known = declared != 0
        crc = self.source.crc(0, frame.at) if declared else 0
        if declared != crc:
            self.gathered.findings.warning(
                Code.CRC,
                f"byte {frame.at}",
                f"the data have CRC {crc:08x}; expected {declared:08x}, as the recorder wrote",
                "Some byte changed after recording; damaged chunks are named apart. Copy the file again.",
                byte_range=(0, frame.at),
                kept="all that is not named apart",
            )

    def reopen(self) -> None:
        """Data follow what claimed to be their end; what was noted since may belong to them."""
        self.start = None

    def take(self, frame: Frame, body: bytes) -> None:
        """Note a repeated schema or channel, or the statistics."""
        values, _ = parse(frame.opcode, body)
        if frame.opcode == Op.SCHEMA:
            self._waiting.append((frame.at, Schema(*values)))
        elif frame.opcode == Op.CHANNEL:
            self._waiting.append((frame.at, ChannelRecord(*values)))
        else:
            self._waiting.append((frame.at, values[0]))

    def close(self, footer: Frame) -> None:
        """Use what was noted if the footer proves it."""
        body = self.source.read(footer.body, footer.end)
        (_, _, declared), _ = parse(Op.FOOTER, body)
        start = footer.at if self.start is None else self.start
        crc = self.source.crc(start, footer.body + FOOTER_BEFORE_CRC)
        if declared not in (0, crc):
            self.gathered.findings.warning(
                Code.CRC,
                f"byte {start}",
                f"the summary has CRC {crc:08x}; expected {declared:08x}, as the recorder wrote",
                "The summary is not used and no data are lost by it. Copy the file again.",
                byte_range=(start, footer.end),
                kept="all data before it",
                lost="the summary",
            )
            return
        for at, noted in self._waiting:
            if isinstance(noted, Schema):
                self.gathered.schemas.setdefault(noted.id, noted)
            elif isinstance(noted, ChannelRecord):
                self.gathered.describe(noted, at)
            else:
                self.declared = noted

    def compare(self, plain_messages: bool, unproven: int) -> None:
        """Report messages that the writer counted and the pass did not meet, and data that nothing proves."""
        found = self.gathered.messages
        if self.declared not in (None, found):
            text = "are missing" if found < (self.declared or 0) else "are there too many"
            self.gathered.findings.error(
                Code.COUNT,
                "statistics",
                f"{found} messages were read; expected {self.declared}, as the recorder counted: "
                f"{abs(found - (self.declared or 0))} {text}",
                "Copy the file again from the recorder.",
                kept=f"{found} messages",
                lost=f"{max(0, (self.declared or 0) - found)} messages",
            )
        if (unproven or plain_messages) and not self.crc_known:
            came = f"{unproven} chunks without a CRC" if unproven else "messages outside of chunks"
            findings = self.gathered.findings
            damaged = any(finding.severity is Severity.ERROR for finding in findings.gathered)
            (findings.warning if damaged else findings.info)(
                Code.UNPROVEN,
                "whole file",
                f"{came} and no CRC over the data; expected a CRC by which a changed byte would show",
                "Switch the CRCs of the recorder on." + (" Values next to the damage may be wrong." if damaged else ""),
                kept="all messages that could be framed",
            )

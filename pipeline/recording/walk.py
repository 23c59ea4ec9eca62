"""One pass over the records of an MCAP file, which keeps everything that can be proven whole.

The index at the end of the file is not used, so a file whose writer was killed gives what had been written.
Each chunk is checked against its CRC and lost alone when it is damaged; what is lost becomes a finding.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import TYPE_CHECKING, BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pmg.pipeline.recording.findings import Findings

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
CHUNK_LIMIT = 1 << 31
"""Largest uncompressed chunk taken in [bytes]; recorders write a few megabytes, so more is damage."""


@dataclass
class Walk:
    """What the pass has gathered so far."""

    wanted: Callable[[str], bool]
    findings: Findings
    schemas: dict[int, str] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    payloads: dict[int, list[bytes]] = field(default_factory=dict)
    strangers: dict[int, int] = field(default_factory=dict)
    metadata: list[tuple[str, Mapping[str, str]]] = field(default_factory=list)
    attachments: list[tuple[str, bytes]] = field(default_factory=list)


class _CutError(Exception):
    """The file ends inside a record."""


def walk_records(stream: BinaryIO, size: int, walk: Walk) -> None:
    """Gather what the records of a file say; damage is reported and passed over.

    Parameters
    ----------
    stream : binary file
        At its beginning.
    size : int
        Its length [bytes].
    walk : Walk
        Receives what is whole.

    Raises
    ------
    UnusableRecordingError
        When it is no MCAP file.
    """
    start = stream.read(len(MAGIC))
    if start != MAGIC:
        came = "the file is empty" if not start else f"it begins with {start!r}"
        walk.findings.error(
            Code.NOT_MCAP,
            "byte 0",
            f"{came}; expected the MCAP signature {MAGIC!r}",
            "Take the file from the recorder again, or remove it from the folder.",
        )
        raise walk.findings.give_up()
    crc = zlib.crc32(start)
    try:
        for at, head, opcode, body in _records(stream, size):
            if opcode == Opcode.DATA_END:
                _check_data_end(at, body, crc, walk.findings)
                return
            crc = zlib.crc32(body, zlib.crc32(head, crc))
            if opcode == Opcode.CHUNK:
                _take_chunk(at, body, walk)
            elif opcode == Opcode.FOOTER:
                return
            else:
                _take(at, opcode, body, walk)
    except _CutError as cut:
        messages = sum(walk.counts.values())
        walk.findings.error(
            Code.TRUNCATED,
            f"byte {cut}",
            f"the file ends after {size} bytes without its end mark; expected a closed recording. "
            f"Kept: {messages} messages before that place",
            "The recorder was stopped hard or the copy was cut short: copy the file again; if it is the "
            "original, what is kept is all there is.",
        )


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes, int, bytes]]:
    """Place, head, operation code and body of each record."""
    at = len(MAGIC)
    while True:
        head = stream.read(HEAD.size)
        if len(head) < HEAD.size:
            raise _CutError(at)
        opcode, length = HEAD.unpack(head)
        if length > size - at - HEAD.size:
            raise _CutError(at)
        body = stream.read(length)
        if len(body) < length:
            raise _CutError(at)
        yield at, head, opcode, body
        at += HEAD.size + length


def _check_data_end(at: int, body: bytes, crc: int, findings: Findings) -> None:
    declared = int.from_bytes(body[:4], "little")
    if declared not in (0, crc):
        findings.warning(
            Code.CRC,
            f"byte {at}",
            f"the data have CRC {crc:08x}; expected {declared:08x}, as the recorder wrote",
            "Some byte changed after recording; damaged chunks are named apart. Copy the file again.",
        )


def _take_chunk(at: int, body: bytes, walk: Walk) -> None:
    try:
        data = _unpack(Chunk.read(_stream(body)))
    except (ValueError, struct.error, EndOfFile, zstandard.ZstdError, RuntimeError) as fault:
        walk.findings.error(
            Code.CHUNK_LOST,
            f"chunk at byte {at}",
            f"{len(body)} bytes cannot be used ({fault}); expected a whole chunk with the CRC it declares",
            "Its samples are missing and shown as a gap. Copy the file again from the recorder.",
        )
        return
    place, end = 0, len(data)
    while place + HEAD.size <= end:
        opcode, length = HEAD.unpack_from(data, place)
        start = place + HEAD.size
        if start + length > end:
            break
        _take(at, opcode, data[start : start + length], walk)
        place = start + length
    if place != end:
        walk.findings.error(
            Code.CHUNK_LOST,
            f"chunk at byte {at}",
            f"its records end {end - place} bytes early; expected records up to its end",
            "The last messages of this chunk are missing. Report it to the maker of the recorder.",
        )


def _unpack(chunk: Chunk) -> bytes:
    """Uncompressed records of a chunk, proven by length and CRC."""
    if chunk.uncompressed_size > CHUNK_LIMIT:
        raise ValueError(f"it claims {chunk.uncompressed_size} bytes uncompressed")
    if chunk.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"compression '{chunk.compression}' is none of zstd, lz4, none")
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    if length != chunk.uncompressed_size:
        raise ValueError(f"{length} bytes came out, {chunk.uncompressed_size} are declared")
    return bytes(stream.read(length))


def _take(at: int, opcode: int, body: bytes, walk: Walk) -> None:
    """Keep what one record says."""
    try:
        if opcode == Opcode.MESSAGE:
            _take_message(body, walk)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(body))
            walk.schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(body))
            walk.channels.setdefault(channel.id, channel)
            walk.counts.setdefault(channel.id, 0)
        elif opcode == Opcode.METADATA:
            record = Metadata.read(_stream(body))
            walk.metadata.append((record.name, dict(record.metadata)))
        elif opcode == Opcode.ATTACHMENT:
            _take_attachment(body, walk)
    except (ValueError, struct.error, EndOfFile) as fault:
        walk.findings.error(
            Code.RECORD_LOST,
            f"record at byte {at}",
            f"{len(body)} bytes with code {opcode} cannot be used ({fault}); expected a whole record",
            "What it said is missing. Copy the file again from the recorder.",
        )


def _take_message(body: bytes, walk: Walk) -> None:
    identity = MESSAGE.unpack_from(body)[0]
    channel = walk.channels.get(identity)
    if channel is None:
        walk.strangers[identity] = walk.strangers.get(identity, 0) + 1
        return
    walk.counts[identity] += 1
    if walk.wanted(channel.topic):
        walk.payloads.setdefault(identity, []).append(body[MESSAGE.size :])


def _take_attachment(body: bytes, walk: Walk) -> None:
    attachment = Attachment.read(_stream(body))
    declared = int.from_bytes(body[-4:], "little")
    if declared not in (0, zlib.crc32(body[:-4])):
        raise ValueError(f"attachment '{attachment.name}' does not match its CRC {declared:08x}")
    walk.attachments.append((attachment.name, attachment.data))


class _Exact(BytesIO):
    """Bytes that say when fewer are left than a field needs."""

    def read(self, size: int | None = -1, /) -> bytes:
        """That many bytes, never fewer."""
        data = super().read(size)
        if size is not None and len(data) < size:
            raise EndOfFile("the record ends inside a field")
        return data


def _stream(body: bytes) -> ReadDataStream:
    return ReadDataStream(_Exact(body))

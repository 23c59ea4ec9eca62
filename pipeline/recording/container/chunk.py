"""Chunks opened: nothing is expanded beyond what is declared and allowed, and nothing is used before its CRC holds."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import lz4.frame
import zstandard
from deflate import crc32

from pmg.pipeline.recording.container.file_limits import EXPANDED, WASTED
from pmg.pipeline.recording.container.records import HEAD, LAYOUT, Op, RecordError, parse

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.records import Frame
    from pmg.pipeline.recording.container.source import ByteSource

CHUNK_LIMIT = 256 << 20
"""Largest chunk that is expanded [bytes]; recorders write a few megabytes, so more is damage or a bomb."""

COMPRESSIONS = ("", "zstd", "lz4")
"""Names of the compressions that are known; the empty one is none."""

LONGEST_NAME = 32
"""Longest name of a compression that is looked at [bytes]."""

FIXED_HEAD = 8 + 8 + 8 + 4 + 4
"""Bytes of a chunk before the name of its compression."""


BLOCK_HEAD = struct.Struct("<BH")
"""Bytes before each block of zstd: one bit whether it is the last, two bits of its kind, its length above them."""

MOST_FRAMES = 64
"""Compressed frames of lz4 in one chunk; writers make one."""


@dataclass
class Allowance:
    """Allowance for what may still be expanded in a file.

    Parameters
    ----------
    left : int
        By chunks that hold [bytes].
    wasted : int
        By chunks that do not; a damaged head may claim much, so these have their own [bytes].
    """

    left: int
    wasted: int

    @classmethod
    def of(cls, size: int) -> Allowance:
        """Allowance of a file by its size."""
        return cls(EXPANDED.of(size), WASTED.of(size))

    @property
    def spent(self) -> bool:
        """Whether nothing more is expanded."""
        return self.left <= 0 or self.wasted <= 0


class ChunkError(ValueError):
    """A chunk that cannot be proven whole."""


class TooLargeError(ChunkError):
    """A chunk that declares more than is expanded, or expands to more than it declares."""


@dataclass(frozen=True)
class ChunkHead:
    """Head of a chunk.

    Parameters
    ----------
    start_time, end_time : int
        Earliest and latest log time of its messages [ns].
    size : int
        Length of its records, expanded [bytes].
    crc : int
        CRC-32 of its records, expanded; 0 when the writer gave none.
    compression : str
        ``zstd``, ``lz4`` or empty.
    at, end : int
        Place in the file of its compressed records, and the place after them.
    """

    start_time: int
    end_time: int
    size: int
    crc: int
    compression: str
    at: int
    end: int


def chunk_head(source: ByteSource, frame: Frame) -> ChunkHead:
    """Head of the chunk at a place; its own length of the records counts, not that of the record around them.

    Raises
    ------
    RecordError
        When no chunk can stand there.
    """
    body = source.read(frame.body, frame.body + FIXED_HEAD + LONGEST_NAME + 8)
    named = int.from_bytes(body[FIXED_HEAD - 4 : FIXED_HEAD], "little")
    if named > LONGEST_NAME:
        raise RecordError(f"its compression has a name of {named} bytes")
    known = FIXED_HEAD + named + 8
    if len(body) < known:
        raise RecordError("the file ends inside its head")
    (start, end, size, crc, compression, _), _ = parse(Op.CHUNK, body[: known - 8] + bytes(8))
    at = frame.body + known
    return ChunkHead(start, end, size, crc, compression, at, at + int.from_bytes(body[known - 8 : known], "little"))


def expand(source: ByteSource, head: ChunkHead, end: int, allowance: Allowance) -> memoryview:
    """Records of a chunk, proven by length and CRC, in memory that the next chunk takes again.

    Parameters
    ----------
    source : Source
        The file.
    head : ChunkHead
        What the chunk declares.
    end : int
        Place after its compressed records.
    allowance : Allowance
        Most bytes to expand to, and lowered by what is; so a file of many bombs ends too.

    Raises
    ------
    ChunkError
        When they cannot be proven.
    """
    if head.compression not in COMPRESSIONS:
        raise ChunkError(f"compression '{head.compression}' is none of zstd, lz4, none")
    limit = 0 if allowance.spent else min(allowance.left, CHUNK_LIMIT)
    length = end - head.at
    if length > CHUNK_LIMIT + (CHUNK_LIMIT >> 4):
        raise TooLargeError(f"it claims {length} compressed bytes, and {CHUNK_LIMIT} are allowed")
    packed = source.lend(head.at, end)
    if len(packed) < length:
        raise ChunkError("the file ends inside it")
    try:
        # Where the two sizes differ the CRC decides; without one, the chunk's own size must hold.
        size = max(head.size, _claimed(head, packed)) if head.size <= limit else _claimed(head, packed)
        if size > limit or (head.size > limit and head.crc == 0):
            raise TooLargeError(f"it claims {max(size, head.size)} bytes expanded from {length}; {limit} are allowed")
    except (zstandard.ZstdError, RuntimeError) as fault:
        raise ChunkError(str(fault)) from fault
    try:
        data = _proven(source, head, packed, size)
    except ChunkError:
        allowance.wasted -= size
        raise
    allowance.left -= len(data)
    return data


def _proven(source: ByteSource, head: ChunkHead, packed: memoryview, size: int) -> memoryview:
    try:
        data = _expanded(source, head.compression, packed, size)
    except (zstandard.ZstdError, RuntimeError, EOFError) as fault:
        raise ChunkError(str(fault)) from fault
    if len(data) > size:
        raise TooLargeError(f"it expands to more than the {size} bytes that it declares")
    if len(data) != head.size and head.crc == 0:
        raise ChunkError(f"{len(data)} bytes came out, {head.size} are declared")
    crc = crc32(data)
    if head.crc not in (0, crc):
        raise ChunkError(f"its CRC is {crc:08x}, {head.crc:08x} is declared")
    if head.crc == 0 and not _whole(data):
        raise ChunkError("it declares no CRC and its records do not end where it does")
    return data


def _claimed(head: ChunkHead, packed: memoryview) -> int:
    """Length of the records by the compressed bytes themselves; that of the head where they do not say."""
    if head.compression == "zstd":
        content = zstandard.get_frame_parameters(packed).content_size
        return head.size if content == zstandard.CONTENTSIZE_UNKNOWN else content
    if head.compression == "lz4":
        return int(lz4.frame.get_frame_info(packed)["content_size"]) or head.size
    return len(packed)


def _expanded(source: ByteSource, compression: str, packed: memoryview, size: int) -> memoryview:
    """At most one byte more than a size, whatever the compressed bytes hold."""
    if compression == "zstd":
        alone = zstandard.get_frame_parameters(packed).content_size == size
        if alone and _frame_end(packed) > len(packed):
            raise ChunkError("its compressed blocks run past its end")
        into = source.room(size + 1)
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=not alone)
        return into[: reader.readinto(into)]
    if compression == "lz4":
        data = b""
        rest: memoryview | bytes = packed
        for _ in range(MOST_FRAMES):
            if not rest or len(data) > size:
                break
            unpacker = lz4.frame.LZ4FrameDecompressor()
            data += unpacker.decompress(rest, max_length=size + 1 - len(data))
            rest = (unpacker.unused_data or b"") if unpacker.eof else b""
        return memoryview(data)
    return packed[: size + 1]


def _frame_end(packed: memoryview) -> int:
    """Place after the first frame of zstd, by the heads of its blocks; beyond the end where one is not whole."""
    at, last = zstandard.frame_header_size(packed), False
    while not last:
        if at + BLOCK_HEAD.size > len(packed):
            return at + BLOCK_HEAD.size
        low, high = BLOCK_HEAD.unpack_from(packed, at)
        head = low | high << 8
        last = bool(head & 1)
        repeated = head >> 1 & 3 == 1
        at += BLOCK_HEAD.size + (1 if repeated else head >> 3)
    return at + 4 * zstandard.get_frame_parameters(packed).has_checksum


def _whole(data: memoryview) -> bool:
    """Whether records of the kinds that a chunk holds fill the bytes to the end."""
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        if opcode in LAYOUT and opcode not in (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE):
            return False
        at += HEAD.size + length
    return at == len(data)

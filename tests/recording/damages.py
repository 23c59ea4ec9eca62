"""The table of damage: named ways in which a recording is spoiled, each with the messages that it truly held."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from . import writer
from .conformance import framed
from .readers import records
from .writer import Bench

CHUNK, INDEX, DATA_END, FOOTER, METADATA, ATTACHMENT, STATISTICS = 6, 7, 15, 2, 12, 9, 11
TORQUE, COUNT = "/daq/torque_sun/frequency", "/daq/encoder_ring/count"
HEAD = 9
CHUNK_SIZE, CHUNK_CRC, CHUNK_NAME = HEAD + 16, HEAD + 24, HEAD + 32
"""Places in a chunk record of its expanded size, its CRC and the name of its compression."""


@dataclass(frozen=True)
class Damage:
    """A way to spoil a recording.

    Parameters
    ----------
    kind : str
        ``container``, ``encoding``, ``time`` or ``signal``.
    name : str
        What happened.
    make : callable
        The spoilt file.
    whole : callable
        The file before; of the other kinds the spoilt file itself, whose messages all are what was recorded.
    """

    kind: str
    name: str
    make: Callable[[], bytes]
    whole: Callable[[], bytes] | None = field(default=None)

    def files(self) -> tuple[bytes, bytes]:
        """The spoilt file and the whole one."""
        spoilt = self.make()
        return spoilt, spoilt if self.whole is None else self.whole()


def recorded(bench: Bench) -> bytes:
    """A run as a file."""
    with TemporaryDirectory() as folder:
        return writer.write(Path(folder) / "a.mcap", bench).read_bytes()


def rewritten(
    data: bytes,
    compression: CompressionType = CompressionType.ZSTD,
    *,
    crc: bool = True,
    data_crc: bool = False,
    chunked: bool = True,
    chunk_size: int = 8192,
) -> bytes:
    """The same contents by the official writer under other settings."""
    reader = make_reader(BytesIO(data))
    out = BytesIO()
    to = Writer(
        out,
        chunk_size=chunk_size,
        compression=compression,
        enable_crcs=crc,
        enable_data_crcs=data_crc,
        use_chunking=chunked,
    )
    to.start(profile="pmg", library="test bench")
    for record in reader.iter_metadata():
        to.add_metadata(record.name, record.metadata)
    for item in reader.iter_attachments():
        to.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
    numbers: dict[int, int] = {}
    schemas: dict[int, int] = {}
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if schema.id not in schemas:
            schemas[schema.id] = to.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in numbers:
            numbers[channel.id] = to.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
            )
        to.add_message(
            numbers[channel.id], message.log_time, message.data, message.publish_time, sequence=message.sequence
        )
    to.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


@cache
def base(
    compression: CompressionType = CompressionType.ZSTD,
    *,
    crc: bool = True,
    chunked: bool = True,
) -> bytes:
    """The recording that is spoilt: six seconds in some thirteen chunks, or without chunks.

    It has no CRC over all data, as recorders on the official writer have none: damage must show without it.
    """
    return rewritten(recorded(Bench(seconds=6.0)), compression, crc=crc, chunked=chunked)


def plain() -> bytes:
    """Without chunks."""
    return base(CompressionType.NONE, chunked=False)


def raw() -> bytes:
    """With chunks that are not compressed."""
    return base(CompressionType.NONE)


def of_kind(data: bytes, opcode: int) -> list[tuple[int, int]]:
    """Place and end of the records of a kind."""
    return [(at, end) for at, found, end in records(data) if found == opcode]


def middle(data: bytes, opcode: int = CHUNK) -> tuple[int, int]:
    """The one in the middle of them."""
    found = of_kind(data, opcode)
    return found[len(found) // 2]


def put(data: bytes, at: int, new: bytes) -> bytes:
    """The file with some bytes written over."""
    return data[:at] + new + data[at + len(new) :]


def flip(data: bytes, at: int) -> bytes:
    """The file with one bit turned."""
    return put(data, at, bytes([data[at] ^ 0x10]))


def u64(value: int) -> bytes:
    """A length."""
    return struct.pack("<Q", value)


def in_chunk(offset: int, new: bytes, data: Callable[[], bytes] = base) -> Callable[[], bytes]:
    """A field of the middle chunk written over."""
    return lambda: put(data(), middle(data())[0] + offset, new)


def flipped(opcode: int, data: Callable[[], bytes] = base) -> Callable[[], bytes]:
    """A bit in the middle of the middle record of a kind turned."""
    return lambda: flip(data(), sum(middle(data(), opcode)) // 2)


def outer_length(change: Callable[[int], int]) -> bytes:
    """The middle chunk's length changed."""
    at, end = middle(raw())
    return put(raw(), at + 1, u64(change(end - at - HEAD)))


def bomb() -> bytes:
    """A chunk between others that claims a tebibyte, in its head and in its compressed bytes."""
    packed = b"\x28\xb5\x2f\xfd\xc0\x50" + u64(1 << 40) + struct.pack("<I", 1 | 1 << 1 | 1000 << 3)[:3] + b"\0"
    head = struct.pack("<QQQII", 0, 1, 1 << 40, 12345, 4) + b"zstd" + u64(len(packed))
    at = middle(base())[0]
    return base()[:at] + framed(CHUNK, head + packed) + base()[at:]


def growing_bomb() -> bytes:
    """The same with a head that claims little: what it really holds shows only while it is expanded."""
    return put(bomb(), middle(base())[0] + CHUNK_SIZE, u64(1000))


def swapped() -> bytes:
    """Two neighbouring chunks in the wrong order, before their indexes."""
    chunks = of_kind(base(), CHUNK)
    (a, b), (c, d) = chunks[4], chunks[5]
    return base()[:a] + base()[c:d] + base()[b:c] + base()[a:b] + base()[d:]


def unindexed() -> bytes:
    """All indexes of messages are noise."""
    data = base()
    for at, end in of_kind(base(), INDEX):
        data = put(data, at + HEAD, bytes(zlib.crc32(bytes([at & 255, i & 255])) & 255 for i in range(end - at - HEAD)))
    return data


def headless() -> bytes:
    """The first chunk, which describes the channels, is spoilt."""
    at, end = of_kind(base(), CHUNK)[0]
    return flip(base(), (at + end) // 2)


def cut(to: Callable[[bytes], int], data: Callable[[], bytes] = base) -> Callable[[], bytes]:
    """The file up to a place."""
    return lambda: data()[: to(data())]


def start_of(opcode: int) -> Callable[[bytes], int]:
    """Place of the middle record of a kind."""
    return lambda data: middle(data, opcode)[0]


def between(gone: int, new: bytes, data: Callable[[], bytes] = base) -> Callable[[], bytes]:
    """Some bytes in the middle of the file replaced by others."""
    half = len(data()) // 2
    return lambda: data()[:half] + new + data()[half + gone :]


def message_length(new: int) -> bytes:
    """The length of a message outside of chunks changed."""
    return put(plain(), middle(plain(), 5)[0] + 1, u64(new))


def unproven() -> bytes:
    """In a chunk without CRC the length of a message is changed."""
    data = base(CompressionType.NONE, crc=False)
    at, _ = middle(data)
    inner = at + HEAD + 32 + 8
    return put(data, inner + 1, u64(1 << 20))


CONTAINER: tuple[tuple[str, Callable[[], bytes], Callable[[], bytes]], ...] = (
    ("cut in the middle of a chunk", cut(lambda d: sum(middle(d)) // 2), base),
    ("cut inside the head of a chunk", cut(lambda d: middle(d)[0] + 5), base),
    ("cut between chunks", cut(start_of(CHUNK)), base),
    ("cut before the end of the data", cut(start_of(DATA_END)), base),
    ("cut in the summary", cut(lambda d: start_of(STATISTICS)(d) + 20), base),
    ("last byte missing", cut(lambda d: len(d) - 1), base),
    ("nothing but the signature", cut(lambda d: 8), base),
    ("cut in the middle, without chunks", cut(lambda d: len(d) // 2, plain), plain),
    ("empty file", lambda: b"", base),
    ("a text file", lambda: b"time;torque\n0;1\n", base),
    ("bit in a zstd chunk", flipped(CHUNK), base),
    (
        "bit in an lz4 chunk",
        flipped(CHUNK, lambda: base(CompressionType.LZ4)),
        lambda: base(CompressionType.LZ4),
    ),
    ("bit in a chunk without compression", flipped(CHUNK, raw), raw),
    ("bit in the CRC of a chunk", lambda: flip(base(), middle(base())[0] + CHUNK_CRC), base),
    ("expanded size of a chunk too small", in_chunk(CHUNK_SIZE, u64(10)), base),
    ("expanded size of a chunk beyond memory", in_chunk(CHUNK_SIZE, u64(1 << 60)), base),
    ("unknown compression", in_chunk(CHUNK_NAME, b"zst9"), base),
    ("length of a chunk 1000 too long", lambda: outer_length(lambda n: n + 1000), raw),
    ("length of a chunk 1000 too short", lambda: outer_length(lambda n: n - 1000), raw),
    ("length of a chunk beyond the file", lambda: outer_length(lambda n: n | 1 << 50), raw),
    ("length of the records in a chunk wrong", in_chunk(CHUNK_NAME + 4, u64(17)), base),
    ("code of a chunk 0", in_chunk(0, b"\0"), base),
    ("code of a chunk reserved", in_chunk(0, b"\x46"), base),
    ("code of a chunk private", in_chunk(0, b"\x86"), base),
    ("code of a chunk that of the footer", in_chunk(0, bytes([FOOTER])), base),
    ("code of an index that of a message", lambda: put(base(), middle(base(), INDEX)[0], b"\x05"), base),
    (
        "code of an index that of the end of the data",
        lambda: put(base(), middle(base(), INDEX)[0], bytes([DATA_END])),
        base,
    ),
    ("chunk that describes the channels spoilt", headless, base),
    ("the same, and no summary", lambda: headless()[: start_of(DATA_END)(base()) + 13], base),
    ("all indexes of messages noise", unindexed, base),
    ("end of the data missing", lambda: base().replace(base()[slice(*middle(base(), DATA_END))], b""), base),
    ("bit in the statistics", flipped(STATISTICS), base),
    ("bit in the footer", flipped(FOOTER), base),
    ("bit in the attachment", flipped(ATTACHMENT), base),
    ("length of the metadata absurd", lambda: put(base(), middle(base(), METADATA)[0] + 1, u64(1 << 61)), base),
    ("signature destroyed", lambda: put(base(), 0, b"XXXXXXXX"), base),
    ("first 512 bytes zero", lambda: put(base(), 0, bytes(512)), base),
    ("512 bytes zero in the middle", between(512, bytes(512)), base),
    ("4096 bytes zero in the middle", between(4096, bytes(4096)), base),
    ("second half zero", lambda: base()[: len(base()) // 2] + bytes(len(base()) // 2), base),
    ("100 bytes missing", between(100, b""), base),
    ("100 bytes too many", between(0, b"\x05" * 100), base),
    ("100 bytes missing, without chunks", between(100, b"", plain), plain),
    ("512 bytes zero, without chunks", between(512, bytes(512), plain), plain),
    ("length of a message too long, without chunks", lambda: message_length(5000), plain),
    ("length of a message absurd, without chunks", lambda: message_length(1 << 62), plain),
    ("length of a message in a chunk without CRC", unproven, lambda: base(CompressionType.NONE, crc=False)),
    ("other bytes before the signature", lambda: b"HTTP/1.1 200 OK\r\n\r\n" + base(), base),
    ("line ends converted", lambda: base().replace(b"\r\n", b"\n"), base),
    ("chunk written twice", lambda: base()[: middle(base())[1]] + base()[middle(base())[0] :], base),
    ("chunk missing", lambda: base()[: middle(base())[0]] + base()[middle(base())[1] :], base),
    ("two chunks in the wrong order", swapped, base),
    ("two files in one", lambda: base() + base(), base),
    ("other bytes behind the end", lambda: base() + b"junk" * 50, base),
    ("bomb: a chunk that claims a tebibyte", bomb, base),
    ("bomb: the same with a small head", growing_bomb, base),
)

BLOCKS = 20


def frequencies(change: Callable[[int], bytes] = lambda number: b"") -> Callable[[], bytes]:
    """A run in which some blocks of the torque are other messages."""

    def make() -> bytes:
        values = np.full(writer.BLOCK, 10_400.0)
        usual = [writer.block(n * writer.BLOCK, "f64", values) for n in range(BLOCKS)]
        blocks = [change(n) or block for n, block in enumerate(usual)]
        return recorded(Bench(seconds=4.0, raw={TORQUE: blocks}))

    return make


def at_seven(message: bytes) -> Callable[[], bytes]:
    """A run whose eighth block of the torque is this message."""
    return frequencies(lambda number: message if number == 7 else b"")


def seventh(value: float, first: int = 700) -> bytes:
    """A block of the torque of one value."""
    return writer.block(first, "f64", np.full(writer.BLOCK, value))


def bench(**change: object) -> Callable[[], bytes]:
    """A run recorded otherwise."""
    return lambda: recorded(Bench(**change))  # type: ignore[arg-type]


OTHERS: tuple[tuple[str, str, Callable[[], bytes]], ...] = (
    ("encoding", "message of noise", at_seven(bytes(range(1, 90)))),
    ("encoding", "message that ends inside a field", at_seven(seventh(1e4)[:-13])),
    ("encoding", "message of a wire type that does not exist", at_seven(b"\x07" + seventh(1e4))),
    ("encoding", "block of two types of samples", at_seven(seventh(1e4) + writer.lump(12, bytes(400)))),
    ("encoding", "block of another type than declared", at_seven(writer.block(700, "u32", np.arange(100)))),
    ("encoding", "length of a field beyond the message", at_seven(seventh(1e4)[:20] + b"\xff" * 9 + b"\x01")),
    ("encoding", "unit of a channel wrong", bench(channel={TORQUE: {"unit": "mHz"}})),
    ("encoding", "type of a channel unknown", bench(channel={TORQUE: {"dtype": "f16"}})),
    ("encoding", "topic that nobody knows", bench(extra={"/daq/torque_sum/frequency": seventh(1e4)})),
    ("time", "samples missing", bench(seconds=4.0, drop={TORQUE: (500, 900)})),
    ("time", "block with an absurd index", at_seven(seventh(1e4, 1 << 61))),
    ("time", "block written twice", at_seven(seventh(10_400.0, 600))),
    ("time", "two blocks of one place that differ", at_seven(seventh(9_000.0, 600))),
    ("time", "channel that ends early", bench(seconds=4.0, drop={TORQUE: (1500, 2000)})),
    ("time", "rates that differ", bench(channel={COUNT: {"rate_hz": "400"}})),
    ("time", "clock an hour off", bench(marks=[(0, 1_745_400_000_000_000_000)])),
    ("time", "acquisition restarted", bench(flags={TORQUE: {3: 2}})),
    ("signal", "recorder lost samples", bench(flags={TORQUE: {3: 1}})),
    ("signal", "input beyond its range", bench(flags={TORQUE: {3: 4}})),
    ("signal", "values that are no numbers", at_seven(seventh(float("nan")))),
    ("signal", "encoder slipped", bench(seconds=4.0, with_index=True, index_slip=300)),
    ("signal", "counter wider than declared", bench(channel={COUNT: {"bits": "8"}})),
    ("signal", "edges that stop", bench(encoding="edges", silent_from=1.0)),
    ("signal", "time base off the clock", bench(encoding="edges", timebase_error=1e-3)),
    ("signal", "channel missing", bench(without=frozenset({COUNT}))),
)

DAMAGES = tuple(Damage("container", *entry) for entry in CONTAINER) + tuple(Damage(*entry) for entry in OTHERS)

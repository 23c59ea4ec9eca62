"""Bombs: small files that ask for much memory or time, each beside what a file of its size may take."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard

from tests.grid.checked_campaign import NEUTRAL
from tests.recording.conformance import framed
from tests.recording.writer import FIELDS, Bench, Other, block, key, lump, tracks, varint, write

from .case import BOTH, Case, Desk
from .containers import JSON, SCHEMA, at_start, attachment, before_end, channel, message, metadata, text
from .signals import SUN
from .texts import DEEP

MEGABYTE = 1 << 20


def chunk(records: bytes, compression: str = "zstd", off: int = 0) -> bytes:
    """Record of a chunk with its CRC, or with one that is off."""
    packed = zstandard.compress(records) if compression == "zstd" else lz4.frame.compress(records)
    head = struct.pack("<QQQI", 0, 0, len(records), zlib.crc32(records) ^ off)
    return framed(6, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


def _chunks(count: int, records: Callable[[int], Iterator[bytes]], compression: str = "zstd") -> Callable[[], bytes]:
    """The recording with so many more chunks; the records of each by its number."""
    return lambda: before_end(*(chunk(b"".join(records(number)), compression) for number in range(count)))


def _one(record: Callable[[int], bytes]) -> Callable[[int], Iterator[bytes]]:
    return lambda number: iter((record(number),))


def _zeros(number: int) -> bytes:
    """A message of 200 MB of zeros."""
    return message(1, bytes(200 * MEGABYTE + number))


def _channels(number: int) -> Iterator[bytes]:
    return (channel(10 + 10_000 * number + k, 0, f"/{number}/{k}/" + "x" * 4096) for k in range(10_000))


def _schemas(number: int) -> Iterator[bytes]:
    body = text("protobuf") + text(bytes(4096))
    return (framed(SCHEMA, struct.pack("<H", 10 + 10_000 * number + k) + text("x") + body) for k in range(10_000))


def _apart(jump: int, parts: int, rate_hz: float = 1e6) -> Callable[[Path], object]:
    """Blocks of every channel so many samples apart."""

    def make(path: Path) -> None:
        bench = Bench(seconds=8.0)
        spans = {
            topic: [block(at * jump, meta["dtype"], np.asarray(values[:100])) for at in range(parts)]
            for topic, (meta, values) in tracks(bench).items()
        }
        write(path, Bench(seconds=8.0, rate_hz=rate_hz, raw=spans))

    return make


def _claimed(path: Path) -> None:
    """A block that claims an exabyte of samples."""
    number = FIELDS["f64"][0]
    write(path, Bench(raw={SUN: [block(0, "f64", np.zeros(10)) + key(number, 2) + varint(1 << 60)]}))


def _other(encoding: str, schema: tuple[str, str, bytes], *data: bytes, topic: str = SUN) -> Callable[[Path], object]:
    return lambda path: write(path, Bench(other={topic: Other(encoding, schema, data)}))


def _one_value(path: Path, samples: int = 30_000_000) -> None:
    """Blocks of one value in each channel, in a few kilobytes."""
    raw = {topic: [block(0, m["dtype"], np.zeros(samples))] for topic, (m, _) in tracks(Bench()).items()}
    write(path, Bench(raw=raw))


def _damaged(number: int) -> bytes:
    """A chunk of 60 MB of zeros whose CRC does not hold."""
    return chunk(message(1, bytes(60 * MEGABYTE + number)), off=1)


FILES: tuple[tuple[str, Callable[[], bytes]], ...] = (
    ("66 chunks of 480,000 empty messages", _chunks(66, lambda _: iter((message(1, b"") * 480_000,)))),
    ("one chunk of 8 million empty messages", _chunks(1, lambda _: iter((message(1, b"") * 8_000_000,)))),
    ("a message of 200 MB in 20 kB of zstd", _chunks(1, _one(_zeros))),
    ("four of them", _chunks(4, _one(_zeros))),
    ("ten of them", _chunks(10, _one(_zeros))),
    ("a message of 200 MB in 1 MB of lz4", _chunks(1, _one(_zeros), "lz4")),
    ("a chunk of 300 MB", _chunks(1, _one(lambda _: message(1, bytes(300 * MEGABYTE))))),
    ("100 chunks of 60 MB whose CRC is wrong", lambda: before_end(*map(_damaged, range(100)))),
    ("60,000 channels of 4 kB of name", _chunks(6, _channels)),
    ("60,000 schemas of 4 kB", _chunks(6, _schemas)),
    ("100,000 attachments of nothing", lambda: before_end(*(attachment("a", b"") for _ in range(100_000)))),
    ("100,000 metadata of nothing", lambda: before_end(*(metadata("a") for _ in range(100_000)))),
    ("metadata of 200,000 entries", lambda: before_end(metadata("a", **{f"k{k}": "" for k in range(200_000)}))),
    ("a run of 200,000 entries", lambda: at_start(metadata("pmg.run", **{f"k{k}": "" for k in range(200_000)}))),
    ("65,000 channels of nothing", lambda: at_start(*(channel(k, 0, f"/{k}") for k in range(10, 65_000)))),
)
RUNS: tuple[tuple[str, Callable[[Path], object]], ...] = (
    ("40 blocks 49 million samples apart", _apart(49_000_000, 40)),
    ("two blocks 49 million samples apart", _apart(49_000_000, 2)),
    ("40 blocks a million samples apart", _apart(1_000_000, 40)),
    ("two blocks 4.9 million samples apart", _apart(4_900_000, 2)),
    ("60 blocks one hour apart at 500 Hz", _apart(1_799_000, 60, 500.0)),
    ("a block that claims an exabyte", _claimed),
    ("30 million samples of one value in each channel", _one_value),
    ("2 million samples of one value in each channel", lambda path: _one_value(path, 2_000_000)),
    ("400,000 JSON messages of one sample", _other("json", JSON, *[b'{"value": 10000.5}'] * 400_000)),
    ("a JSON message nested 100,000 deep", _other("json", JSON, b"[" * 100_000)),
    ("a JSON message of 10 million zeros", _other("json", JSON, b'{"value": [' + b"0," * 10_000_000 + b"0]}")),
    ("CDR of an array of 2^31", _other("cdr", ("a/B", "ros2msg", b"float64[] f64"), b"\0\1\0\0" + b"\xff" * 40)),
    (
        "a protobuf schema nested 20,000 deep",
        _other("protobuf", ("a.B", "protobuf", b"".join(lump(3, b"") for _ in range(DEEP))), b"\x08\x01"),
    ),
)


def _file(make: Callable[[], bytes]) -> Callable[[Desk], object]:
    return lambda desk: (desk.recordings / NEUTRAL).write_bytes(make())


def _run(make: Callable[[Path], object]) -> Callable[[Desk], object]:
    return lambda desk: make(desk.recordings / NEUTRAL)


CASES = (
    *(Case("bomb", what, spoil=_file(make), small=True, calls=BOTH, acts=lambda *_: "") for what, make in FILES),
    *(Case("bomb", what, spoil=_run(make), small=True, calls=BOTH, acts=lambda *_: "") for what, make in RUNS),
)

"""What is read many messages at once is what a reading one by one gives."""

from __future__ import annotations

import hashlib
import os
import re
import struct
import subprocess
import sys
import zlib
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.bench.recorded import record as recorded
from tests.bench.throughput import LAYOUTS, RATE_HZ, single_samples

from pmg.pipeline.recording.container.chunk import Allowance, ChunkError, ChunkHead, expand
from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.container.records import HEAD, MESSAGE, ChannelRecord, Op
from pmg.pipeline.recording.container.source import ByteSource
from pmg.pipeline.recording.container.taking import take_inside
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.layouts import wire
from pmg.pipeline.recording.layouts.manyblocks import many_blocks
from pmg.pipeline.recording.read import read_recording

from . import writer

CHANNELS = {number: ChannelRecord(number, 0, f"/{number}", "", {}) for number in (0, 1, 300)}


@given(lengths=st.lists(st.sampled_from([0, 1, 7, 7, 7, 40_000]), max_size=40), rows=st.integers(0, 5))
def test_messages_come_back_in_their_order(lengths: list[int], rows: int) -> None:
    payloads = [bytes([place % 251]) * length for place, length in enumerate(lengths)]
    found = Messages.of(payloads)
    table = np.arange(rows * 3, dtype=np.uint8).reshape(rows, 3)
    found.extend(table)
    expected = payloads + [row.tobytes() for row in table]
    assert list(found) == expected
    assert (len(found), found.size) == (len(expected), sum(map(len, expected)))
    again: dict[int, bytes] = {}
    for places, data in found.by_length():
        again |= {place: row.tobytes() for place, row in zip(places.tolist(), data, strict=True)}
    assert [again[place] for place in range(len(expected))] == expected


def record(channel: int, payload: bytes, number: int = 0, opcode: int = Op.MESSAGE) -> bytes:
    body = MESSAGE.pack(channel, number, 5, 6) + payload
    return HEAD.pack(opcode, len(body)) + body


@st.composite
def chunks(draw: st.DrawFn) -> bytes:
    """Records of a chunk: rounds of messages, broken here and there, with others between."""
    data = b""
    for _ in range(draw(st.integers(1, 3))):
        turn = draw(st.lists(st.tuples(st.sampled_from([0, 1, 300, 9]), st.integers(0, 30)), min_size=1, max_size=4))
        for number in range(draw(st.integers(1, 80))):
            for channel, length in turn:
                data += record(channel, bytes([number % 256]) * length, number)
        data += draw(
            st.sampled_from([b"", b"", record(1, b"odd"), record(0, b"", opcode=0x90), HEAD.pack(5, 3) + b"abc"])
        )
    return data[: len(data) - draw(st.sampled_from([0, 0, 0, 1, 20]))]


@settings(max_examples=150)
@given(data=chunks())
def test_messages_in_rounds_are_those_of_a_walk_from_record_to_record(data: bytes) -> None:
    expected: dict[int, list[bytes]] = {}
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        start, at = at + HEAD.size, at + HEAD.size + length
        if at <= len(data) and opcode == Op.MESSAGE and length >= MESSAGE.size:
            expected.setdefault(data[start] | data[start + 1] << 8, []).append(data[start:at])
    gathered = WholeRecords(lambda topic: topic != "/1", Findings("file"))
    for channel in CHANNELS.values():
        gathered.describe(channel, 0)
    take_inside(gathered, 0, memoryview(data))
    for number in CHANNELS:
        assert gathered.counts[number] == len(expected.get(number, []))
    for number in (0, 300):
        assert list(gathered.payloads[number]) == [whole[MESSAGE.size :] for whole in expected.get(number, [])]
    assert gathered.strangers.get(9, []) == expected.get(9, [])
    assert bool(gathered.findings.gathered) == (HEAD.pack(5, 3) + b"abc" in data or at != len(data))


def oddly(first: int, values: Sequence[int], flags: int) -> bytes:
    """A block whose samples come singly and whose index comes last."""
    singly = b"".join(writer.key(13, 5) + struct.pack("<I", value) for value in values)
    return writer.key(4, 0) + writer.varint(flags) + singly + writer.key(2, 1) + struct.pack("<Q", first)


@st.composite
def block(draw: st.DrawFn) -> bytes:
    first, flags = draw(st.integers(0, 2**64 - 1)), draw(st.sampled_from([0, 5, 127, 128, 300]))
    values = draw(st.lists(st.integers(0, 2**32 - 1), max_size=3))
    kind = draw(st.integers(0, 5))
    if kind == 0:
        return oddly(first, values, flags)
    if kind == 1:
        return draw(st.binary(max_size=30))
    made = writer.block(first, draw(st.sampled_from(["u32", "f32"])), np.array(values), flags=flags, clock=flags // 2)
    if kind == 2:
        place = draw(st.integers(0, len(made) - 1))
        return made[:place] + draw(st.binary(min_size=1, max_size=1)) + made[place + 1 :]
    return made


@settings(max_examples=200)
@given(payloads=st.lists(block(), max_size=12), again=st.integers(1, 4))
def test_blocks_read_together_are_the_blocks_read_singly(payloads: list[bytes], again: int) -> None:
    payloads = payloads * again
    found = many_blocks(Messages.of(payloads))
    names = {number: name for number, (name, _, _) in wire.SAMPLE_FIELDS.items()} | {0: ""}
    starts = np.cumsum(found.counts) - found.counts
    for place, payload in enumerate(payloads):
        if place in found.faults:
            with pytest.raises(wire.WireError, match=re.escape(found.faults[place])):
                wire.sample_block(payload)
            continue
        single = wire.sample_block(payload)
        said = found.first[place], found.clock[place], found.flags[place], names[int(found.kind[place])]
        assert said == (single.first_sample, single.clock_id, single.flags, single.dtype)
        assert found.counts[place] == len(single.values)
    for number, (_, dtype, _) in wire.SAMPLE_FIELDS.items():
        sound = (found.kind == number) & (found.counts > 0)
        counts = np.where(sound, found.counts, 0)
        starts = np.cumsum(counts) - counts
        expected = [wire.sample_block(payloads[place]).values for place in np.flatnonzero(sound)]
        values = found.values(sound, starts, dtype)
        assert values.tobytes() == b"".join(each.tobytes() for each in expected)


def test_a_frame_of_zstd_that_is_cut_is_refused_although_all_its_bytes_came_out(tmp_path: Path) -> None:
    data = record(0, bytes(range(256)) * 8)
    packed = zstandard.ZstdCompressor(write_checksum=True).compress(data)
    path = tmp_path / "packed"
    for cut, refused in ((0, False), (1, True), (4, True)):
        path.write_bytes(packed[: len(packed) - cut])
        with path.open("rb") as stream:
            size = len(packed) - cut
            source, head = ByteSource(stream, size), ChunkHead(0, 0, len(data), zlib.crc32(data), "zstd", 0, size)
            if refused:
                with pytest.raises(ChunkError, match="past its end"):
                    expand(source, head, size, Allowance.of(size))
            else:
                assert bytes(expand(source, head, size, Allowance.of(size))) == data


@given(
    data=st.binary(min_size=1, max_size=400), cuts=st.lists(st.integers(0, 400), max_size=8), stop=st.integers(0, 400)
)
def test_the_hash_is_that_of_the_file_in_whatever_order_it_was_read(data: bytes, cuts: list[int], stop: int) -> None:
    source = ByteSource(BytesIO(data), len(data))
    for start, end in zip(cuts[::2], cuts[1::2], strict=False):
        assert bytes(source.lend(start, end)) == data[start : max(start, end)]
    assert source.crc(0, stop) == zlib.crc32(data[:stop])
    assert source.digest() == hashlib.sha256(data).hexdigest()


MEASURED = """
import sys
from pathlib import Path
from pmg.pipeline.recording.read import read_recording
from tests.bench.throughput import _peak
read_recording(Path(sys.argv[1]))
before = _peak()
print(read_recording(Path(sys.argv[2])).samples.estimated_size(), _peak() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell the memory of a program")
def test_a_reading_takes_little_more_memory_than_its_result(tmp_path: Path) -> None:
    for name, samples in (("small", 40_000), ("large", 8_000_000)):
        columns = LAYOUTS["frequency f64"](samples, np.random.default_rng(1))
        recorded(tmp_path / name, columns, writer.RUN, writer.CALIBRATION.encode(), RATE_HZ, 1000)
    words = [sys.executable, "-c", MEASURED, str(tmp_path / "small"), str(tmp_path / "large")]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=dict(os.environ))
    result, peak = map(int, done.stdout.split())
    assert peak < 1.5 * result
    assert read_recording(tmp_path / "small").samples.height == 10_000


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell the memory of a program")
@pytest.mark.parametrize("encoding", ["scalar", "json"])
def test_messages_of_one_sample_are_let_go_topic_by_topic(tmp_path: Path, encoding: str) -> None:
    for name, samples in (("small", 2_000), ("large", 300_000)):
        single_samples(tmp_path / name, encoding, samples)
    words = [sys.executable, "-c", MEASURED, str(tmp_path / "small"), str(tmp_path / "large")]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=dict(os.environ))
    result, peak = map(int, done.stdout.split())
    # The messages alone are some three times the result; with the numbers of every topic held besides, it is 14 to 17.
    assert peak < 10 * result

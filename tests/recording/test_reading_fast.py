"""What is read many at a time, or beside the reading, is what reading it one by one gives."""

from __future__ import annotations

import hashlib
import json
import struct
import time
import zlib
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.recording.container import rounds, trail
from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.container.records import HEAD, ChannelRecord, Op
from pmg.pipeline.recording.container.source import BLOCK, ByteSource
from pmg.pipeline.recording.container.taking import take_inside
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.layouts import jsonalike, jsonmessages
from pmg.pipeline.recording.layouts.jsonmessages import read_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.recording.layouts.layout import Columns

# --- JSON ----------------------------------------------------------------------------------------------

WHOLE = st.one_of(st.integers(-120, 120), st.integers(-(1 << 66), 1 << 66), st.integers(0, 1 << 64))
REAL = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(-1e4, 1e4).map(lambda x: round(x, 3)),
    st.floats(9000, 11000),
    st.sampled_from([0.0, -0.0, 1e22, 0.1, 123456789012345.6]),
)
STRANGE = ['{"a": 01}', '{"a": 1.}', '{"a": 1', "[1]", '{"a": 1}}', ' {"a": 2} ', '{"a": "1"}', '{"a": [1, 2]}', "{}"]
STRANGE += ['{"a": 1e3}', '{"a": NaN}', '{"a": 1, "a": 2}', '{"a.b": 1, "a": {"b": 2}}', '{"t": "1"}', '{"a": -0}']


def one_by_one(payloads: Messages) -> Columns:
    """The same messages with none of them read together."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jsonmessages, "read_alike", lambda given, _: ({}, np.zeros(len(given), dtype=np.bool_)))
        return read_json(payloads)


def assert_same(texts: list[str]) -> None:
    payloads = Messages.of(text.encode() for text in texts)
    found, expected = read_json(payloads), one_by_one(payloads)
    assert found.faults == expected.faults
    assert list(found.values) == list(expected.values)
    for path, values in expected.values.items():
        assert found.counts[path].tolist() == expected.counts[path].tolist()
        assert (found.values[path].dtype, found.values[path].tobytes()) == (values.dtype, values.tobytes())


@settings(max_examples=150)
@given(data=st.data(), whole=st.booleans())
def test_numbers_of_messages_that_stand_alike_are_those_read_one_by_one(data: st.DataObject, whole: bool) -> None:
    values = data.draw(st.lists(WHOLE if whole else st.one_of(REAL, WHOLE), min_size=1, max_size=8))
    texts = [json.dumps({"sample": k, "value": values[k % len(values)], "on": True}) for k in range(300)]
    for _ in range(data.draw(st.integers(0, 4))):
        texts[data.draw(st.integers(0, 299))] = data.draw(st.sampled_from(STRANGE))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jsonalike, "FEWEST", 2)
        assert_same(texts)


@settings(max_examples=50)
@given(data=st.data())
def test_a_message_of_the_same_length_that_is_no_json_is_not_taken_for_one(data: st.DataObject) -> None:
    texts = [f'{{"a": {k}, "b": {{"c": {k / 8:.3f}}}, "s": null}}' for k in range(100, 200)]
    for _ in range(3):
        row, character = data.draw(st.integers(0, 99)), data.draw(st.sampled_from('0:.-e" {}/9a'))
        place = data.draw(st.integers(0, len(texts[row]) - 1))
        texts[row] = texts[row][:place] + character + texts[row][place + 1 :]
    assert_same(texts)


@pytest.mark.parametrize(
    "text", ['{"a": 012, "b": 1.5}', '{"a": 1:2, "b": 1.5}', '{"a": 1.2, "b": 1.5}', '{"a": 112, "b": .15}']
)
def test_digits_that_no_number_begins_with_are_not_read_as_one(text: str) -> None:
    texts = [f'{{"a": {k}, "b": {k % 9}.5}}' for k in range(100, 200)]
    texts[50] = text
    assert_same(texts)


def test_messages_that_stand_alike_are_not_read_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def counted(payloads: Messages, done: Any, *rest: Any) -> None:  # noqa: ANN401 (passed on)
        seen.append(int(np.count_nonzero(~done)))

    monkeypatch.setattr(jsonmessages, "_one_by_one", counted)
    texts = [json.dumps({"sample": k, "value": round(10_000 + k / 7, 2)}) for k in range(10_000, 20_000)]
    assert len(read_json(Messages.of(text.encode() for text in texts)).values["value"]) > 9_900
    assert sum(seen) < 100


def test_more_fields_than_are_followed_are_the_first_ones() -> None:
    wide = [json.dumps({f"f{n:03d}": n + k for n in range(300)}) for k in range(100, 150)]
    assert_same([*wide, *(json.dumps({"late": k}) for k in range(100, 200))])


# --- messages of any length ----------------------------------------------------------------------------


def gathered(records: list[bytes]) -> WholeRecords:
    found = WholeRecords(lambda topic: topic != "/c2", Findings("f"))
    for number in range(3):
        found.describe(ChannelRecord(number, 0, f"/c{number}", "json", {}), 0)
    take_inside(found, 0, memoryview(b"".join(records)))
    return found


def record(opcode: int, body: bytes) -> bytes:
    return HEAD.pack(opcode, len(body)) + body


def message(channel: int, payload: bytes) -> bytes:
    return record(Op.MESSAGE, struct.pack("<HIQQ", channel, 0, 0, 0) + payload)


@settings(max_examples=80)
@given(seed=st.integers(0, 1 << 32), strange=st.integers(0, 6), cut=st.integers(0, 40))
def test_messages_taken_in_passing_are_those_of_a_walk_from_record_to_record(seed: int, strange: int, cut: int) -> None:
    rng = np.random.default_rng(seed)
    records = [message(int(rng.integers(0, 3)), rng.bytes(int(rng.integers(0, 40)))) for _ in range(700)]
    odd = [message(7, b"nobody's"), record(Op.MESSAGE, bytes(5)), record(0x90, b"own"), record(Op.DATA_END, bytes(4))]
    for _ in range(strange):
        records.insert(int(rng.integers(0, 700)), odd[int(rng.integers(0, 4))])
    records[-1] = records[-1][: len(records[-1]) - cut]
    found = gathered(records)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rounds.Round, "after", lambda self, place, stop: stop)
        expected = gathered(records)
    assert found.counts == expected.counts
    assert found.strangers == expected.strangers
    assert {k: list(m) for k, m in found.payloads.items()} == {k: list(m) for k, m in expected.payloads.items()}
    assert found.findings.listed() == expected.findings.listed()


def test_messages_of_many_lengths_are_taken_in_passing(monkeypatch: pytest.MonkeyPatch) -> None:
    alone: list[int] = []
    monkeypatch.setattr(WholeRecords, "message", lambda self, data, start, stop: alone.append(start))
    gathered([message(k % 3, bytes(k * k % 41)) for k in range(20_000)])
    assert len(alone) < 1_000


def test_some_messages_are_given_with_their_places() -> None:
    payloads = [bytes([k % 256]) * (k % 50) for k in range(20_000)]
    wanted = np.arange(20_000) % 7 == 3
    held = Messages.of(payloads)
    assert list(held.those(wanted)) == [(k, payloads[k]) for k in np.flatnonzero(wanted).tolist()]


# --- hash and CRC beside the reading -------------------------------------------------------------------


@pytest.mark.parametrize("slow", [False, True])
def test_what_is_summed_beside_the_reading_is_summed_before_its_memory_is_taken_again(
    slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    own: Callable[[trail.Trail, bytes | memoryview], None] = trail.Trail._sum

    def late(self: trail.Trail, data: bytes | memoryview) -> None:
        time.sleep(0.003)
        own(self, data)

    if slow:
        monkeypatch.setattr(trail.Trail, "_sum", late)
    data = np.random.default_rng(1).bytes(5 * BLOCK + 77)
    source = ByteSource(BytesIO(data), len(data))
    for start in range(0, 4 * BLOCK, BLOCK // 4):
        assert bytes(source.lend(start + 100, start + BLOCK // 4)) == data[start + 100 : start + BLOCK // 4]
    assert source.crc(0, 4 * BLOCK + 5) == zlib.crc32(data[: 4 * BLOCK + 5])
    assert source.digest() == hashlib.sha256(data).hexdigest()


def test_what_fails_beside_the_reading_is_raised_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: trail.Trail, data: bytes | memoryview) -> None:
        raise MemoryError

    monkeypatch.setattr(trail.Trail, "_sum", failing)
    source = ByteSource(BytesIO(bytes(BLOCK)), BLOCK)
    source.lend(0, BLOCK)
    with pytest.raises(MemoryError):
        source.digest()
    source.close()


def test_no_hash_is_given_where_a_stretch_before_the_last_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    own: Callable[[trail.Trail, bytes | memoryview], None] = trail.Trail._sum

    def first_failing(self: trail.Trail, data: bytes | memoryview) -> None:
        if bytes(data[:1]) == b"a":
            raise MemoryError
        own(self, data)

    monkeypatch.setattr(trail.Trail, "_sum", first_failing)
    both = trail.Trail()
    for byte in (b"a", b"b"):
        both.add(byte * trail.ASIDE)
    with pytest.raises(MemoryError):
        both.digest()
    both.close()

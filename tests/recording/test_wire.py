from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.recording.layouts import wire

from . import writer

SAMPLES = {
    "f64": np.array([1.5, -2.25, np.inf]),
    "f32": np.array([0.5, -3.0, 7.0]),
    "i32": np.array([-(2**31), 0, 2**31 - 1]),
    "u32": np.array([0, 1, 2**32 - 1]),
    "u64": np.array([0, 1, 2**64 - 1], dtype=np.uint64),
}


@pytest.mark.parametrize("dtype", SAMPLES)
def test_a_block_gives_back_its_samples_whatever_their_type(dtype: str) -> None:
    found = wire.sample_block(writer.block(2**40 + 3, dtype, SAMPLES[dtype], flags=5, clock=300))
    assert (found.first_sample, found.clock_id, found.flags, found.dtype) == (2**40 + 3, 300, 5, dtype)
    np.testing.assert_array_equal(found.values, SAMPLES[dtype])


@given(values=st.lists(st.integers(0, 2**32 - 1), max_size=30), cut=st.integers(0, 30), loose=st.booleans())
def test_samples_split_over_pieces_or_written_singly_are_the_same_samples(
    values: list[int], cut: int, loose: bool
) -> None:
    head = writer.key(2, 1) + struct.pack("<Q", 9)
    first, rest = values[:cut], values[cut:]
    packed = writer.lump(13, np.array(first, dtype="<u4").tobytes())
    singly = b"".join(writer.key(13, 5) + struct.pack("<I", value) for value in rest)
    second = singly if loose else writer.lump(13, np.array(rest, dtype="<u4").tobytes())
    found = wire.sample_block(packed + head + second)
    assert found.values.tolist() == values
    assert found.first_sample == 9


@given(cut=st.integers(0, 200))
def test_a_block_cut_anywhere_is_refused_or_a_shorter_whole_message(cut: int) -> None:
    whole = writer.block(7, "f64", np.arange(20.0))
    try:
        found = wire.sample_block(whole[:cut])
    except wire.WireError:
        assert cut < len(whole)
    else:
        assert len(found.values) in (0, 20)


@given(data=st.binary(max_size=60))
def test_arbitrary_bytes_never_fail_otherwise_than_as_wire_error(data: bytes) -> None:
    for read in (
        wire.sample_block,
        wire.clock_mark,
        wire.index_pulse,
        wire.line_event,
        wire.test_step,
    ):
        try:
            read(data)
        except wire.WireError as fault:
            assert str(fault)  # noqa: PT017 - most bytes are no message, some are


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (writer.block(0, "f64", np.ones(2)) + writer.block(0, "u32", np.ones(2)), "in one block"),
        (writer.lump(10, b"1234567"), "no whole number"),
        (writer.key(13, 0) + b"\x05", "wire type 0"),
        (writer.key(2, 0) + b"\x05", "layout says 1"),
        (b"\x0b", "does not use"),
        (b"\x00\x01", "number 0"),
        (b"\x18" + b"\xff" * 11, "longer than ten"),
    ],
)
def test_what_is_wrong_with_a_block_is_said(data: bytes, words: str) -> None:
    with pytest.raises(wire.WireError, match=words):
        wire.sample_block(data)


def test_events_are_read_field_by_field_and_unknown_fields_are_passed_over() -> None:
    later = writer.lump(99, b"added by a newer recorder")
    assert wire.line_event(writer.event(440_999, 3, 1) + later) == wire.LineEvent(440_999, 3, 1)
    assert wire.index_pulse(writer.pulse(12, 65_535) + later) == wire.IndexPulse(12, 65_535)
    assert wire.clock_mark(writer.mark(5, 10**18) + later) == wire.ClockMark(0, 5, 10**18, 0.0, "gps")
    setpoint = {"sun_speed_rpm": 624.0, "ring_torque_Nm": -1.5}
    assert wire.test_step(writer.step(65_000, "E_1", "MEASURE", setpoint) + later) == wire.TestStep(
        65_000, "E_1", "MEASURE", setpoint
    )

"""Protobuf wire format: the few messages of layout pmg.v1, read without a protobuf runtime.

A message is a run of fields, each a key (number and wire type) and a value. A packed repeated field of fixed
width is a little-endian array as it stands, so a block of samples is one `numpy.frombuffer`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy.typing as npt

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5

SAMPLE_FIELDS: dict[int, tuple[str, np.dtype[Any], int]] = {
    10: ("f64", np.dtype("<f8"), FIXED64),
    11: ("f32", np.dtype("<f4"), FIXED32),
    12: ("i32", np.dtype("<i4"), FIXED32),
    13: ("u32", np.dtype("<u4"), FIXED32),
    14: ("u64", np.dtype("<u8"), FIXED64),
}
"""Field number of each sample type in SampleBlock: name, array type, wire type of one element."""


class WireError(ValueError):
    """Bytes that are no message of the expected kind."""


def varint(data: bytes, at: int) -> tuple[int, int]:
    """Value of the variable-length integer at a place, and the place after it."""
    value = shift = 0
    while True:
        if at >= len(data):
            raise WireError("the message ends inside an integer")
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at
        shift += 7
        if shift >= 70:
            raise WireError("an integer is longer than ten bytes")


def fields(data: bytes) -> Iterator[tuple[int, int, int | bytes]]:
    """Fields of a message in order: number, wire type, value.

    A fixed-width value is given as its bytes, because only the reader of the message knows whether it is a
    float or an integer.

    Raises
    ------
    WireError
        When the bytes end inside a field or hold a wire type that proto3 does not use.
    """
    at = 0
    while at < len(data):
        key, at = varint(data, at)
        number, kind = key >> 3, key & 7
        if number == 0:
            raise WireError("field number 0 does not exist")
        if kind == VARINT:
            value, at = varint(data, at)
            yield number, kind, value
            continue
        if kind == BYTES:
            length, at = varint(data, at)
        elif kind == FIXED64:
            length = 8
        elif kind == FIXED32:
            length = 4
        else:
            raise WireError(f"field {number} has wire type {kind}, which proto3 does not use")
        if at + length > len(data):
            raise WireError(f"field {number} needs {length} bytes, {len(data) - at} are left")
        yield number, kind, data[at : at + length]
        at += length


@dataclass(frozen=True)
class SampleBlock:
    """Equidistant samples of one channel: index of the first, clock, flags, type name and values."""

    first_sample: int
    clock_id: int
    flags: int
    dtype: str
    values: npt.NDArray[Any]


@dataclass(frozen=True)
class ClockMark:
    """A sample index paired with UTC [ns], its standard uncertainty [ns] and who said so."""

    clock_id: int
    sample: int
    utc_ns: int
    u_ns: float
    source: str


@dataclass(frozen=True)
class IndexPulse:
    """Encoder count latched at the Z channel."""

    sample: int
    count: int


@dataclass(frozen=True)
class LineEvent:
    """Digital inputs after a change, and which of them changed."""

    sample: int
    mask: int
    changed: int


@dataclass(frozen=True)
class TestStep:
    """Step of the test sequence from a sample on; set-points as written, with their unit in the key."""

    __test__ = False  # a message, not a test case

    sample: int
    point: str
    phase: str
    setpoint: Mapping[str, float] = field(default_factory=dict)


def sample_block(data: bytes) -> SampleBlock:
    """The SampleBlock in these bytes.

    A repeated field normally comes as one packed piece. Writers may also split it over several pieces or
    write each element as a field of its own; the pieces are then joined in order.
    """
    plain: dict[int, int] = {1: 0, 2: 0, 3: 0, 4: 0}
    pieces: list[bytes] = []
    used = 0
    for number, kind, value in fields(data):
        if number in SAMPLE_FIELDS:
            name, _, element = SAMPLE_FIELDS[number]
            if kind not in (BYTES, element) or not isinstance(value, bytes):
                raise WireError(f"samples '{name}' have wire type {kind}")
            if used not in (0, number):
                raise WireError(f"samples '{SAMPLE_FIELDS[used][0]}' and '{name}' in one block")
            used = number
            pieces.append(value)
        elif number == 2:
            plain[2] = _unsigned(number, kind, value, FIXED64)
        elif number in (3, 4):
            plain[number] = _unsigned(number, kind, value, VARINT)
    if not used:
        return SampleBlock(plain[2], plain[3], plain[4], "", np.empty(0))
    name, dtype, _ = SAMPLE_FIELDS[used]
    joined = pieces[0] if len(pieces) == 1 else b"".join(pieces)
    if len(joined) % dtype.itemsize:
        raise WireError(f"{len(joined)} bytes are no whole number of '{name}' samples")
    return SampleBlock(plain[2], plain[3], plain[4], name, np.frombuffer(joined, dtype))


def clock_mark(data: bytes) -> ClockMark:
    """The ClockMark in these bytes."""
    clock = sample = utc = 0
    u, source = 0.0, ""
    for number, kind, value in fields(data):
        if number == 1:
            clock = _unsigned(number, kind, value, VARINT)
        elif number == 2:
            sample = _unsigned(number, kind, value, FIXED64)
        elif number == 3:
            utc = _unsigned(number, kind, value, FIXED64)
        elif number == 4:
            u = _double(number, kind, value)
        elif number == 5:
            source = _text(number, kind, value)
    return ClockMark(clock, sample, utc, u, source)


def index_pulse(data: bytes) -> IndexPulse:
    """The IndexPulse in these bytes."""
    sample = count = 0
    for number, kind, value in fields(data):
        if number == 1:
            sample = _unsigned(number, kind, value, FIXED64)
        elif number == 2:
            count = _unsigned(number, kind, value, FIXED32)
    return IndexPulse(sample, count)


def line_event(data: bytes) -> LineEvent:
    """The LineEvent in these bytes."""
    sample = mask = changed = 0
    for number, kind, value in fields(data):
        if number == 1:
            sample = _unsigned(number, kind, value, FIXED64)
        elif number == 2:
            mask = _unsigned(number, kind, value, FIXED32)
        elif number == 3:
            changed = _unsigned(number, kind, value, FIXED32)
    return LineEvent(sample, mask, changed)


def test_step(data: bytes) -> TestStep:
    """The TestStep in these bytes."""
    sample, point, phase = 0, "", ""
    setpoint: dict[str, float] = {}
    for number, kind, value in fields(data):
        if number == 1:
            sample = _unsigned(number, kind, value, FIXED64)
        elif number == 2:
            point = _text(number, kind, value)
        elif number == 3:
            phase = _text(number, kind, value)
        elif number == 4 and isinstance(value, bytes):
            name, amount = _entry(value)
            setpoint[name] = amount
    return TestStep(sample, point, phase, setpoint)


def _unsigned(number: int, kind: int, value: int | bytes, expected: int) -> int:
    if kind != expected:
        raise WireError(f"field {number} has wire type {kind}, the layout says {expected}")
    return value if isinstance(value, int) else int.from_bytes(value, "little")


def _double(number: int, kind: int, value: int | bytes) -> float:
    if kind != FIXED64 or isinstance(value, int):
        raise WireError(f"field {number} has wire type {kind}, the layout says {FIXED64}")
    return float(struct.unpack("<d", value)[0])


def _text(number: int, kind: int, value: int | bytes) -> str:
    if kind != BYTES or isinstance(value, int):
        raise WireError(f"field {number} has wire type {kind}, the layout says {BYTES}")
    try:
        return value.decode("utf-8")
    except UnicodeDecodeError as fault:
        raise WireError(f"field {number} is no UTF-8 text") from fault


def _entry(data: bytes) -> tuple[str, float]:
    name, amount = "", 0.0
    for number, kind, value in fields(data):
        if number == 1:
            name = _text(number, kind, value)
        elif number == 2:
            amount = _double(number, kind, value)
    return name, amount

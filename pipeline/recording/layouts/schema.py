"""The messages of layout pmg.v1 that pmg writes: their fields, a message as bytes, and the schema as a descriptor.

One table of fields serves both: a message is encoded by it, and the descriptor that travels in each file, so that
any MCAP viewer can open it, is the same table written as the messages of ``google/protobuf/descriptor.proto``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pmg.pipeline.recording.layouts.wire import BYTES, FIXED32, FIXED64, VARINT

if TYPE_CHECKING:
    from collections.abc import Mapping

Value: TypeAlias = Any
"""Value of a field: a number, a text, a mapping for a message; a sequence or array of them when repeated."""


@dataclass(frozen=True)
class ScalarType:
    """A protobuf type: its number in a descriptor, its wire type, and its little-endian form if of fixed width."""

    number: int
    wire: int
    form: str = ""


DOUBLE = ScalarType(1, FIXED64, "<d")
FLOAT = ScalarType(2, FIXED32, "<f")
INT64 = ScalarType(3, VARINT)
INT32 = ScalarType(5, VARINT)
FIXED_64 = ScalarType(6, FIXED64, "<Q")
FIXED_32 = ScalarType(7, FIXED32, "<I")
STRING = ScalarType(9, BYTES)
MESSAGE = ScalarType(11, BYTES)
UINT32 = ScalarType(13, VARINT)
ENUM = ScalarType(14, VARINT)
SFIXED_32 = ScalarType(15, FIXED32, "<i")


@dataclass(frozen=True)
class Field:
    """A field of a message.

    Parameters
    ----------
    number : int
        On the wire.
    name : str
        In the schema.
    kind : ScalarType
        Type of the value, or of each element.
    repeated : bool
        Whether it holds any number of elements; those of fixed width are packed.
    message : Message, optional
        The message that it holds, of kind ``MESSAGE``.
    """

    number: int
    name: str
    kind: ScalarType
    repeated: bool = False
    message: Message | None = None


@dataclass(frozen=True)
class Message:
    """A kind of message: package, name, and fields in the order of their numbers."""

    package: str
    name: str
    fields: tuple[Field, ...]

    @property
    def full_name(self) -> str:
        """Name with the package."""
        return f"{self.package}.{self.name}"


# --- layout pmg.v1 -------------------------------------------------------------------------------------

GOOGLE = "google.protobuf"
TIMESTAMP = Message(GOOGLE, "Timestamp", (Field(1, "seconds", INT64), Field(2, "nanos", INT32)))

SAMPLE_BLOCK = Message(
    "pmg.v1",
    "SampleBlock",
    (
        Field(1, "timestamp", MESSAGE, message=TIMESTAMP),
        Field(2, "first_sample", FIXED_64),
        Field(3, "clock_id", UINT32),
        Field(4, "flags", UINT32),
        Field(10, "f64", DOUBLE, repeated=True),
        Field(11, "f32", FLOAT, repeated=True),
        Field(12, "i32", SFIXED_32, repeated=True),
        Field(13, "u32", FIXED_32, repeated=True),
        Field(14, "u64", FIXED_64, repeated=True),
    ),
)
"""Equidistant samples of one channel."""

CLOCK_MARK = Message(
    "pmg.v1",
    "ClockMark",
    (
        Field(1, "clock_id", UINT32),
        Field(2, "sample", FIXED_64),
        Field(3, "utc_ns", FIXED_64),
        Field(4, "u_ns", DOUBLE),
        Field(5, "source", STRING),
    ),
)
"""A sample index paired with UTC."""

TEST_STEP = Message(
    "pmg.v1", "TestStep", (Field(1, "sample", FIXED_64), Field(2, "point", STRING), Field(3, "phase", STRING))
)
"""A phase of the sequence from a sample on; its set-points are not written."""

# --- the part of descriptor.proto that describes them --------------------------------------------------

FIELD_DESCRIPTOR = Message(
    GOOGLE,
    "FieldDescriptorProto",
    (
        Field(1, "name", STRING),
        Field(3, "number", INT32),
        Field(4, "label", ENUM),
        Field(5, "type", ENUM),
        Field(6, "type_name", STRING),
    ),
)
MESSAGE_DESCRIPTOR = Message(
    GOOGLE,
    "DescriptorProto",
    (Field(1, "name", STRING), Field(2, "field", MESSAGE, repeated=True, message=FIELD_DESCRIPTOR)),
)
FILE_DESCRIPTOR = Message(
    GOOGLE,
    "FileDescriptorProto",
    (
        Field(1, "name", STRING),
        Field(2, "package", STRING),
        Field(3, "dependency", STRING, repeated=True),
        Field(4, "message_type", MESSAGE, repeated=True, message=MESSAGE_DESCRIPTOR),
        Field(12, "syntax", STRING),
    ),
)
FILE_SET = Message(GOOGLE, "FileDescriptorSet", (Field(1, "file", MESSAGE, repeated=True, message=FILE_DESCRIPTOR),))
LABEL_OPTIONAL, LABEL_REPEATED = 1, 3
TIMESTAMP_FILE = "google/protobuf/timestamp.proto"
LAYOUT_FILE = "pmg_recording.proto"


def descriptor_set(*more: Message) -> bytes:
    """The schema of the written messages as an encoded FileDescriptorSet, complete with what it imports.

    Parameters
    ----------
    *more : Message
        Written besides blocks of samples and clock marks.
    """
    files = (
        (TIMESTAMP_FILE, (), (TIMESTAMP,)),
        (LAYOUT_FILE, (TIMESTAMP_FILE,), (SAMPLE_BLOCK, CLOCK_MARK, *more)),
    )
    described = [
        {
            "name": name,
            "package": messages[0].package,
            "dependency": imports,
            "message_type": [{"name": m.name, "field": [_described(f) for f in m.fields]} for m in messages],
            "syntax": "proto3",
        }
        for name, imports, messages in files
    ]
    return encode(FILE_SET, {"file": described})


def encode(message: Message, values: Mapping[str, Value]) -> bytes:
    """A message as bytes, the same for the same values.

    Parameters
    ----------
    message : Message
        Its kind.
    values : mapping of str to Value
        Values by field name. As in proto3, a field that is left out reads as zero, and a zero is left out.

    Raises
    ------
    KeyError
        When the message has no field of that name.
    """
    named = {field.name: field for field in message.fields}
    given = sorted(((named[name], value) for name, value in values.items()), key=lambda pair: pair[0].number)
    return b"".join(_field(field, value) for field, value in given)


def _described(field: Field) -> dict[str, Value]:
    """A field as a FieldDescriptorProto."""
    label = LABEL_REPEATED if field.repeated else LABEL_OPTIONAL
    plain = {"name": field.name, "number": field.number, "label": label, "type": field.kind.number}
    return plain if field.message is None else plain | {"type_name": f".{field.message.full_name}"}


def _field(field: Field, value: Value) -> bytes:
    """A field with its key; nothing for a zero that proto3 leaves out."""
    if field.repeated and field.kind.form:
        packed = np.asarray(value).astype(field.kind.form).tobytes()
        return _key(field.number, BYTES) + _varint(len(packed)) + packed if packed else b""
    if field.repeated:
        return b"".join(_element(field, element) for element in value)
    return _element(field, value) if value or field.message is not None else b""


def _element(field: Field, value: Value) -> bytes:
    key = _key(field.number, field.kind.wire)
    if field.kind.wire == VARINT:
        return key + _varint(value)
    if field.kind.form:
        return key + struct.pack(field.kind.form, value)
    data = value.encode("utf-8") if field.message is None else encode(field.message, value)
    return key + _varint(len(data)) + data


def _key(number: int, wire: int) -> bytes:
    return _varint(number << 3 | wire)


def _varint(value: int) -> bytes:
    """Base-128 form of a number from zero on, the low digits first."""
    digits = bytearray()
    while value > 0x7F:
        digits.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*digits, value])

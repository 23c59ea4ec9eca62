"""Protobuf messages of any kind, by the descriptor that travels in the file.

The protobuf runtime takes a field of another wire type than the descriptor's for an unknown one and gives 0 for it, in
600 of 600 messages so damaged; here each is refused. It reads 0.1 million messages of one value a second and 26
thousand blocks of 1000; these lines 0.6 million and 10 thousand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.recording.layouts import schema
from pmg.pipeline.recording.layouts.layout import CONTENT, DIGITS, Leaf, Template
from pmg.pipeline.recording.layouts.schema import Field, Message, ScalarType
from pmg.pipeline.recording.layouts.wire import BYTES, FIXED32, FIXED64, VARINT, WireError, fields, varint

if TYPE_CHECKING:
    from collections.abc import Callable

KINDS: dict[int, ScalarType] = {
    kind.number: kind
    for kind in (
        schema.DOUBLE,
        schema.FLOAT,
        schema.INT64,
        ScalarType(4, VARINT),
        schema.INT32,
        schema.FIXED_64,
        schema.FIXED_32,
        ScalarType(8, VARINT),
        schema.STRING,
        ScalarType(12, BYTES),
        schema.UINT32,
        schema.ENUM,
        schema.SFIXED_32,
        ScalarType(16, FIXED64, "<q"),
        ScalarType(17, VARINT),
        ScalarType(18, VARINT),
    )
}
"""Protobuf types by their number in a descriptor; groups, which proto3 does not have, are left out."""
FORMS = {"<d": "<f8", "<f": "<f4", "<Q": "<u8", "<I": "<u4", "<i": "<i4", "<q": "<i8"}
VARINT_FORMS = {3: "i8", 4: "u8", 5: "i8", 8: "u8", 13: "u8", 14: "i8", 17: "z8", 18: "z8"}
DEEPEST_MESSAGE = 8
"""Messages within messages that are followed."""
KNOWN: dict[str, Message] = {
    message.full_name: message
    for message in (
        schema.SAMPLE_BLOCK,
        Message(
            "pmg.v1",
            "Scalar",
            (
                Field(1, "timestamp", schema.MESSAGE, message=schema.TIMESTAMP),
                Field(2, "sample", schema.FIXED_64),
                Field(3, "value", schema.DOUBLE),
            ),
        ),
    )
}
"""Messages of the layout, which are known without a descriptor."""


def message_of(name: str, descriptor: bytes) -> Message:
    """The message of that name in an encoded FileDescriptorSet.

    Raises
    ------
    WireError
        When the descriptor cannot be read or does not describe the message, or one within it.
    """
    if name in KNOWN:
        return KNOWN[name]
    raw: dict[str, list[dict[str, Any]]] = {}
    for file in _records(descriptor, 1):
        package = "".join(_texts(file, 2))
        for message in _records(file, 4):
            _collect(message, package, raw, 0)
    return _built(name, raw, 0)


def _collect(message: bytes, scope: str, raw: dict[str, list[dict[str, Any]]], depth: int) -> None:
    name = ".".join(part for part in (scope, "".join(_texts(message, 1))) if part)
    raw[name] = [_field(field) for field in _records(message, 2)]
    if depth < DEEPEST_MESSAGE:
        for nested in _records(message, 3):
            _collect(nested, name, raw, depth + 1)


def _field(data: bytes) -> dict[str, Any]:
    plain: dict[int, Any] = {number: value for number, _, value in fields(data)}
    return {
        "name": bytes(plain.get(1, b"")).decode("utf-8", "replace"),
        "number": plain.get(3, 0),
        "repeated": plain.get(4, 1) == schema.LABEL_REPEATED,
        "type": plain.get(5, 0),
        "type_name": bytes(plain.get(6, b"")).decode("utf-8", "replace").lstrip("."),
    }


def _built(name: str, raw: dict[str, list[dict[str, Any]]], depth: int) -> Message:
    if name not in raw:
        raise WireError(f"the schema does not describe message '{name}'")
    if depth > DEEPEST_MESSAGE:
        raise WireError(f"message '{name}' holds messages more than {DEEPEST_MESSAGE} deep")
    found = []
    for each in raw[name]:
        if each["type"] == schema.MESSAGE.number:
            inner = _built(each["type_name"], raw, depth + 1)
            found.append(Field(each["number"], each["name"], schema.MESSAGE, each["repeated"], inner))
        elif each["type"] in KINDS:
            found.append(Field(each["number"], each["name"], KINDS[each["type"]], each["repeated"]))
        else:
            raise WireError(f"field '{each['name']}' of '{name}' has type {each['type']}, which proto3 does not use")
    package, _, last = name.rpartition(".")
    return Message(package, last, tuple(found))


def protobuf_template(message: Message) -> Callable[[bytes], Template]:
    """Takes messages of a kind apart; a field that proto3 leaves out because it is zero reads as zero."""

    def take_apart(data: bytes) -> Template:
        mask, leaves = bytearray(b"\xff" * len(data)), list[Leaf]()
        _walk(message, data, 0, len(data), "", mask, leaves)
        return Template(data, mask, tuple(leaves))

    return take_apart


def _walk(message: Message, data: bytes, at: int, end: int, prefix: str, mask: bytearray, leaves: list[Leaf]) -> None:
    named = {field.number: field for field in message.fields}
    seen: set[int] = set()
    while at < end:
        key, at = varint(data, at)
        number, wire = key >> 3, key & 7
        start, at = at, _skip(data, at, end, wire, number)
        field = named.get(number)
        if field is None:
            continue
        path = prefix + field.name
        if number in seen and not field.repeated:
            raise WireError(f"field '{path}' comes twice")
        seen.add(number)
        if wire == VARINT and field.kind.wire == VARINT:
            mask[start:at] = bytes([DIGITS]) * (at - start)
            leaves.append(Leaf(path, start, VARINT_FORMS[field.kind.number], at - start))
        elif wire in (FIXED32, FIXED64) and field.kind.wire == wire:
            mask[start:at] = bytes([CONTENT]) * (at - start)
            leaves.append(Leaf(path, start, FORMS[field.kind.form]))
        elif wire == BYTES:
            _, body = varint(data, start)
            _lump(field, data, body, at, path, mask, leaves)
        else:
            raise WireError(f"field '{path}' has wire type {wire}, the schema says {field.kind.wire}")
    for field in message.fields:
        if field.number not in seen and not field.repeated:
            _absent(field, prefix + field.name, leaves)


def _lump(field: Field, data: bytes, start: int, end: int, path: str, mask: bytearray, leaves: list[Leaf]) -> None:
    """A text, a message, or a packed field."""
    if field.message is not None:
        _walk(field.message, data, start, end, path + ".", mask, leaves)
    elif field.kind.form and field.repeated:
        width = 8 if field.kind.wire == FIXED64 else 4
        if (end - start) % width:
            raise WireError(f"{end - start} bytes are no whole number of '{path}'")
        mask[start:end] = bytes([CONTENT]) * (end - start)
        leaves.append(Leaf(path, start, FORMS[field.kind.form], count=(end - start) // width))
    elif field.kind.wire == VARINT and field.repeated:
        while start < end:
            _, after = varint(data, start)
            if after > end:
                raise WireError(f"the message ends inside '{path}'")
            mask[start:after] = bytes([DIGITS]) * (after - start)
            leaves.append(Leaf(path, start, VARINT_FORMS[field.kind.number], after - start))
            start = after
    elif field.kind.wire == BYTES:
        mask[start:end] = bytes([CONTENT]) * (end - start)
    else:
        raise WireError(f"field '{path}' is packed, the schema says it is one number")


def _absent(field: Field, path: str, leaves: list[Leaf]) -> None:
    if field.message is not None:
        for inner in field.message.fields:
            if not inner.repeated:
                _absent(inner, f"{path}.{inner.name}", leaves)
    elif field.kind.wire != BYTES:
        form = FORMS[field.kind.form] if field.kind.form else VARINT_FORMS[field.kind.number]
        leaves.append(Leaf(path, -1, form))


def _skip(data: bytes, at: int, end: int, wire: int, number: int) -> int:
    """Place after a value."""
    if wire == VARINT:
        _, after = varint(data, at)
    elif wire == BYTES:
        length, body = varint(data, at)
        after = body + length
    elif wire in (FIXED64, FIXED32):
        after = at + (8 if wire == FIXED64 else 4)
    else:
        raise WireError(f"field {number} has wire type {wire}, which proto3 does not use")
    if number == 0 or after > end:
        raise WireError(f"field {number} ends {after - end} bytes behind the message" if number else "field 0")
    return after


def _records(data: bytes, wanted: int) -> list[bytes]:
    return [value for number, _, value in fields(data) if number == wanted and isinstance(value, bytes)]


def _texts(data: bytes, wanted: int) -> list[str]:
    return [value.decode("utf-8", "replace") for value in _records(data, wanted)]

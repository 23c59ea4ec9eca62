"""Records of an MCAP file as their bytes say: the head of each, and the fields of each kind by one table."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time [ns] before the payload of a message."""

PRIVATE = 0x80
"""Operation codes from here on are the writers' own; those below that the format does not name are reserved."""


class Op(IntEnum):
    """Operation codes of the format."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


LAYOUT: dict[int, str] = {
    Op.HEADER: "ss",
    Op.FOOTER: "884",
    Op.SCHEMA: "2ssb",
    Op.CHANNEL: "22ssm",
    Op.MESSAGE: "2488*",
    Op.CHUNK: "8884sB",
    Op.MESSAGE_INDEX: "2b",
    Op.CHUNK_INDEX: "8888b8s88",
    Op.ATTACHMENT: "88ssB4",
    Op.ATTACHMENT_INDEX: "88888ss",
    Op.STATISTICS: "82444488b",
    Op.METADATA: "sm",
    Op.METADATA_INDEX: "88s",
    Op.SUMMARY_OFFSET: "188",
    Op.DATA_END: "4",
}
"""Fields of each kind of record: a digit is an unsigned number of so many bytes, ``s`` text, ``m`` texts by name,
``b`` and ``B`` bytes after a length of 4 or 8 bytes, ``*`` the rest."""


class RecordError(ValueError):
    """Bytes that are no record of their kind."""


@dataclass(frozen=True)
class Frame:
    """A record as its head declares it: place of the head, operation code, and place after the body [bytes]."""

    at: int
    opcode: int
    end: int

    @property
    def body(self) -> int:
        """Place of the body."""
        return self.at + HEAD.size


@dataclass(frozen=True)
class Schema:
    """Layout of the messages of some channels."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class ChannelRecord:
    """A stream of messages under one topic."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: Mapping[str, str]


@dataclass(frozen=True)
class Attachment:
    """A file within the file; times in ns, `crc` as declared and 0 when the writer gave none."""

    log_time: int
    create_time: int
    name: str
    media_type: str
    data: bytes
    crc: int


def parse(opcode: int, body: bytes) -> tuple[list[Any], int]:
    """Fields of a record and the place after the last known one; what follows it is padding.

    Raises
    ------
    RecordError
        When the body ends inside a field, or a text is no UTF-8.
    """
    values: list[Any] = []
    at = 0
    for form in LAYOUT[opcode]:
        if form == "*":
            values.append(body[at:])
            at = len(body)
        elif form in "sbmB":
            length, at = _number(body, at, 8 if form == "B" else 4)
            values.append(_shaped(form, _cut(body, at, length)))
            at += length
        else:
            value, at = _number(body, at, int(form))
            values.append(value)
    return values, at


def _shaped(form: str, data: bytes) -> Any:  # noqa: ANN401 (text, texts or bytes, as the form says)
    return _text(data) if form == "s" else _texts(data) if form == "m" else data


def _number(body: bytes, at: int, width: int) -> tuple[int, int]:
    return int.from_bytes(_cut(body, at, width), "little"), at + width


def _cut(body: bytes, at: int, length: int) -> bytes:
    if at + length > len(body):
        raise RecordError(f"a field of {length} bytes begins {len(body) - at} bytes before the end")
    return body[at : at + length]


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as fault:
        raise RecordError("a text is no UTF-8") from fault


def _texts(data: bytes) -> dict[str, str]:
    found, at = {}, 0
    while at < len(data):
        pair = []
        for _ in range(2):
            length, at = _number(data, at, 4)
            pair.append(_text(_cut(data, at, length)))
            at += length
        found[pair[0]] = pair[1]
    return found

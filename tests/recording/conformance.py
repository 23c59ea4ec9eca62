"""The conformance suite of MCAP, made anew from its descriptions: each variant as bytes, and what a reader owes.

The descriptions (`tests/data/mcap_variants.jsonl.gz`) name the records of each variant field by field, its features
and the SHA-256 of the file. What they leave out follows from the format: lengths, chunks and their CRC, message
indexes, and the three bytes after the known fields of a record in the variants with padding.
"""

from __future__ import annotations

import gzip
import json
import struct
import zlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

VARIANTS = Path(__file__).resolve().parent.parent / "data" / "mcap_variants.jsonl.gz"
MAGIC = b"\x89MCAP0\r\n"
PADDING = b"\x01\xff\xff"
NUMBER = {"u8": "<B", "u16": "<H", "u32": "<I", "u64": "<Q"}

LAYOUT: dict[str, tuple[int, str]] = {
    "Header": (0x01, "str profile, str library"),
    "Footer": (0x02, "u64 summary_start, u64 summary_offset_start, u32 summary_crc"),
    "Schema": (0x03, "u16 id, str name, str encoding, bytes32 data"),
    "Channel": (0x04, "u16 id, u16 schema_id, str topic, str message_encoding, texts metadata"),
    "Message": (0x05, "u16 channel_id, u32 sequence, u64 log_time, u64 publish_time, rest data"),
    "ChunkIndex": (
        0x08,
        "u64 message_start_time, u64 message_end_time, u64 chunk_start_offset, u64 chunk_length, "
        "offsets message_index_offsets, u64 message_index_length, str compression, u64 compressed_size, "
        "u64 uncompressed_size",
    ),
    "Attachment": (0x09, "u64 log_time, u64 create_time, str name, str media_type, bytes64 data"),
    "AttachmentIndex": (
        0x0A,
        "u64 offset, u64 length, u64 log_time, u64 create_time, u64 data_size, str name, str media_type",
    ),
    "Statistics": (
        0x0B,
        "u64 message_count, u16 schema_count, u32 channel_count, u32 attachment_count, u32 metadata_count, "
        "u32 chunk_count, u64 message_start_time, u64 message_end_time, offsets channel_message_counts",
    ),
    "Metadata": (0x0C, "str name, texts metadata"),
    "MetadataIndex": (0x0D, "u64 offset, u64 length, str name"),
    "SummaryOffset": (0x0E, "u8 group_opcode, u64 group_start, u64 group_length"),
    "DataEnd": (0x0F, "u32 data_section_crc"),
}
"""Operation code of each record and its fields in the order of the format."""

CHUNKED = ("Schema", "Channel", "Message")
UNPADDED = ("Message", "DataEnd", "Footer")


@dataclass(frozen=True)
class Variant:
    """A variant of the suite.

    Parameters
    ----------
    name, sha256 : str
        As the suite names it, and the hash of its file.
    records : tuple of (str, dict)
        Type and fields of each record, in file order; numbers as decimal text.
    features : frozenset of str
        ``ch`` chunked, ``mx`` with message index, ``pad`` with bytes after the known fields, and others that show in
        the records.
    """

    name: str
    sha256: str
    records: tuple[tuple[str, dict[str, Any]], ...]
    features: frozenset[str]

    def of(self, kind: str) -> list[dict[str, Any]]:
        """Fields of the records of a type before the end of the data section."""
        found = []
        for name, fields in self.records:
            if name == "DataEnd":
                break
            if name == kind:
                found.append(fields)
        return found


@cache
def variants() -> tuple[Variant, ...]:
    """All variants of the suite."""
    with gzip.open(VARIANTS, "rt", encoding="utf-8") as lines:
        plain = [json.loads(line) for line in lines]
    return tuple(
        Variant(
            entry["name"],
            entry["sha256"],
            tuple((record["type"], dict(record["fields"])) for record in entry["records"]),
            frozenset(entry["features"]),
        )
        for entry in plain
    )


def build(variant: Variant) -> bytes:
    """The file of a variant."""
    padding = PADDING if "pad" in variant.features else b""
    out = bytearray(MAGIC)
    chunked: list[tuple[str, dict[str, Any]]] = []
    data_ended = False
    for kind, fields in variant.records:
        if kind == "DataEnd":
            data_ended = True
            out += _chunk(chunked, "mx" in variant.features, padding) if chunked else b""
        if "ch" in variant.features and kind in CHUNKED and not data_ended:
            chunked.append((kind, fields))
        else:
            out += record(kind, fields, b"" if kind in UNPADDED else padding)
    return bytes(out) + MAGIC


def record(kind: str, fields: dict[str, Any], padding: bytes = b"") -> bytes:
    """A record with its head."""
    opcode, layout = LAYOUT[kind]
    body = b"".join(_field(entry, fields) for entry in layout.split(", "))
    if kind == "Attachment":
        body += struct.pack("<I", zlib.crc32(body))
    return framed(opcode, body + padding)


def framed(opcode: int, body: bytes) -> bytes:
    """Operation code, length and body."""
    return struct.pack("<BQ", opcode, len(body)) + body


def _chunk(records: list[tuple[str, dict[str, Any]]], indexed: bool, padding: bytes) -> bytes:
    """An uncompressed chunk, and an index of the messages of each channel if there is to be one."""
    data = bytearray()
    places: dict[int, list[tuple[int, int]]] = {}
    for kind, fields in records:
        if kind == "Message":
            places.setdefault(int(fields["channel_id"]), []).append((int(fields["log_time"]), len(data)))
        data += record(kind, fields)
    times = [time for entries in places.values() for time, _ in entries] or [0]
    head = struct.pack("<QQQIIQ", min(times), max(times), len(data), zlib.crc32(data), 0, len(data))
    out = framed(0x06, head + data)
    if indexed:
        for channel, entries in places.items():
            body = b"".join(struct.pack("<QQ", *entry) for entry in entries)
            out += framed(0x07, struct.pack("<HI", channel, len(body)) + body + padding)
    return out


def _field(entry: str, fields: dict[str, Any]) -> bytes:
    form, name = entry.split()
    value = fields[name]
    if form == "str":
        return _text(value)
    if form == "texts":
        body = b"".join(_text(key) + _text(entry) for key, entry in value.items())
        return struct.pack("<I", len(body)) + body
    if form == "offsets":
        body = b"".join(struct.pack("<HQ", int(key), int(entry)) for key, entry in value.items())
        return struct.pack("<I", len(body)) + body
    if form in ("rest", "bytes32", "bytes64"):
        data = octets(value)
        length = {"rest": b"", "bytes32": struct.pack("<I", len(data)), "bytes64": struct.pack("<Q", len(data))}
        return length[form] + data
    return struct.pack(NUMBER[form], int(value))


def octets(values: list[str]) -> bytes:
    """Bytes that a description lists as numbers."""
    return bytes(int(value) for value in values)


def _text(value: str) -> bytes:
    data = value.encode("utf-8")
    return struct.pack("<I", len(data)) + data

"""Faults of the container: cuts, CRCs, lengths, indexes, codes, identifiers, schemas, times and attachments."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace

from tests.grid.checked_campaign import NEUTRAL, Runs
from tests.recording.conformance import framed
from tests.recording.damages import ATTACHMENT, CONTAINER, DATA_END, HEAD, OTHERS, base, of_kind, put
from tests.recording.writer import CALIBRATION, RUN, Other

from .case import Case, Desk
from .signals import SUN

CHANNEL, SCHEMA, METADATA, MESSAGE = 4, 3, 12, 5


def text(words: str | bytes) -> bytes:
    """A text of a record: its length, and itself."""
    data = words if isinstance(words, bytes) else words.encode()
    return struct.pack("<I", len(data)) + data


def texts(entries: dict[str, str]) -> bytes:
    """Names and values of a record."""
    return text(b"".join(text(name) + text(value) for name, value in entries.items()))


def channel(number: int, schema: int, topic: str, encoding: str = "protobuf", **metadata: str) -> bytes:
    """Record of a channel."""
    return framed(CHANNEL, struct.pack("<HH", number, schema) + text(topic) + text(encoding) + texts(metadata))


def message(number: int, data: bytes, logged: int = 0) -> bytes:
    """Record of a message."""
    return framed(MESSAGE, struct.pack("<HIQQ", number, 0, logged, logged) + data)


def attachment(name: str, data: bytes) -> bytes:
    """Record of an attachment without CRC."""
    return framed(
        ATTACHMENT, bytes(16) + text(name) + text("text/plain") + struct.pack("<Q", len(data)) + data + bytes(4)
    )


def metadata(name: str, **entries: str) -> bytes:
    """Record of metadata."""
    return framed(METADATA, text(name) + texts(entries))


def before_end(*records: bytes) -> bytes:
    """The recording with more records before the end of its data."""
    data = base()
    ((at, _),) = of_kind(data, DATA_END)
    return data[:at] + b"".join(records) + data[at:]


def at_start(*records: bytes) -> bytes:
    """The recording with more records behind its head."""
    data = base()
    at = HEAD + 8 + int.from_bytes(data[9:17], "little")
    return data[:at] + b"".join(records) + data[at:]


def _unproven() -> bytes:
    """The calibration with another digit, and no CRC over it."""
    data = base()
    ((at, end),) = of_kind(data, ATTACHMENT)
    changed = data[at:end].replace(b"10003.2", b"10013.2", 1)
    return put(data, at, changed[:-4] + bytes(4))


def _changed_digit() -> bytes:
    """The same, and the CRC as it was."""
    data = base()
    ((at, end),) = of_kind(data, ATTACHMENT)
    return put(data, at, data[at:end].replace(b"10003.2", b"10013.2", 1))


def _times(values: Callable[[int], int]) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        one = runs[NEUTRAL]
        steps = {f"/notes/{k}": Other("json", ("note", "jsonschema", b"{}"), [b"{}"]) for k in range(3)}
        runs[NEUTRAL] = replace(one, host=(values(0), values(1)), other=steps)

    return plant


def _other(
    encoding: str, schema: tuple[str, str, bytes], *messages: bytes, topic: str = "/test/step"
) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        runs[NEUTRAL] = replace(runs[NEUTRAL], other={topic: Other(encoding, schema, messages)})

    return plant


JSON = ("step", "jsonschema", b"{}")
FIRST = struct.pack("<H", 1)

MADE: tuple[tuple[str, Callable[[], bytes]], ...] = (
    ("a chunk of length 0", lambda: before_end(framed(6, b""))),
    ("a chunk of 40 zero bytes", lambda: before_end(framed(6, bytes(40)))),
    ("a thousand empty chunks", lambda: before_end(*[framed(6, bytes(40))] * 1000)),
    ("a message without a channel", lambda: before_end(message(999, b"?"))),
    ("a message of length 0", lambda: before_end(message(1, b""))),
    ("a message later than all time", lambda: before_end(message(1, b"", 2**64 - 1))),
    ("two channels of one number", lambda: at_start(channel(1, 1, "/daq/torque_ring/frequency"))),
    ("two channels of one topic", lambda: at_start(channel(999, 1, SUN))),
    ("a channel of a schema that is not there", lambda: at_start(channel(999, 998, "/x"))),
    (
        "two schemas of one number",
        lambda: at_start(framed(SCHEMA, FIRST + text("pmg.v1.Lie") + text("protobuf") + text(b"\xff" * 9))),
    ),
    ("a schema of number 0", lambda: at_start(framed(SCHEMA, bytes(2) + text("a") + text("b") + text("c")))),
    ("a topic of a megabyte", lambda: at_start(channel(999, 0, "/" + "x" * 2**20))),
    ("metadata of a megabyte", lambda: before_end(metadata("notes", text="x" * 2**20))),
    ("a run twice, with other entries", lambda: before_end(metadata("pmg.run", **RUN | {"point": "P2", "gear": "2"}))),
    (
        "a second calibration that differs",
        lambda: before_end(attachment("calibration.toml", CALIBRATION.replace("5.0", "9.0").encode())),
    ),
    ("a calibration of 2 MB of comments", lambda: before_end(attachment("calibration.toml", b"#" * 2**21))),
    ("an attachment named ../../calibration.toml", lambda: before_end(attachment("../../calibration.toml", b"x"))),
    ("a thousand attachments", lambda: before_end(*(attachment(f"{k}.txt", b"x") for k in range(1000)))),
    ("digit of the calibration changed, CRC kept", _changed_digit),
    ("digit of the calibration changed, no CRC", _unproven),
)

PLANTED: tuple[tuple[str, Callable[[Runs], object]], ...] = (
    ("log times that run backwards", _times(lambda k: (10**18, -1000)[k])),
    ("log times all the same", _times(lambda k: (10**18, 0)[k])),
    ("steps as JSON nested 100,000 deep", _other("json", JSON, b"[" * 100_000 + b"]" * 100_000)),
    (
        "steps as JSON with a number of 5000 digits",
        _other("json", JSON, b'{"sample": ' + b"7" * 5000 + b', "point": "P"}'),
    ),
    (
        "steps as JSON with a key twice",
        _other("json", JSON, b'{"sample": 1, "sample": 900, "point": "Q", "phase": "START"}'),
    ),
    ("steps as JSON that is cut", _other("json", JSON, b'{"sample": 1, "poi')),
    ("steps as JSON in UTF-16", _other("json", JSON, json.dumps({"sample": 1, "point": "Q"}).encode("utf-16"))),
    ("steps in an encoding that nobody knows", _other("avro", JSON, b"\0\1")),
    ("steps whose schema says blocks", _other("protobuf", ("pmg.v1.SampleBlock", "protobuf", b""), b"\x09" + bytes(8))),
    (
        "torque as CDR with a schema that recurs",
        _other("cdr", ("a/B", "ros2msg", b"a/B again"), b"\0\1\0\0" + bytes(40), topic=SUN),
    ),
    (
        "torque as CDR with an array of 2^31",
        _other("cdr", ("a/B", "ros2msg", b"float64[2147483647] f64"), b"\0\1\0\0" + bytes(40), topic=SUN),
    ),
)


def _spoilt(make: Callable[[], bytes]) -> Callable[[Desk], object]:
    return lambda desk: (desk.recordings / NEUTRAL).write_bytes(make())


CASES = (
    *(Case("container", what, spoil=_spoilt(make), small=True, whole=whole()) for what, make, whole in CONTAINER),
    *(Case("container", what, spoil=_spoilt(make), small=True, whole=base()) for what, make in MADE),
    *(Case("container", what, plant, small=True) for what, plant in PLANTED),
    *(
        Case("container", what, spoil=_spoilt(make), small=True, whole=base())
        for kind, what, make in OTHERS
        if kind == "encoding"
    ),
)

"""Messages in other layouts for tests: an encoder of CDR, and the channels of a bench in JSON, CDR and protobuf."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy.typing as npt

from .writer import COUNTS_PER_REV, Bench, Other, block, key, lump, tracks, varint

SIZES = {"bool": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4, "int64": 8, "uint64": 8}
SIZES |= {"float32": 4, "float64": 8}
FORMS = {"bool": "?", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"}
FORMS |= {"int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}
BORDER = "=" * 80
FLOAT64 = "# a number\nfloat64 data\n"
STAMPED = f"""std_msgs/Header header
float64 value
{BORDER}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{BORDER}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
SCAN = f"""uint8 VERSION=1
builtin_interfaces/Time stamp
string<=20 device "daq"
float64[] torque_sun_frequency
float64[] torque_ring_frequency
int64[] encoder_sun_count
uint32[<=100] encoder_ring_count
{BORDER}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
STAMPED_IDL = f"""{BORDER}
IDL: bench_msgs/msg/Reading
// generated
#include "std_msgs/msg/Header.idl"
module bench_msgs {{
  module msg {{
    const double UNUSED = 1.5;
    typedef double double__3[3];
    @verbatim (language="comment", text="a reading; with its time")
    struct Reading {{
      std_msgs::msg::Header header;
      double__3 spare;
      @unit (value="Hz")
      double value;
    }};
  }};
}};
{BORDER}
IDL: std_msgs/msg/Header
module std_msgs {{ module msg {{ struct Header {{ builtin_interfaces::msg::Time stamp; string frame_id; }}; }}; }};
{BORDER}
IDL: builtin_interfaces/msg/Time
module builtin_interfaces {{ module msg {{ struct Time {{ long sec; unsigned long nanosec; }}; }}; }};
"""

Definition = Sequence[tuple[str, Any, int | None]]
"""Fields of a message: name, primitive or definition, elements (None one, 0 a sequence)."""


def cdr(definition: Definition, values: Mapping[str, Any], order: str = "<", largest: int = 8) -> bytes:
    """A message in CDR."""
    body = bytearray()
    kind = {("<", 8): 1, (">", 8): 0, ("<", 4): 7, (">", 4): 6}[order, largest]

    def align(width: int) -> None:
        body.extend(b"\x00" * (-len(body) % min(width, largest)))

    def number(form: str, value: float) -> None:
        align(struct.calcsize("=" + form))
        body.extend(struct.pack(order + form, value))

    def put(what: Any, value: Any) -> None:  # noqa: ANN401 (a primitive or fields)
        if what == "string":
            text = value.encode() + b"\x00"
            number("I", len(text))
            body.extend(text)
        elif isinstance(what, str):
            number(FORMS[what], value)
        else:
            for name, inner, many in what:
                if many is None:
                    put(inner, value[name])
                else:
                    if many == 0:
                        number("I", len(value[name]))
                    for element in value[name]:
                        put(inner, element)

    put(definition, values)
    return bytes([0, kind, 0, 0]) + bytes(body)


TIME: Definition = [("sec", "int32", None), ("nanosec", "uint32", None)]
HEADER: Definition = [("stamp", TIME, None), ("frame_id", "string", None)]
START_NS = 1_745_395_200_250_000_000


def stamp(at: float, start_ns: int = START_NS) -> dict[str, int]:
    """A time after the start."""
    whole = start_ns + round(at * 1e9)
    return {"sec": whole // 10**9, "nanosec": whole % 10**9}


def per_sample(bench: Bench, encoding: str, start_ns: int = START_NS, declared: bool = True) -> dict[str, Other]:
    """The sampled channels of a bench, one sample a message."""
    found = {}
    for topic, (metadata, values) in tracks(bench).items():
        kept = metadata if declared else {name: text for name, text in metadata.items() if name != "rate_hz"}
        found[topic] = single(values, bench.first_sample, bench.rate_hz, encoding, kept, start_ns)
    return found


def single(
    values: npt.NDArray[Any],
    first: int,
    rate_hz: float,
    encoding: str,
    metadata: Mapping[str, str],
    start_ns: int = START_NS,
) -> Other:
    """Samples of one channel, each a message in ``json``, ``cdr``, ``scalar`` or, of its own layout, ``block``."""
    plain = values.tolist()
    kept = {name: metadata[name] for name in ("counts_per_rev", "bits", "rate_hz") if name in metadata}
    if encoding == "json":
        made = [json.dumps({"sample": first + k, "value": v}).encode() for k, v in enumerate(plain)]
        return Other("json", ("bench.Reading", "jsonschema", b'{"type": "object"}'), made, kept)
    if encoding == "cdr":
        wanted: Definition = [("header", HEADER, None), ("value", "float64", None)]
        made = [
            cdr(wanted, {"header": {"stamp": stamp(k / rate_hz, start_ns), "frame_id": "daq"}, "value": v})
            for k, v in enumerate(plain)
        ]
        return Other("cdr", ("bench_msgs/msg/Reading", "ros2msg", STAMPED.encode()), made, kept)
    if encoding == "scalar":
        made = [scalar(first + k, float(v)) for k, v in enumerate(plain)]
        return Other("protobuf", ("pmg.v1.Scalar", "protobuf", b""), made, kept)
    made = [block(first + k, metadata["dtype"], values[k : k + 1]) for k in range(len(values))]
    return Other("protobuf", ("pmg.v1.SampleBlock", "protobuf", b""), made, metadata)


def scalar(sample: int, value: float) -> bytes:
    """Scalar of the layout; zeros are left out, as proto3 does."""
    head = lump(1, key(1, 0) + varint(1_745_000_000 + sample % 1000) + key(2, 0) + varint(sample * 977 % 10**9))
    head += key(2, 1) + struct.pack("<Q", sample) if sample else b""
    return head + (key(3, 1) + struct.pack("<d", value) if value else b"")


def scan(bench: Bench, encoding: str, many: int = 50) -> dict[str, Other]:
    """All sampled channels of a bench in one topic, many samples a message."""
    columns = {topic.removeprefix("/daq/").replace("/", "_"): v for topic, (_, v) in tracks(bench).items()}
    size = len(next(iter(columns.values())))
    made = []
    for start in range(0, size, many):
        part = {name: values[start : start + many].tolist() for name, values in columns.items()}
        if encoding == "json":
            made.append(json.dumps({"first_sample": bench.first_sample + start} | part).encode())
        else:
            wanted: Definition = [
                ("stamp", TIME, None),
                ("device", "string", None),
                ("torque_sun_frequency", "float64", 0),
                ("torque_ring_frequency", "float64", 0),
                ("encoder_sun_count", "int64", 0),
                ("encoder_ring_count", "uint32", 0),
            ]
            made.append(cdr(wanted, {"stamp": stamp(start / bench.rate_hz), "device": "daq"} | part))
    metadata = {"rate_hz": f"{bench.rate_hz:g}", "bits": str(bench.bits), "counts_per_rev": str(COUNTS_PER_REV)}
    schema = ("bench_msgs/msg/Scan", "ros2msg", SCAN.encode()) if encoding == "cdr" else ("Scan", "jsonschema", b"{}")
    return {"/daq/scan": Other(encoding, schema, made, metadata)}

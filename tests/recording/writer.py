"""Recordings for tests: a bench with known torque and speed, written by its own encoder of layout pmg.v1."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

RPM = math.pi / 30.0
COUNTS_PER_REV = 5120
TIMEBASE_HZ = 100_000_000
BLOCK = 100
LIVE_HZ = 2e-3
"""Amplitude of the frequency's noise [Hz]; single precision shows it."""
LEAD = 0.01
"""Time before the first sample from which the edges are counted [s]."""
NULL_HZ = {"sun": 10_003.2, "ring": 9_996.9}
NOMINAL = {"sun": 5.0, "ring": 10.0}
SPAN_HZ = {"sun": 5_000.0, "ring": -4_900.0}
FIELDS = {"f64": (10, "<f8"), "f32": (11, "<f4"), "i32": (12, "<i4"), "u32": (13, "<u4"), "u64": (14, "<u8")}

CALIBRATION = "".join(
    f"[transducer.{side}]\nnull_frequency_Hz = {NULL_HZ[side]}\nnominal_torque_Nm = {NOMINAL[side]}\n"
    f'span_Hz = {SPAN_HZ[side]}\nserial = "T-{side}"\n[encoder.{side}]\ncounts_per_rev = {COUNTS_PER_REV}\n'
    for side in ("sun", "ring")
)

RUN = {
    "layout": "pmg.v1",
    "campaign": "made",
    "point": "P1",
    "configuration": "neutral",
    "gear": "1",
    "started_at": "2025-04-23T08:00:00.250000Z",
    "drive": "sun",
}


@dataclass(frozen=True)
class Other:
    """A topic in another layout: message encoding, schema (name, encoding, text), metadata and messages."""

    encoding: str
    schema: tuple[str, str, bytes]
    messages: Sequence[bytes]
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Bench:
    """One run: what the shafts do and how it is recorded.

    Speeds in rpm, torques in N m, ripple in N m of a sine of `ripple_hz`. `drop` names sample ranges that a topic
    lacks, `raw` the messages of a topic instead of its own, `flags` the flags of a topic's blocks by number,
    `channel` and `run` metadata to change (None removes), `other` topics in another layout instead of their own,
    `index` the pulses of a side, `spoil` what is done to a topic's samples before they are written. `host` is the log
    time of the first block of each topic, and that from one block to the next [ns].
    """

    seconds: float = 2.0
    rate_hz: float = 500.0
    speed: Mapping[str, float] = field(default_factory=lambda: {"sun": 600.0, "ring": -230.0})
    acceleration: float = 0.0
    torque: Mapping[str, float] = field(default_factory=lambda: {"sun": 0.8, "ring": -1.5})
    torque_slope: float = 0.0
    ripple: float = 0.0
    ripple_hz: float = 7.3
    encoding: str = "f64"
    bits: int = 32
    start_count: Mapping[str, int] = field(default_factory=dict)
    start_edges: int = 0
    start_ticks: int = 0
    timebase_error: float = 0.0
    silent_from: float = math.inf
    first_sample: int = 0
    run: Mapping[str, str | None] = field(default_factory=dict)
    calibration: str | None = CALIBRATION
    channel: Mapping[str, Mapping[str, str | None]] = field(default_factory=dict)
    without: frozenset[str] = frozenset()
    drop: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    flags: Mapping[str, Mapping[int, int]] = field(default_factory=dict)
    lines: tuple[int, int] | None = None
    events: Sequence[tuple[int, int, int]] = ()
    steps: Sequence[tuple[int, str, str, Mapping[str, float]]] = ()
    marks: Sequence[tuple[int, int]] = ()
    index_slip: int = 0
    with_index: bool = False
    extra: Mapping[str, bytes] = field(default_factory=dict)
    raw: Mapping[str, Sequence[bytes]] = field(default_factory=dict)
    other: Mapping[str, Other] = field(default_factory=dict)
    index: Mapping[str, Sequence[tuple[int, int]]] = field(default_factory=dict)
    spoil: Mapping[str, Callable[[npt.NDArray[Any]], npt.NDArray[Any]]] = field(default_factory=dict)
    compression: CompressionType = CompressionType.ZSTD
    crc: bool = True
    host: tuple[int, int] = (0, 7)


def same(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The samples as they are."""
    return values


def wraps(bits: int) -> Callable[[npt.NDArray[Any]], npt.NDArray[Any]]:
    """What a counter of that width shows."""
    return lambda values: values % 2**bits


def varint(value: int) -> bytes:
    """Base-128 form."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def key(number: int, kind: int) -> bytes:
    """Tag of a field."""
    return varint(number << 3 | kind)


def lump(number: int, data: bytes) -> bytes:
    """Field of a length and that many bytes."""
    return key(number, 2) + varint(len(data)) + data


def block(first: int, dtype: str, values: npt.NDArray[Any], *, flags: int = 0, clock: int = 0) -> bytes:
    """SampleBlock, its samples packed."""
    number, form = FIELDS[dtype]
    head = lump(1, key(1, 0) + varint(1_745_000_000)) + key(2, 1) + struct.pack("<Q", first)
    head += (key(3, 0) + varint(clock)) * bool(clock) + (key(4, 0) + varint(flags)) * bool(flags)
    return head + lump(number, values.astype(form).tobytes())


def step(sample: int, point: str, phase: str, setpoint: Mapping[str, float]) -> bytes:
    """TestStep."""
    entries = b"".join(
        lump(4, lump(1, name.encode()) + key(2, 1) + struct.pack("<d", value)) for name, value in setpoint.items()
    )
    return key(1, 1) + struct.pack("<Q", sample) + lump(2, point.encode()) + lump(3, phase.encode()) + entries


def event(sample: int, mask: int, changed: int) -> bytes:
    """LineEvent."""
    return (
        key(1, 1)
        + struct.pack("<Q", sample)
        + key(2, 5)
        + struct.pack("<I", mask)
        + key(3, 5)
        + struct.pack("<I", changed)
    )


def mark(sample: int, utc_ns: int) -> bytes:
    """ClockMark of the shared clock."""
    return key(2, 1) + struct.pack("<Q", sample) + key(3, 1) + struct.pack("<Q", utc_ns) + lump(5, b"gps")


def pulse(sample: int, count: int) -> bytes:
    """IndexPulse."""
    return key(1, 1) + struct.pack("<Q", sample) + key(2, 5) + struct.pack("<I", count)


def true_torque(bench: Bench, side: str, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Torque at a time."""
    swing = bench.ripple * np.sin(2 * math.pi * bench.ripple_hz * t)
    return bench.torque[side] + bench.torque_slope * t + swing


def frequency(bench: Bench, side: str, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Frequency output at a time."""
    return NULL_HZ[side] + true_torque(bench, side, t) / NOMINAL[side] * SPAN_HZ[side]


def phase(bench: Bench, side: str, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Periods of the frequency output since the start, in closed form."""
    omega = 2 * math.pi * bench.ripple_hz
    area = bench.torque[side] * t + bench.torque_slope * t**2 / 2 + bench.ripple * (1 - np.cos(omega * t)) / omega
    return NULL_HZ[side] * t + area / NOMINAL[side] * SPAN_HZ[side]


def edges_and_ticks(
    bench: Bench, side: str, t: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Count of edges and tick of the last one at each time; the first edge lies before the first sample."""
    live = np.minimum(t, bench.silent_from) + LEAD
    count = np.floor(phase(bench, side, live))
    moment = live.copy()
    for _ in range(8):
        moment -= (phase(bench, side, moment) - count) / frequency(bench, side, moment)
    ticks = (moment - LEAD) * TIMEBASE_HZ * (1 + bench.timebase_error)
    _, first, again = np.unique(
        count, return_index=True, return_inverse=True
    )  # one edge, one tick: the last digits differ
    tick = np.floor(ticks + 1e-4).astype(np.int64)[first][again]
    return count.astype(np.int64) + bench.start_edges, tick + 4_000_000 + bench.start_ticks


def true_count(bench: Bench, side: str, t: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Encoder count without wraps."""
    turns = bench.speed[side] / 60.0 * t + bench.acceleration / 60.0 * t**2 / 2
    return np.floor(turns * COUNTS_PER_REV).astype(np.int64) + bench.start_count.get(side, 0)


def live(n: int) -> npt.NDArray[np.float64]:
    """What no transducer is without, in every second sample [Hz]: 2 uN m, and none of it left in a mean."""
    return np.where(np.arange(n) % 2, LIVE_HZ, -LIVE_HZ)


def tracks(bench: Bench) -> dict[str, tuple[dict[str, str], npt.NDArray[Any]]]:
    """Channel metadata and samples by topic."""
    t = np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz
    common = {"rate_hz": f"{bench.rate_hz:g}", "clock_id": "0"}
    found: dict[str, tuple[dict[str, str], npt.NDArray[Any]]] = {}
    for side in ("sun", "ring"):
        plain = {"quantity": "count", "unit": "1", "dtype": "u32"} | common
        if bench.encoding == "edges":
            edges, ticks = edges_and_ticks(bench, side, t)
            ticked = plain | {"quantity": "tick", "timebase_hz": str(TIMEBASE_HZ)}
            found[f"/daq/torque_{side}/edges"] = plain, edges % 2**32
            found[f"/daq/torque_{side}/edge_ticks"] = ticked, ticks % 2**32
        else:
            declared = {"quantity": "frequency", "unit": "Hz", "dtype": bench.encoding} | common
            found[f"/daq/torque_{side}/frequency"] = declared, frequency(bench, side, t) + live(len(t))
        counted = plain | {"counts_per_rev": str(COUNTS_PER_REV), "bits": str(bench.bits)}
        found[f"/daq/encoder_{side}/count"] = counted, true_count(bench, side, t) % 2**bench.bits
    if bench.lines is not None:
        mask = np.zeros(len(t), dtype=np.int64)
        mask[slice(*bench.lines)] = 1
        found["/daq/lines"] = {"quantity": "mask", "unit": "1", "dtype": "u32"} | common, mask
    return found


def write(path: Path, bench: Bench) -> Path:
    """Write the run to a file, the blocks of all topics in turn as a recorder does."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=8192, compression=bench.compression, enable_crcs=bench.crc)
        writer.start(profile="pmg", library="test bench")
        entries = {name: value for name, value in (RUN | dict(bench.run)).items() if value is not None}
        writer.add_metadata("pmg.run", entries)
        if bench.calibration is not None:
            writer.add_attachment(0, 0, "calibration.toml", "application/toml", bench.calibration.encode())
        schemas = {
            name: writer.register_schema(f"pmg.v1.{name}", "protobuf", b"")
            for name in ("SampleBlock", "TestStep", "LineEvent", "ClockMark", "IndexPulse")
        }

        queue: list[tuple[int, int, bytes]] = []

        def put(topic: str, schema: str, messages: Sequence[bytes], metadata: Mapping[str, str]) -> None:
            if topic in bench.without or topic in bench.other:
                return
            changed = dict(metadata) | dict(bench.channel.get(topic, {}))
            kept = {name: value for name, value in changed.items() if value is not None}
            channel = writer.register_channel(topic, "protobuf", schemas[schema], kept)
            queue.extend((number, channel, message) for number, message in enumerate(messages))

        for topic, (metadata, values) in tracks(bench).items():
            values = bench.spoil.get(topic, same)(values)
            messages = bench.raw.get(topic) or blocks(bench, topic, metadata["dtype"], values)
            put(topic, "SampleBlock", messages, metadata)
        put("/test/step", "TestStep", [step(*entry) for entry in bench.steps], {})
        put("/events/lines", "LineEvent", [event(*entry) for entry in bench.events], {})
        put("/sys/clock", "ClockMark", [mark(*entry) for entry in bench.marks], {})
        if bench.with_index:
            for side in ("sun", "ring"):
                given = [pulse(*entry) for entry in bench.index.get(side, ())]
                put(f"/daq/encoder_{side}/index", "IndexPulse", given or pulses(bench, side), {})
        for topic, other in bench.other.items():
            schema = writer.register_schema(*other.schema)
            channel = writer.register_channel(topic, other.encoding, schema, dict(other.metadata))
            queue.extend((number, channel, message) for number, message in enumerate(other.messages))
        for topic, message in bench.extra.items():
            put(topic, "SampleBlock", [message], {})
        for number, channel, message in sorted(queue, key=lambda entry: entry[0]):
            logged = bench.host[0] + number * bench.host[1]
            writer.add_message(channel, log_time=logged, publish_time=number, data=message)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def blocks(bench: Bench, topic: str, dtype: str, values: npt.NDArray[Any]) -> list[bytes]:
    """Blocks of a topic without the samples that it is to lack."""
    low, high = bench.drop.get(topic, (0, 0))
    messages = []
    for number, start in enumerate(range(0, len(values), BLOCK)):
        stop = min(start + BLOCK, len(values))
        if low <= start < high:
            continue
        flags = bench.flags.get(topic, {}).get(number, 0)
        messages.append(block(bench.first_sample + start, dtype, values[start:stop], flags=flags))
    return messages


def pulses(bench: Bench, side: str) -> list[bytes]:
    """One index pulse each revolution; from the half of the run on they are off by `index_slip` counts."""
    t = np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz
    count = true_count(bench, side, t)
    turns = count // COUNTS_PER_REV
    crossings = np.flatnonzero(np.diff(turns)) + 1
    found = []
    for place in crossings:
        latched = int(max(turns[place], turns[place - 1])) * COUNTS_PER_REV
        slip = bench.index_slip if place > len(t) / 2 else 0
        found.append(pulse(bench.first_sample + int(place), (latched + slip) % 2**bench.bits))
    return found

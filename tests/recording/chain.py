"""Follows what a damaged file lost: container, samples, windows, points of the grid."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.grid.campaign import measured_grid
from pmg.pipeline.grid.completeness import holes, lack_findings
from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.codes import Severity
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.gaps import LOSSES
from pmg.sim.bench import load_bench
from pmg.sim.grid import Grid

from .damages import CHUNK, COUNT, METADATA, TORQUE, flip, of_kind, recorded
from .writer import BLOCK, Bench

NAMES = ("A", "B", "C", "D", "E")
EACH = 1000
"""Samples from one START to the next: 200 to settle, 700 of the window, 100 to slow down."""
REPEAT, SESSION = "repeat.mcap", "session.mcap"
COLUMNS = ("torque_sun", "torque_ring", "angle_sun", "angle_ring")
STEPS = tuple(
    (place * EACH + at, name, phase, {"sun_speed_rpm": 600.0, "ring_torque_Nm": float(place)})
    for place, name in enumerate(NAMES)
    for at, phase in ((0, "START"), (200, "MEASURE"), (900, "END"))
)

Stretch = tuple[int, int]


def session(hour: int = 9, **change: object) -> bytes:
    """A sequence of five points, its steps in the file where they happened."""
    run = {"started_at": f"2025-04-23T{hour:02}:00:00Z", "point": None}
    bench = Bench(len(NAMES) * EACH / 500.0, steps=STEPS, run=run, **change)  # type: ignore[arg-type]
    return in_time(recorded(bench))


def in_time(data: bytes) -> bytes:
    """The same messages in the order of their samples, in chunks of some 250 samples."""
    reader, out = make_reader(BytesIO(data)), BytesIO()
    to = Writer(out, chunk_size=8192, compression=CompressionType.ZSTD)
    to.start(profile="pmg", library="test bench")
    for record in reader.iter_metadata():
        to.add_metadata(record.name, record.metadata)
    for item in reader.iter_attachments():
        to.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
    numbers: dict[str, int] = {}
    queue: list[tuple[float, int, bytes]] = []
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if channel.topic not in numbers:
            kind = to.register_schema(schema.name, schema.encoding, schema.data)
            numbers[channel.topic] = to.register_channel(
                channel.topic, channel.message_encoding, kind, channel.metadata
            )
        place = float(message.publish_time)
        if channel.topic == "/test/step":
            place = int.from_bytes(message.data[1:9], "little") / BLOCK - 0.5
        queue.append((place, numbers[channel.topic], message.data))
    for place, number, payload in sorted(queue, key=lambda entry: entry[0]):
        to.add_message(number, log_time=max(0, round(place * 7)), publish_time=0, data=payload)
    to.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


@cache
def whole() -> bytes:
    """The session before it is damaged."""
    return session()


def chunks() -> list[Stretch]:
    """Place and end of its chunks."""
    return of_kind(whole(), CHUNK)


def bit(number: int) -> Callable[[], bytes]:
    """One bit of a chunk turned."""
    return lambda: flip(whole(), sum(chunks()[number]) // 2)


def without(first: int, last: int) -> bytes:
    """The session without some chunks."""
    return whole()[: chunks()[first][0]] + whole()[chunks()[last][1] :]


def zeros(first: int, last: int) -> bytes:
    """The session with some chunks zero."""
    a, b = chunks()[first][0], chunks()[last][1]
    return whole()[:a] + bytes(b - a) + whole()[b:]


@dataclass(frozen=True)
class Harm:
    """What was done to the session, and the samples in which a recorder or a check spoilt it without losing them."""

    name: str
    make: Callable[[], bytes]
    spoilt: Stretch = (0, 0)


def rest(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Held from sample 2300 to 2700."""
    held = values.copy()
    held[2300:2700] = held[2300]
    return held


def strange(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Not numbers from sample 2300 to 2400."""
    return np.where((np.arange(len(values)) // 100) == 23, np.nan, values)


HARMS = (
    Harm("bit in a chunk inside a window", bit(2)),
    Harm("bit in a chunk with an END and a START", bit(4)),
    Harm("bits in two chunks", lambda: flip(bit(6)(), sum(chunks()[11]) // 2)),
    Harm("chunks missing, with all steps of a point", lambda: without(8, 12)),
    Harm("chunks zero", lambda: zeros(5, 6)),
    Harm("cut inside a chunk", lambda: whole()[: sum(chunks()[10]) // 2]),
    Harm("cut between chunks", lambda: whole()[: chunks()[7][0]]),
    Harm("second half zero", lambda: whole()[: len(whole()) // 2] + bytes(len(whole()) // 2)),
    Harm("cut before all that the file says of itself", lambda: whole()[: of_kind(whole(), METADATA)[0][0]]),
    Harm("samples of one channel missing", lambda: session(drop={TORQUE: (2300, 2700)})),
    Harm("one channel ends early", lambda: session(drop={COUNT: (3500, 5000)})),
    Harm("recorder lost samples", lambda: session(flags={TORQUE: {23: 1}}), (2300, 2400)),
    Harm("input beyond its range", lambda: session(flags={TORQUE: {13: 4}}), (1300, 1400)),
    Harm("values that are no numbers", lambda: session(spoil={TORQUE: strange})),
    Harm("values that stand still", lambda: session(spoil={TORQUE: rest}), (2300, 2700)),
)


@dataclass(frozen=True)
class Chain:
    """What became of one damage.

    Parameters
    ----------
    lost : tuple of (int, int)
        Samples that any channel lost, their ends left out.
    touched : tuple of str
        Points whose windows hold some of them.
    absent : tuple of str
        Those of them of which no window is left.
    broken : tuple of str
        Links that are missing.
    """

    lost: tuple[Stretch, ...]
    touched: tuple[str, ...]
    absent: tuple[str, ...]
    broken: tuple[str, ...]


def ingested(data: bytes) -> tuple[Manifest, dict[str, npt.NDArray[np.float64]], Grid, list[Remark]]:
    """Manifest, samples and grid of a session, and what analyse would tell of it beside a whole repeat.

    No samples, and the grid of the repeat, where the session is not usable.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder) / "r"
        place.mkdir()
        (place / SESSION).write_bytes(data)
        (place / REPEAT).write_bytes(session(hour=8))
        store = Store(Path(folder) / "s")
        ingest(place, store, workers=1)
        manifests = {str(manifest.file): manifest for manifest in store.manifests()}
        used = [manifest for manifest in manifests.values() if manifest.ingested]
        failed = [manifest for manifest in manifests.values() if not manifest.ingested]
        grid = measured_grid("made", [manifests[REPEAT if failed else SESSION]], load_bench())
        told = list(lack_findings(grid, holes(grid), failed, used))
        if failed:
            return manifests[SESSION], {}, grid, told
        frame = store.samples(manifests[SESSION])
    first, count = int(frame["sample"][0]), len(NAMES) * EACH
    samples = {}
    for name in COLUMNS:
        samples[name] = np.full(count, np.nan)
        there = frame[name].to_numpy()[: count - first]
        samples[name][first : first + len(there)] = there
    return manifests[SESSION], samples, grid, told


@cache
def undamaged() -> tuple[Manifest, dict[str, npt.NDArray[np.float64]], Grid, list[Remark]]:
    """The same of the session before it is damaged."""
    return ingested(whole())


def follow(harm: Harm) -> Chain:
    """From the bytes that were spoilt to the points of the grid, and every link that is missing."""
    before, sound, grid_before, _ = undamaged()
    after, samples, grid, told = ingested(harm.make())
    document = after.document()
    findings = [Finding.from_dict(plain) for plain in document["findings"]]
    broken: list[str] = []
    if not after.ingested:
        points = tuple(str(window["point"]) for window in before.document()["windows"])
        silent = not any(f.where == SESSION and "not usable, so not in the grid: " in f.message for f in told)
        return Chain(((0, len(NAMES) * EACH),), points, points, ("the file is refused in silence",) * silent)

    gone = np.logical_or.reduce([np.isfinite(sound[name]) & np.isnan(samples[name]) for name in COLUMNS])
    lost = [(int(a), int(b)) for a, b in stretches(gone)]
    stop = document["first_sample"] + document["samples"]
    for a, b in lost:
        named = np.zeros(len(gone), dtype=np.bool_)
        for finding in findings:
            if finding.sample_range is not None and finding.severity is not Severity.INFO:
                named[slice(*finding.sample_range)] = True
        beyond = any(f.code in LOSSES and f.severity is Severity.ERROR for f in findings)
        named[stop:] |= beyond
        if not named[a:b].all():
            broken.append(f"samples {a} to {b} are lost and in no finding")
    for name in ("torque_sun", "torque_ring"):
        changed = np.isfinite(samples[name]) & (samples[name] != sound[name])
        changed[slice(*harm.spoilt)] = False
        for a, b in lost:  # edges that are counted on one side of a sample only, beside a gap
            changed[[max(0, a - 1), min(b, len(changed) - 1)]] = False
        if changed.any():
            broken.append(f"{name} is another at sample {int(np.argmax(changed))}")
    spoilt = gone.copy()
    spoilt[slice(*harm.spoilt)] = True

    windows = {str(window["point"]): window for window in document["windows"]}
    rows = {str(name): row for row, name in enumerate(grid.points.name)}
    old = {str(name): row for row, name in enumerate(grid_before.points.name)}
    touched, absent = [], []
    for window in before.document()["windows"]:
        point, a, b = str(window["point"]), window["first_sample"], window["stop_sample"]
        as_before = point in windows and windows[point]["reasons"] == window["reasons"]
        if not spoilt[a:b].any() and as_before:
            broken += _same(window, windows[point], grid_before, old[point], grid, rows[point])
            continue
        touched.append(point)
        if point not in windows:
            absent.append(point)
            if not any(f.where == f"{SESSION}: {point}" and "not reached" in f.message for f in told):
                broken.append(f"point {point} is gone, and nothing says so")
            continue
        broken += _rejected(windows[point], spoilt, (a, b), grid, rows[point], told)
    return Chain(tuple(lost), tuple(touched), tuple(absent), tuple(broken))


def _rejected(
    window: dict[str, Any],
    spoilt: npt.NDArray[np.bool_],
    span: Stretch,
    grid: Grid,
    row: int,
    told: list[Remark],
) -> list[str]:
    """Links that are missing from the samples of a window to its row of the grid."""
    point, reasons = str(window["point"]), [str(reason) for reason in window["reasons"]]
    if window["accepted"]:
        return [f"window {point} is accepted with {int(spoilt[slice(*span)].sum())} samples of {span} lost or spoilt"]
    broken = []
    ranges = [(int(a), int(b)) for text in reasons for a, b in re.findall(r"(\d+) to (\d+)", text)]
    ends = any(text.endswith("the recording ends there") for text in reasons) and spoilt[window["stop_sample"] :].all()
    marks = ("flagged by the recorder", "found faulty", "window not closed")
    named = any(spoilt[a:b].any() for a, b in ranges) or any(text.startswith(marks) for text in reasons)
    if not named and not ends:
        broken.append(f"window {point} is rejected for something else: {reasons}")
    if grid.accepted[row] or grid.reason[row] != "; ".join(reasons):
        broken.append(f"row {point} of the grid does not carry the reason")
    if not any(f.where == f"window {point}" and f.message == f"rejected: {grid.reason[row]}" for f in told):
        broken.append(f"analyse does not tell of window {point}")
    return broken


def _same(
    before: dict[str, Any], after: dict[str, Any], grid_before: Grid, row_before: int, grid: Grid, row: int
) -> list[str]:
    """What is different about a point that was not touched."""
    keys = ("first_sample", "stop_sample", "setpoints", "accepted", "reasons", "configuration", "started_at_s")
    broken = [f"{key} of window {before['point']}" for key in keys if before[key] != after[key]]
    for side in ("sun", "ring"):
        for key, value in before["means"][side].items():
            other = after["means"][side][key]
            near = (
                np.isclose(value, other, rtol=1e-9)
                if isinstance(value, float) and other is not None
                else value == other
            )
            broken += [] if near else [f"{key} of the {side} of window {before['point']}: {value} and {other}"]
    for name in ("torque_sun", "torque_ring", "u_sun", "u_ring", "common_sun"):
        a, b = getattr(grid_before, name)[row_before], getattr(grid, name)[row]
        broken += [] if np.isclose(a, b, rtol=1e-9) else [f"{name} of row {before['point']}: {a} and {b}"]
    return broken

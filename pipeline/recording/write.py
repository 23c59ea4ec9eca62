"""Simulated runs written as recordings of layout pmg.v1, marked as simulated in every block."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.writer import CompressionType, Writer

from pmg.pipeline.recording.calibration import (
    ATTACHMENT,
    NUMBERS,
    Calibration,
    Transducer,
    read_calibration,
)
from pmg.pipeline.recording.channels import ENCODING, LARGEST_RATE, SHARED_CLOCK, encoder, frequency
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.frequency import DEFAULT_BITS
from pmg.pipeline.recording.join import SIMULATED
from pmg.pipeline.recording.layouts.moments import SECOND_NS
from pmg.pipeline.recording.layouts.repack import BLOCK_SAMPLES
from pmg.pipeline.recording.layouts.schema import CLOCK_MARK, SAMPLE_BLOCK, TEST_STEP, descriptor_set, encode
from pmg.pipeline.recording.run import LAYOUT, RECORD, RUN_KEYS, read_run
from pmg.sim.errors import RecordingError, near_miss
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt

    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Configuration
    from pmg.sim.signals import Array

    _Channel = tuple[dict[str, str], npt.NDArray[Any]]  # metadata and samples

NULL_FREQUENCY_HZ = 10_000.0
"""Frequency output of the bench's transducers at no torque [Hz]."""
SPAN_HZ = 5_000.0
"""Its change at nominal torque [Hz]."""
COUNTS_PER_REV = 5120
"""Quadrature counts of one turn of the bench's encoders, of 1280 lines."""
LARGEST_COUNT = 1 << 53
"""Encoder counts beyond which an angle in double precision no longer tells one count from the next."""
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
LATEST_NS = 1 << 63
"""Times from here on do not fit into a signed count of nanoseconds since 1970 [ns]."""


@dataclass(frozen=True)
class SimulatedRun:
    """One simulated test point or run, as it would have been recorded.

    Parameters
    ----------
    campaign, point : str
        Campaign, and the test point in it.
    configuration : Configuration
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    started_at : datetime
        Time of the first sample, aware.
    drive : str
        Side that drives when engaged, ``sun`` or ``ring``.
    rate : float
        Samples per second [1/s].
    torque_sun, torque_ring : (n,) array
        What the transducers see [N m].
    angle_sun, angle_ring : (n,) array
        What the motors' encoders see, unwrapped [rad].
    setpoints : mapping of str to float
        Any of ``sun_speed_set_rpm``, ``ring_speed_set_rpm``, ``ring_torque_set_Nm``, in the unit of the key.
    note : str
        Free text.
    manoeuvre : str
        What a run in motion does; empty for a steady one.
    phases : sequence of (int, str)
        Sample and name of the phases between the start and the end of a run in motion; none for a steady one, whose
        whole file is one window.
    """

    campaign: str
    point: str
    configuration: Configuration
    gear: int
    started_at: datetime
    drive: str
    rate: float
    torque_sun: Array
    torque_ring: Array
    angle_sun: Array
    angle_ring: Array
    setpoints: Mapping[str, float]
    note: str = ""
    manoeuvre: str = ""
    phases: Sequence[tuple[int, str]] = ()


def rated_calibration(bench: BenchParameters) -> Calibration:
    """Transducers and encoders of the bench without any tolerance, as a simulation records by them."""
    sun, ring = (
        Transducer(NULL_FREQUENCY_HZ, float(parameters.nominal_torque), SPAN_HZ, "simulated")
        for parameters in (bench.transducer_sun, bench.transducer_ring)
    )
    return Calibration(sun, ring, COUNTS_PER_REV, COUNTS_PER_REV)


def recording_bytes(run: SimulatedRun, calibration: Calibration) -> bytes:
    """The run as an MCAP file of layout pmg.v1; the same bytes for the same run.

    Parameters
    ----------
    run : SimulatedRun
        What was simulated.
    calibration : Calibration
        Turns torque into frequency and angle into counts, and travels with the recording.

    Raises
    ------
    RecordingError
        When a value does not fit into a recording: a torque beyond its transducer's nominal one, a number that is
        not finite, arrays of different lengths, a word that the layout does not know.

    Notes
    -----
    The counters read the angle cut down to a whole count and wrap. A reader therefore gets the angle back to within
    one count, and up to a whole number of wraps that is the same for all samples. The write time of
    a block is the time at which its last sample had been taken.
    """
    where = f"run '{run.point}' of campaign '{run.campaign}'"
    entries, attachment = _entries(run, where), _attachment(calibration, where)
    written = _channels(run, calibration, where)
    length = len(run.torque_sun)
    times = _times(run, np.minimum(np.arange(0, length + BLOCK_SAMPLES, BLOCK_SAMPLES), length), where)
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
    writer.start(profile="pmg", library=f"pmg {version('pmg-bench')}")
    writer.add_metadata(RECORD, entries)
    writer.add_attachment(times[0], times[0], ATTACHMENT, "application/toml", attachment)
    block, mark = (writer.register_schema(m.full_name, ENCODING, descriptor_set()) for m in (SAMPLE_BLOCK, CLOCK_MARK))
    channels = [
        (writer.register_channel(topic, ENCODING, block, metadata), metadata["dtype"], samples)
        for topic, (metadata, samples) in written.items()
    ]
    clock = writer.register_channel("/sys/clock", ENCODING, mark)
    writer.add_message(clock, times[0], encode(CLOCK_MARK, {"utc_ns": times[0], "source": "simulated"}), times[0])
    if run.phases:
        schema = writer.register_schema(TEST_STEP.full_name, ENCODING, descriptor_set(TEST_STEP))
        channel = writer.register_channel("/test/step", ENCODING, schema)
        for sample, phase in ((0, "START"), *run.phases, (length - 1, "END")):
            step = {"sample": sample, "point": run.point, "phase": phase}
            writer.add_message(channel, times[0], encode(TEST_STEP, step), times[0])
    for first, (begun, taken) in zip(range(0, length, BLOCK_SAMPLES), pairwise(times), strict=True):
        for identity, dtype, samples in channels:
            message = _block(first, begun, dtype, samples[first : first + BLOCK_SAMPLES])
            writer.add_message(identity, taken, message, taken)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def _block(first: int, time_ns: int, dtype: str, samples: npt.NDArray[Any]) -> bytes:
    """A block of samples, the first of that index and taken at that time [ns UTC]."""
    seconds, nanos = divmod(time_ns, SECOND_NS)
    stamp = {"seconds": seconds, "nanos": nanos}
    head = {"timestamp": stamp, "first_sample": first, "clock_id": SHARED_CLOCK, "flags": SIMULATED}
    return encode(SAMPLE_BLOCK, head | {dtype: samples})


def _times(run: SimulatedRun, samples: npt.NDArray[np.int64], where: str) -> list[int]:
    """Times of samples [ns since 1970, UTC]."""
    start = (run.started_at - EPOCH) // timedelta(microseconds=1) * 1000
    seconds = float(samples[-1]) / run.rate
    if start < 0 or start + seconds * SECOND_NS >= LATEST_NS:
        came, do = f"{run.started_at} and {seconds:g} s from there", "Correct the start, or the rate of the samples."
        raise RecordingError(f"{where}: started_at", came, "a run between 1970 and 2262", do)
    return [start + round(int(sample) / run.rate * SECOND_NS) for sample in samples]


def _entries(run: SimulatedRun, where: str) -> dict[str, str]:
    """The run's metadata, proven by the reader's own check."""
    if not (run.campaign and run.point):
        raise RecordingError(where, "a name is empty", "names of campaign and point", "Name both.")
    if run.started_at.utcoffset() is None:
        raise RecordingError(f"{where}: started_at", f"{run.started_at} without zone", "a time in UTC", "Add its zone.")
    for key, value in run.setpoints.items():
        if key not in RUN_KEYS or not np.isfinite(value):
            do = "Leave out what was not set." if key in RUN_KEYS else near_miss(key, RUN_KEYS)
            came, expected = f"{key} = {value}", f"finite {', '.join(RUN_KEYS)}"
            raise RecordingError(f"{where}: set-points", came, expected, do)
    entries = {
        "layout": LAYOUT,
        "campaign": run.campaign,
        "point": run.point,
        "configuration": str(run.configuration),
        "gear": str(run.gear),
        "started_at": run.started_at.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z"),
        "drive": run.drive,
        **{key: repr(float(run.setpoints[key])) for key in RUN_KEYS if key in run.setpoints},
        **{key: text for key, text in (("manoeuvre", run.manoeuvre), ("note", run.note)) if text},
    }
    findings = Findings(where)
    if read_run([(RECORD, entries)], findings) is None:
        raise findings.give_up()
    return entries


def _attachment(calibration: Calibration, where: str) -> bytes:
    """The calibration as TOML, proven by the reader's own check."""
    text = ""
    for side in SIDES:
        t = calibration[side]
        numbers = zip(NUMBERS, (t.null_frequency_hz, t.nominal_torque, t.span_hz), strict=True)
        text += f"[transducer.{side}]\n" + "".join(f"{key} = {float(value)!r}\n" for key, value in numbers)
        text += f"serial = {json.dumps(t.serial, ensure_ascii=False)}\n\n"
        text += f"[encoder.{side}]\ncounts_per_rev = {calibration.counts_per_rev[side]}\n\n"
    data = text.encode("utf-8")
    findings = Findings(where)
    if read_calibration([(ATTACHMENT, data)], findings) is None:
        raise findings.give_up()
    return data


def _channels(run: SimulatedRun, calibration: Calibration, where: str) -> dict[str, _Channel]:
    """The sampled channels by topic, every sample proven to fit."""
    if not 0.0 < run.rate <= LARGEST_RATE:
        came, expected = f"{run.rate} 1/s", f"a positive rate of at most {LARGEST_RATE:g} 1/s"
        raise RecordingError(f"{where}: rate", came, expected, "Give the samples per second.")
    names = [f"{quantity}_{side}" for quantity in ("torque", "angle") for side in SIDES]
    columns = {name: np.asarray(getattr(run, name), dtype=np.float64) for name in names}
    shapes = {name: column.shape for name, column in columns.items()}
    if len(set(shapes.values())) > 1 or any(c.ndim != 1 or not len(c) for c in columns.values()):
        raise RecordingError(where, f"arrays of shapes {shapes}", "rows of one length", "Give all the same samples.")
    clock = {"rate_hz": repr(float(run.rate)), "clock_id": str(SHARED_CLOCK)}
    found: dict[str, _Channel] = {}
    for side in SIDES:
        transducer, counts = calibration[side], calibration.counts_per_rev[side]
        torque, angle = columns[f"torque_{side}"], columns[f"angle_{side}"]
        _check(torque, float(transducer.nominal_torque), "N m", f"{where}: torque_{side}")
        _check(angle, LARGEST_COUNT * REVOLUTION / counts, "rad", f"{where}: angle_{side}")
        count = np.floor(angle / (REVOLUTION / counts)).astype(np.int64)
        steps = np.diff(count, prepend=count[:1])
        _check(steps, (1 << (DEFAULT_BITS - 1)) - 1, "counts in one step", f"{where}: angle_{side}")
        for spec, samples, more in (
            (frequency(side), transducer.frequency(torque), {}),
            (encoder(side), count % (1 << DEFAULT_BITS), {"counts_per_rev": str(counts), "bits": str(DEFAULT_BITS)}),
        ):
            kind = {"quantity": spec.quantity, "unit": spec.unit, "dtype": spec.dtypes[0]}
            found[spec.topic] = (kind | clock | more, samples)
    return found


def _check(values: npt.NDArray[Any], limit: float, unit: str, where: str) -> None:
    """Whether all values lie within plus and minus a limit; one that is not finite does not."""
    outside = np.flatnonzero(~(np.abs(values) <= limit))
    if len(outside):
        came = f"{values[outside[0]]} {unit}, the first of {len(outside)} such values"
        expected = f"a number within the range of the instrument, -{limit:.6g} to {limit:.6g} {unit}"
        do = "Correct the run, or give a calibration with a larger range."
        raise RecordingError(f"{where}, sample {outside[0]}", came, expected, do)

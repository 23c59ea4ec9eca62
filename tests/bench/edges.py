"""`./pmgw bench edges`: how right the torque from edges is, and which planted faults of the samples are found.

First the mean frequency over windows, decoded from edges with ripple, beside the phase gained over the time, which is
known in closed form. Then faults planted in runs with noise at random places: found, missed, and what was said besides.
Last, sound files: the shared campaigns where they are given, and runs made here.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.edges import edge_frequency
from pmg.pipeline.recording.findings import Finding, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording
from tests.recording.writer import (
    COUNTS_PER_REV,
    LEAD,
    NULL_HZ,
    SPAN_HZ,
    TIMEBASE_HZ,
    Bench,
    block,
    edges_and_ticks,
    phase,
    same,
    tracks,
    true_count,
    wraps,
    write,
)

Samples = npt.NDArray[Any]
SUN = "/daq/torque_sun/frequency"
COUNT = "/daq/encoder_sun/count"
RIPPLE = 0.05
TRIALS = 20


def show(*cells: object) -> None:
    """One line of a table."""
    sys.stdout.write(f"{cells[0]!s:<52}" + "".join(f"{cell!s:>13}" for cell in cells[1:]) + "\n")
    sys.stdout.flush()


# --- edges ---------------------------------------------------------------------------------------------


def ripple_table() -> None:
    """Error of the mean frequency over windows, in ppm of the span."""
    show(f"edges, ripple of {RIPPLE:.0%} of the frequency", "window [s]", "rms [ppm]", "max [ppm]", "1/period")
    rng = np.random.default_rng(1)
    for rate in (500.0, 10_000.0):
        for hertz in (0.7, 7.3, 61.0, 390.0):
            size = RIPPLE * NULL_HZ["sun"] / SPAN_HZ["sun"] * 5.0
            bench = Bench(10.0, rate, torque={"sun": 0.0, "ring": 0.0}, ripple=size, ripple_hz=hertz, encoding="edges")
            t = np.arange(round(10.0 * rate)) / rate
            edges, ticks = edges_and_ticks(bench, "sun", t)
            wrapped = edges % 2**32, ticks % 2**32
            found = edge_frequency(*wrapped, np.ones(len(t), dtype=np.bool_), rate, TIMEBASE_HZ).frequency
            at = phase(bench, "sun", t + LEAD)
            single = np.diff(edges) == 1
            for window in (1.0, 5.0):
                n = round(window * rate)
                off, plain = [], []
                for start in rng.integers(1, len(t) - n, 50).tolist():
                    truth = (at[start + n] - at[start]) / window
                    off.append(float(found[start + 1 : start + n + 1].mean()) - truth)
                    part = slice(start, start + n)
                    if single[part].mean() > 0.5:
                        periods = np.diff(ticks)[part][single[part]] / TIMEBASE_HZ
                        plain.append(1.0 / float(periods.mean()) - truth)
                ppm = np.abs(off) / SPAN_HZ["sun"] * 1e6
                rough = f"{np.max(np.abs(plain)) / SPAN_HZ['sun'] * 1e6:.0f}" if plain else "-"
                name = f"  {rate:g} S/s, ripple at {hertz:g} Hz"
                show(name, f"{window:g}", f"{np.sqrt(np.mean(ppm**2)):.2f}", f"{ppm.max():.2f}", rough)


# --- planted faults ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Planted:
    """A run with a fault: what is to be found, and where; no code when it must go unnoticed, with the angle right."""

    bench: Bench
    code: Code | None
    place: tuple[int, int] | None = None


def noisy(bench: Bench, rng: np.random.Generator) -> Bench:
    """The run with noise on both frequencies."""
    spoil = dict(bench.spoil)
    for side in ("sun", "ring"):
        topic = f"/daq/torque_{side}/frequency"
        noise = rng.normal(0.0, 5.0, round(bench.seconds * bench.rate_hz))
        spoil[topic] = after(noise, spoil.get(topic, same))
    return replace(bench, spoil=spoil)


def after(noise: Samples, fault: Callable[[Samples], Samples]) -> Callable[[Samples], Samples]:
    """Noise, and then the fault."""
    return lambda values: fault(values + noise)


def turning(rng: np.random.Generator, **more: Any) -> Bench:  # noqa: ANN401 (fields of the bench)
    """A run at a random speed in a random direction."""
    sun = float(rng.choice([-1.0, 1.0]) * rng.uniform(200.0, 1200.0))
    speed = {"sun": sun, "ring": -sun / 2.6}
    return Bench(
        3.0,
        10_000.0,
        speed=speed,
        torque={"sun": float(np.copysign(0.8, sun)), "ring": float(np.copysign(1.5, -sun))},
        run={"sun_speed_set_rpm": f"{sun}", "ring_speed_set_rpm": f"{-sun / 2.6}"},
        with_index=True,
        **more,
    )


def counts_of(bench: Bench) -> tuple[Samples, list[tuple[int, int]]]:
    """Count of the sun and its index pulses, latched where the sample shows them."""
    count = true_count(bench, "sun", np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz)
    places = np.flatnonzero(np.diff(count // COUNTS_PER_REV)) + 1
    return count, [(int(p), int(count[p])) for p in places]


def lost(size: int) -> Callable[[np.random.Generator], Planted]:
    """Counts lost at one place."""

    def plant(rng: np.random.Generator) -> Planted:
        bench = turning(rng, bits=16)
        count, pulses = counts_of(bench)
        at = int(rng.integers(pulses[1][0], pulses[-1][0]))
        by = int(size * rng.choice([-1, 1]))
        shifted = count + by * (np.arange(len(count)) >= at)
        index = [(p, (c + by * (p >= at)) % 2**16) for p, c in pulses]
        spoil = {COUNT: lambda _: shifted % 2**16}
        return Planted(replace(bench, spoil=spoil, index={"sun": index}), Code.ENCODER_SLIPPED, (at, at + 1))

    return plant


def wrapping(bits: int) -> Callable[[np.random.Generator], Planted]:
    """A narrow counter that wraps many times: nothing is to be said."""

    def plant(rng: np.random.Generator) -> Planted:
        start = {"sun": int(rng.integers(0, 2**bits)), "ring": int(rng.integers(0, 2**bits))}
        return Planted(replace(turning(rng, bits=bits), with_index=False, start_count=start), None)

    return plant


def timer(rng: np.random.Generator) -> Planted:
    """Edges of 16 bits and a time base of 24 that wrap: nothing is to be said."""
    topics = {f"/daq/torque_{s}/{k}": b for s in ("sun", "ring") for k, b in (("edges", 16), ("edge_ticks", 24))}
    bench = turning(rng, encoding="edges", start_ticks=int(rng.integers(0, 2**32)))
    narrow = {topic: {"bits": str(bits)} for topic, bits in topics.items()}
    spoil = {topic: wraps(bits) for topic, bits in topics.items()}
    return Planted(replace(bench, with_index=False, channel=narrow, spoil=spoil), None)


def missing_pulse(rng: np.random.Generator) -> Planted:
    """One pulse gone."""
    bench = turning(rng)
    _, pulses = counts_of(bench)
    gone = int(rng.integers(1, len(pulses) - 1))
    left = [(p, c % 2**32) for k, (p, c) in enumerate(pulses) if k != gone]
    return Planted(replace(bench, index={"sun": left}), Code.INDEX_MISSING, (pulses[gone][0], pulses[gone][0] + 1))


def double_pulse(rng: np.random.Generator) -> Planted:
    """One pulse twice."""
    bench = turning(rng)
    count, pulses = counts_of(bench)
    place = pulses[int(rng.integers(1, len(pulses) - 1))][0] + int(rng.integers(1, 40))
    more = sorted([*pulses, (place, int(count[place]))])
    index = [(p, c % 2**32) for p, c in more]
    return Planted(replace(bench, index={"sun": index}), Code.INDEX_SURPLUS, (place, place + 1))


def reversal(rng: np.random.Generator) -> Planted:
    """A shaft that turns back within the run: nothing is to be said."""
    bench = Bench(3.0, 10_000.0, speed={"sun": 300.0, "ring": 0.0}, acceleration=float(-rng.uniform(150, 250)))
    bench = replace(bench, torque={"sun": 0.0, "ring": 0.0}, bits=16)
    _, pulses = counts_of(bench)
    return Planted(replace(bench, with_index=True, index={"sun": [(p, c % 2**16) for p, c in pulses]}), None)


def crossed(kind: str) -> Callable[[np.random.Generator], Planted]:
    """Channels reversed or swapped."""

    def plant(rng: np.random.Generator) -> Planted:
        bench = replace(turning(rng), with_index=False)
        speed, torque = dict(bench.speed), dict(bench.torque)
        if kind == "swapped":
            speed = {"sun": speed["ring"], "ring": speed["sun"]}
            torque = {"sun": -torque["sun"], "ring": -torque["ring"]}
            return Planted(replace(bench, speed=speed, torque=torque), Code.CHANNEL_SWAPPED)
        if kind == "reversed":
            speed["sun"], torque["sun"] = -speed["sun"], -torque["sun"]
        else:
            torque["sun"] = -torque["sun"]
        return Planted(replace(bench, speed=speed, torque=torque), Code.CHANNEL_REVERSED)

    return plant


def stretch(how: Callable[[Samples, slice], Samples], code: Code) -> Callable[[np.random.Generator], Planted]:
    """A stretch of the sun's frequency spoilt."""

    def plant(rng: np.random.Generator) -> Planted:
        bench = replace(turning(rng), with_index=False)
        start = int(rng.integers(2000, 20_000))
        stop = start + int(rng.integers(1500, 5000))
        spoil = {SUN: lambda v: how(v.copy(), slice(start, stop))}
        return Planted(replace(bench, spoil=spoil), code, (start, stop))

    return plant


def put(values: Samples, at: slice, to: Samples | float) -> Samples:
    """Samples with a stretch replaced."""
    values[at] = to
    return values


def restart(rng: np.random.Generator) -> Planted:
    """All channels begin anew at index 0 after some blocks."""
    bench = noisy(replace(turning(rng), with_index=False), rng)
    raw = {}
    for topic, (metadata, values) in tracks(bench).items():
        samples = bench.spoil.get(topic, same)(values)
        whole = [block(k, metadata["dtype"], samples[k : k + 100]) for k in range(0, 30_000, 100)]
        raw[topic] = whole + [
            block(k - 9000, metadata["dtype"], samples[k : k + 100]) for k in range(9000, 19_000, 100)
        ]
    return Planted(replace(bench, raw=raw), Code.RESTART, (0, 10_000))


FAULTS: Mapping[str, Callable[[np.random.Generator], Planted]] = {
    "200 counts lost": lost(200),
    "40 counts lost": lost(40),
    "20 counts lost": lost(20),
    "10 counts lost": lost(10),
    "5 counts lost": lost(5),
    "index pulse missing": missing_pulse,
    "index pulse twice": double_pulse,
    "turning back within the run (no fault)": reversal,
    "counter of 16 bits wraps (no fault)": wrapping(16),
    "counter of 12 bits wraps (no fault)": wrapping(12),
    "edges of 16, time base of 24 bits wrap (no fault)": timer,
    "encoder reversed": crossed("reversed"),
    "encoders swapped": crossed("swapped"),
    "torque reversed": crossed("torque"),
    "frequency outside of the band": stretch(lambda v, s: put(v, s, v[s] + 6000.0), Code.OUT_OF_BAND),
    "cable off (0 Hz)": stretch(lambda v, s: put(v, s, 0.0), Code.OUT_OF_BAND),
    "held value": stretch(lambda v, s: put(v, s, v[s.start]), Code.STUCK),
    "shunt signal": stretch(lambda v, s: put(v, s, v[s] - 0.5 * SPAN_HZ["sun"]), Code.SHUNT),
    "samples not finite": stretch(lambda v, s: put(v, s, np.nan), Code.NOT_FINITE),
    "index begins anew": restart,
}
ALSO = {Code.STUCK, Code.OUT_OF_BAND}
"""Findings that rightly come together: a cable that is off gives one value outside of the band."""


def told(bench: Bench) -> tuple[tuple[Finding, ...], npt.NDArray[Any] | None]:
    """Findings of a run, and its angle."""
    with TemporaryDirectory() as folder:
        try:
            recording = read_recording(write(Path(folder) / "a.mcap", bench))
        except UnusableRecordingError as error:
            return error.findings, None
    return recording.findings, recording.samples["angle_sun"].to_numpy()


def covers(finding: Finding, planted: Planted) -> bool:
    """Whether a finding is of the kind that was planted, over the place."""
    if finding.code is not planted.code:
        return False
    if planted.place is None or finding.sample_range is None:
        return True
    return finding.sample_range[0] <= planted.place[0] + 4 and finding.sample_range[1] >= planted.place[1] - 4


def fault_table(trials: int) -> None:
    """Planted faults, found and missed, and what was said besides."""
    show("planted fault", "runs", "found", "missed", "invented")
    for name, plant in FAULTS.items():
        rng = np.random.default_rng(7)
        found = invented = 0
        for _ in range(trials):
            planted = plant(rng)
            bench = (
                planted.bench if planted.bench.encoding == "edges" or planted.bench.raw else noisy(planted.bench, rng)
            )
            if name in ("held value", "cable off (0 Hz)", "samples not finite"):
                bench = planted_last(planted.bench, rng)
            findings, angle = told(bench)
            hits = [f for f in findings if covers(f, planted)]
            right = bool(hits)
            if planted.code is None:
                t = np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz
                truth = true_count(bench, "sun", t)
                moved = (truth - truth[0]) * 2.0 * np.pi / COUNTS_PER_REV
                right = angle is not None and bool(np.allclose(angle - angle[0], moved, atol=1e-6))
            found += right
            strange = [f for f in findings if f.code is not planted.code and f.severity is not Severity.INFO]
            invented += any(not (f.code in ALSO and planted.code in ALSO) for f in strange)
        show("  " + name, trials, found, trials - found, invented)


def planted_last(bench: Bench, rng: np.random.Generator) -> Bench:
    """Noise first, then the fault."""
    fault = bench.spoil[SUN]
    live = noisy(replace(bench, spoil={}), rng)
    noise = live.spoil[SUN]
    return replace(live, spoil=dict(live.spoil) | {SUN: lambda v: fault(noise(v))})


# --- sound files ---------------------------------------------------------------------------------------


def sound_table(folders: list[Path], trials: int) -> None:
    """What is said of sound files, other than what is only worth knowing."""
    show("sound files", "files", "findings", "which")
    rng = np.random.default_rng(11)
    codes: Counter[str] = Counter()
    for _ in range(trials):
        findings, _ = told(noisy(turning(rng, bits=16), rng))
        codes.update(f.code.value for f in findings if f.severity is not Severity.INFO)
    show("  made here", trials, sum(codes.values()), ", ".join(codes) or "-")
    for folder in folders:
        paths = sorted(folder.glob("*.mcap")) if folder.is_dir() else [folder]
        codes = Counter()
        for path in paths:
            codes.update(f.code.value for f in read_recording(path).findings if f.severity is not Severity.INFO)
        show(f"  {folder.name}", len(paths), sum(codes.values()), ", ".join(codes) or "-")


def main() -> None:
    """Print the tables; arguments are folders or files of sound recordings."""
    ripple_table()
    fault_table(TRIALS)
    given = [Path(name) for name in sys.argv[1:]]
    sound_table(given or [Path("raw/example"), Path("tests/data")], TRIALS)


if __name__ == "__main__":
    main()

"""Faults of the signals of one run: what transducers, encoders, cables, counters and clocks do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.grid.checked_campaign import ENGAGED, NEUTRAL, RATE_HZ, RATIO, Runs, noisy
from tests.recording.writer import (
    CALIBRATION,
    COUNTS_PER_REV,
    NOMINAL,
    NULL_HZ,
    SPAN_HZ,
    Bench,
    block,
    blocks,
    same,
    tracks,
)

from .case import Case

Samples = npt.NDArray[Any]
Change = Callable[[Samples], Samples]
SUN, RING = "/daq/torque_sun/frequency", "/daq/torque_ring/frequency"
COUNT = {"sun": "/daq/encoder_sun/count", "ring": "/daq/encoder_ring/count"}
LENGTH = 1000
"""Samples of a run."""


def hertz(torque: float, side: str = "sun") -> float:
    """Change of the frequency with a torque [N m]."""
    return torque / NOMINAL[side] * SPAN_HZ[side]


def torque(after: Change, side: str = "sun", name: str = NEUTRAL) -> Callable[[Runs], None]:
    """The frequency of a transducer changed, after the noise that it has in the sound campaign."""

    def plant(runs: Runs) -> None:
        seed = 2 * int(name[:2]) + (side == "ring")
        spoil = dict(runs[name].spoil) | {f"/daq/torque_{side}/frequency": noisy(side, seed, after)}
        runs[name] = replace(runs[name], spoil=spoil)

    return plant


def count(after: Change, side: str = "sun", name: str = NEUTRAL) -> Callable[[Runs], None]:
    """The count of an encoder changed."""

    def plant(runs: Runs) -> None:
        runs[name] = replace(runs[name], spoil=dict(runs[name].spoil) | {COUNT[side]: after})

    return plant


def changed(name: str = NEUTRAL, **changes: Any) -> Callable[[Runs], None]:  # noqa: ANN401 (fields of the bench)
    """Fields of a run changed."""

    def plant(runs: Runs) -> None:
        runs[name] = replace(runs[name], **changes)

    return plant


def turned(change: Callable[[Bench], Mapping[str, Any]], name: str = NEUTRAL) -> Callable[[Runs], None]:
    """Fields of a run changed by what they are."""

    def plant(runs: Runs) -> None:
        runs[name] = replace(runs[name], **change(runs[name]))

    return plant


def put(at: slice, to: float | Change) -> Change:
    """A stretch of samples replaced."""

    def after(values: Samples) -> Samples:
        out = values.copy()
        out[at] = to(values[at]) if callable(to) else to
        return out

    return after


def _waved(size: float, line_hz: float, side: str = "sun") -> Change:
    t = np.arange(LENGTH) / RATE_HZ
    return lambda values: values + hertz(size, side) * np.sin(2.0 * np.pi * line_hz * t + 0.4)


def _clipped(level: float) -> Change:
    """Samples beyond the mean by so many N m cut off."""
    return lambda values: np.minimum(values, values.mean() + hertz(level))


def _dithered(values: Samples) -> Samples:
    return put(slice(300, 800), values[300] + hertz(0.1) + 0.19 * (np.arange(500) % 2))(values)


def _quantised(step: float) -> Change:
    return lambda values: NULL_HZ["sun"] + np.floor((values - NULL_HZ["sun"]) / hertz(step)) * hertz(step)


def _raw(change: Callable[[list[bytes]], list[bytes]], topic: str = SUN) -> Callable[[Runs], None]:
    """Messages of a topic changed."""

    def own(run: Bench) -> Mapping[str, Any]:
        metadata, values = tracks(run)[topic]
        samples = run.spoil.get(topic, same)(values)
        return {"raw": {topic: change(blocks(run, topic, metadata["dtype"], samples))}}

    return turned(own)


def _other_values(messages: list[bytes]) -> list[bytes]:
    again = block(300, "f64", np.full(100, 9000.0))
    return [*messages[:6], again, *messages[6:]]


def _marks(step_ns: int, pace: float) -> list[tuple[int, int]]:
    start = 1_745_395_380_000_000_000
    return [(250 * k, int(start + k * 5e8 * pace) + step_ns * (k >= 2)) for k in range(4)]


def _swapped(*fields: str) -> Callable[[Bench], Mapping[str, Any]]:
    return lambda run: {f: {"sun": getattr(run, f)["ring"], "ring": getattr(run, f)["sun"]} for f in fields}


def _scaled(field: str, sun: float = 1.0, ring: float = 1.0) -> Callable[[Bench], Mapping[str, Any]]:
    return lambda run: {field: {"sun": getattr(run, field)["sun"] * sun, "ring": getattr(run, field)["ring"] * ring}}


def _added(sun: float = 0.0, ring: float = 0.0) -> Callable[[Bench], Mapping[str, Any]]:
    return lambda run: {"torque": {"sun": run.torque["sun"] + sun, "ring": run.torque["ring"] + ring}}


def _channel(topic: str, **metadata: str | None) -> Callable[[Runs], None]:
    return changed(channel={topic: metadata})


TURNS = CALIBRATION.replace(f"counts_per_rev = {COUNTS_PER_REV}", f"counts_per_rev = {COUNTS_PER_REV // 2}")
MOST = slice(0, 900)

FAULTS: tuple[tuple[str, Callable[[Runs], object]], ...] = (
    ("torque missing for 0.4 s", changed(drop={SUN: (300, 500)})),
    ("torque missing from the half on", changed(drop={RING: (500, 1000)})),
    ("count missing for 0.4 s", changed(drop={COUNT["ring"]: (300, 500)})),
    ("every other block of the torque missing", _raw(lambda m: m[::2])),
    ("torque no number for 0.5 s", torque(put(slice(200, 450), np.nan))),
    ("one sample infinite", torque(put(slice(500, 501), np.inf))),
    ("one sample of 1e300 Hz", torque(put(slice(500, 501), 1e300))),
    ("cable off for 0.4 s", torque(put(slice(300, 500), 0.0))),
    ("cable off all the time", torque(put(slice(None), 0.0))),
    ("held to the bit for 0.4 s", torque(put(slice(300, 500), lambda v: v[0]))),
    ("held to the bit all the time", torque(put(slice(None), lambda v: v[0]))),
    ("held for 1 s with dither", torque(_dithered)),
    ("every sample twice", torque(lambda v: np.repeat(v[::2], 2))),
    ("20 spikes of 4 N m", torque(put(slice(17, None, 50), lambda v: v + hertz(4.0)))),
    ("3 spikes of 4 N m", torque(put(slice(5, None, 400), lambda v: v + hertz(4.0)))),
    ("one spike of 4 N m", torque(put(slice(501, 502), lambda v: v + hertz(4.0)))),
    ("50 spikes of -2 N m on the ring", torque(put(slice(5, None, 20), lambda v: v + hertz(-2.0, "ring")), "ring")),
    ("a burst of 10 samples 4 N m off", torque(put(slice(400, 410), lambda v: v + hertz(4.0)))),
    ("a burst of 60 samples 1 N m off", torque(put(slice(400, 460), lambda v: v + hertz(1.0)))),
    ("each 10th sample at the null", torque(put(slice(3, None, 10), NULL_HZ["sun"]), name=ENGAGED)),
    ("clipped at its mean", torque(_clipped(0.0))),
    ("ripple of 0.5 N m, clipped at +0.1", torque(lambda v: _clipped(0.1)(_waved(0.5, 31.0)(v)))),
    ("resolution of 50 mN m, cut off", torque(_quantised(0.05))),
    ("resolution of 5 mN m, cut off", torque(_quantised(0.005))),
    ("gain 1.5 in one run", torque(lambda v: NULL_HZ["sun"] + 1.5 * (v - NULL_HZ["sun"]), name=ENGAGED)),
    (
        "gain of the ring 1.3 in one run",
        torque(lambda v: NULL_HZ["ring"] + 1.3 * (v - NULL_HZ["ring"]), "ring", ENGAGED),
    ),
    ("sign of the sun's torque in one run", turned(_scaled("torque", sun=-1.0), ENGAGED)),
    ("sign of the ring's torque in one run", turned(_scaled("torque", ring=-1.0), ENGAGED)),
    ("signs of both torques in one run", turned(_scaled("torque", -1.0, -1.0), ENGAGED)),
    ("zero 200 mN m off in one run", torque(lambda v: v + hertz(0.2))),
    ("zero 500 mN m off in a zero check", torque(lambda v: v + hertz(0.5), name="00.mcap")),
    ("kHz written as Hz", torque(lambda v: v / 1000.0)),
    ("unit declared mHz", _channel(SUN, unit="mHz")),
    ("unit missing", _channel(SUN, unit=None)),
    ("type declared f16", _channel(SUN, dtype="f16")),
    ("drift of 0.5 N m in the run", changed(torque_slope=0.25)),
    ("drift of 50 mN m in the run", changed(torque_slope=0.025)),
    ("step of 50 mN m in the run", torque(put(slice(500, None), lambda v: v + hertz(0.05)))),
    ("mains hum of 0.5 N m at 50 Hz", torque(_waved(0.5, 50.0))),
    ("mains hum of 2 N m at 50 Hz", torque(_waved(2.0, 50.0))),
    ("swing of 0.3 N m at 0.7 Hz", torque(_waved(0.3, 0.7))),
    ("line of 0.3 N m at 499.3 Hz, aliased", torque(_waved(0.3, 499.3))),
    ("noise ten times as large", torque(lambda v: v + np.random.default_rng(5).normal(0.0, hertz(0.12), len(v)))),
    ("single precision", changed(encoding="f32")),
    ("torques of both shafts swapped", turned(_swapped("torque"), ENGAGED)),
    ("encoders of both shafts swapped", turned(_swapped("speed"), ENGAGED)),
    ("all channels of both shafts swapped", turned(_swapped("speed", "torque"), ENGAGED)),
    ("encoder of the sun reversed", turned(_scaled("speed", sun=-1.0), ENGAGED)),
    ("1000 counts lost at once", count(put(slice(500, None), lambda v: v - 1000))),
    ("20 counts lost at once", count(put(slice(500, None), lambda v: v - 20))),
    ("count held for 0.3 s", count(put(slice(300, 450), lambda v: v[0]))),
    ("count held all the time", count(put(slice(None), 7))),
    ("a count of noise", count(lambda v: np.random.default_rng(3).integers(0, 2**31, len(v)))),
    ("count of 32 bits declared as 8", _channel(COUNT["sun"], bits="8")),
    ("counts per turn halved in the channel", _channel(COUNT["sun"], counts_per_rev=str(COUNTS_PER_REV // 2))),
    ("counts per turn halved in the calibration", changed(calibration=TURNS)),
    ("index pulses 300 counts off from the half on", changed(with_index=True, index_slip=300)),
    ("speed that grows by 5 % in the run", changed(acceleration=450.0)),
    ("edges that stop", changed(encoding="edges", silent_from=1.0, spoil={})),
    ("time base of the edges 0.1 % off", changed(encoding="edges", timebase_error=1e-3, spoil={})),
    ("clock that steps by an hour", changed(marks=_marks(3_600_000_000_000, 1.0))),
    ("clock that runs 1 % fast", changed(marks=_marks(0, 1.01))),
    ("clock marks of the year 1970", changed(marks=[(250 * k, 1 + k * 500_000_000) for k in range(4)])),
    ("recorder says that it lost samples", changed(flags={SUN: {3: 1}})),
    ("recorder says that it began anew", changed(flags={SUN: {3: 2}})),
    ("recorder says that the input was beyond its range", changed(flags={SUN: {3: 4}})),
    ("two blocks in the wrong order", _raw(lambda m: [*m[:3], m[4], m[3], *m[5:]])),
    ("a block twice", _raw(lambda m: [*m[:4], m[3], *m[4:]])),
    ("a block twice, with other values", _raw(_other_values)),
    ("a block 2^61 samples on", _raw(lambda m: [*m, block(2**61, "f64", np.full(100, 1e4))])),
    ("channel missing", changed(without=frozenset({COUNT["ring"]}))),
    ("rate of one channel declared 400 Hz", _channel(COUNT["sun"], rate_hz="400")),
    (
        "rate of all channels declared 250 Hz",
        changed(channel={t: {"rate_hz": "250"} for t in (SUN, RING, *COUNT.values())}),
    ),
    ("emergency stop pressed", changed(lines=(200, 600))),
    ("torque beyond the nominal one", turned(_added(sun=5.5, ring=5.5 * RATIO))),
    ("run that is over after 0.2 s", changed(seconds=0.2)),
)

CASES = tuple(Case("signal", what, plant) for what, plant in FAULTS)

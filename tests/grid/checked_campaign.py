"""A campaign of short recordings in which faults are planted, for the cross-checks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import numpy.typing as npt
from tests.recording.writer import BLOCK, CALIBRATION, NOMINAL, SPAN_HZ, Bench, write

START = datetime(2025, 4, 23, 8, 0, 0, tzinfo=UTC)
RATE_HZ = 500.0
RATIO = 13.0 / 5.0
NOISE = {"sun": 0.012, "ring": 0.025}
"""Standard deviation of the torque noise [N m]."""
SPEEDS, LOADS = (300.0, 780.0, 1300.0), (0.78, 1.17, 1.56, 1.95)

Runs = dict[str, Bench]
Values = npt.NDArray[np.float64]


def noisy(side: str, seed: int, after: Callable[[Values], Values] | None = None) -> Callable[[Values], Values]:
    """Noise on the frequency of a transducer, and what is done to it afterwards."""

    def spoil(values: Values) -> Values:
        noise = np.random.default_rng(seed).normal(0.0, NOISE[side], len(values))
        spoilt = values + noise / NOMINAL[side] * SPAN_HZ[side]
        return spoilt if after is None else after(spoilt)

    return spoil


def run(number: int, sun: float, ring: float, torque: Mapping[str, float], **metadata: str) -> Bench:
    """One run with noise of its own, its start and the host's clock."""
    began = START + timedelta(seconds=60 * number)
    told = {
        "point": f"P{number:02d}",
        "started_at": began.isoformat(),
        "sun_speed_set_rpm": f"{sun:g}",
        "ring_speed_set_rpm": f"{ring:.6f}",
    }
    return Bench(
        seconds=2.0,
        rate_hz=RATE_HZ,
        speed={"sun": sun, "ring": ring},
        torque=torque,
        run=told | metadata,
        spoil={f"/daq/torque_{side}/frequency": noisy(side, 2 * number + k) for k, side in enumerate(("sun", "ring"))},
        host=(int(began.timestamp() * 1e9), int(BLOCK / RATE_HZ * 1e9)),
    )


def drag(rpm: float, constant: float, slope: float) -> float:
    """Torque that a shaft takes at a speed [N m]."""
    return math.copysign(constant, rpm) + slope * rpm if rpm else 0.0


def sound_campaign() -> Runs:
    """Zero checks, neutral points with repeats, engaged points both ways; nothing wrong with any of them."""
    runs: Runs = {}

    def add(sun: float, ring: float, torque: Mapping[str, float], **metadata: str) -> None:
        runs[f"{len(runs):02d}.mcap"] = run(len(runs), sun, ring, torque, **metadata)

    for _ in range(2):
        add(0.0, 0.0, {"sun": 0.0, "ring": 0.0}, configuration="zero")
    for sun in (*SPEEDS, *SPEEDS):
        for ring in (120.0, 300.0):
            add(sun, ring, {"sun": drag(sun, 0.03, 5e-5), "ring": drag(ring, 0.05, 2e-4)})
    for way, drive in ((1.0, "sun"), (-1.0, "ring")):
        for sun in SPEEDS:
            for load in LOADS:
                ring = -sun / RATIO
                measured = way * load + drag(ring, 0.05, 2e-4)
                torque = {"sun": measured / RATIO + drag(sun, 0.03, 5e-5), "ring": measured}
                add(sun, ring, torque, configuration="engaged", drive=drive, ring_torque_set_Nm=f"{way * load}")
    return runs


@dataclass(frozen=True)
class Fault:
    """A fault: what it is, the check that must name it, how it is planted, and whether it leaves nothing to use."""

    what: str
    check: str
    plant: Callable[[Runs], str]
    void: bool = False


def _changed(name: str, **changes: object) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        runs[name] = replace(runs[name], **changes)  # type: ignore[arg-type]
        return name

    return plant


def _told(name: str, **metadata: str) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        runs[name] = replace(runs[name], run=dict(runs[name].run) | metadata)
        return name

    return plant


def _torque(name: str, change: Callable[[float], float], *sides: str) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        torque = {side: change(t) if side in sides else t for side, t in runs[name].torque.items()}
        runs[name] = replace(runs[name], torque=torque)
        return name

    return plant


def _half_load(runs: Runs) -> str:
    name = ENGAGED
    torque = runs[name].torque
    less = 0.5 * float(runs[name].run["ring_torque_set_Nm"] or "nan")
    runs[name] = replace(runs[name], torque={"sun": torque["sun"] - less / RATIO, "ring": torque["ring"] - less})
    return name


def _all_scaled(factor: float, *sides: str) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        for name, one in runs.items():
            torque = {side: factor * t if side in sides else t for side, t in one.torque.items()}
            runs[name] = replace(one, torque=torque)
        return ""

    return plant


def _all_faster(factor: float, *sides: str) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        for name, one in runs.items():
            runs[name] = replace(one, speed={s: factor * n if s in sides else n for s, n in one.speed.items()})
        return ""

    return plant


def _calibration(old: str, new: str) -> Callable[[Runs], str]:
    return _changed(NEUTRAL, calibration=CALIBRATION.replace(old, new, 1))


def _spikes(values: Values) -> Values:
    out = values.copy()
    out[17::50] += 4.0 / NOMINAL["sun"] * SPAN_HZ["sun"]
    return out


def _held_with_dither(values: Values) -> Values:
    out = values.copy()
    out[300:800] = values[300] + 0.1 / NOMINAL["sun"] * SPAN_HZ["sun"] + 0.19 * (np.arange(500) % 2)
    return out


def _spoilt(name: str, side: str, after: Callable[[Values], Values]) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        spoil = dict(runs[name].spoil) | {f"/daq/torque_{side}/frequency": noisy(side, 991, after)}
        runs[name] = replace(runs[name], spoil=spoil)
        return name

    return plant


def _simulated(runs: Runs) -> str:
    flags = {f"/daq/torque_{side}/frequency": dict.fromkeys(range(10), 8) for side in ("sun", "ring")}
    return _changed(NEUTRAL, flags=flags)(runs)


def _host(start: float, pace: float) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        began, apart = runs[NEUTRAL].host
        return _changed(NEUTRAL, host=(int(began + start * 1e9), int(pace * apart)))(runs)

    return plant


NEUTRAL, ENGAGED = "03.mcap", "16.mcap"


def _under_another_start(runs: Runs) -> str:
    """The samples of a run once more, as of a run that began an hour later under another name."""
    began = START + timedelta(hours=1)
    told = dict(runs[NEUTRAL].run) | {"started_at": began.isoformat(), "point": "P99"}
    host = (int(began.timestamp() * 1e9), runs[NEUTRAL].host[1])
    runs["copied.mcap"] = replace(runs[NEUTRAL], run=told, host=host)
    return "copied.mcap"


FAULTS = (
    Fault("run marked as a zero check", "zero-check", _told("05.mcap", configuration="zero")),
    Fault("load held at half of its set-point", "load", _half_load),
    Fault("load with the wrong sign of its set-point", "load", _told(ENGAGED, ring_torque_set_Nm="-1.5")),
    Fault("repeat 200 mN m off on the sun", "repeats", _torque("08.mcap", lambda t: t + 0.2, "sun")),
    Fault("repeat 200 mN m off on the ring", "repeats", _torque("09.mcap", lambda t: t - 0.2, "ring")),
    Fault("span of one calibration doubled", "calibration", _calibration("span_Hz = 5000.0", "span_Hz = 10000.0")),
    Fault("zero of one calibration 20 Hz off", "calibration", _calibration("10003.2", "10023.2")),
    Fault(
        "no serial number and another span in one run",
        "calibration",
        _changed(NEUTRAL, calibration=CALIBRATION.replace('serial = "T-sun"\n', "").replace("5000.0", "6000.0", 1)),
    ),
    Fault("one run marked as simulated", "simulated-data", _simulated),
    Fault("gear 2 declared on a run in gear 1", "gear", _told(ENGAGED, gear="2")),
    Fault("neutral run declared as engaged", "gear", _told("04.mcap", configuration="engaged")),
    Fault("engaged run declared as neutral", "configuration", _told(ENGAGED, configuration="neutral")),
    Fault("driven by the other side than declared", "drive", _told(ENGAGED, drive="ring")),
    Fault("speed 0.3 % off its set-point", "speed", _changed(NEUTRAL, speed={"sun": 301.2, "ring": 300.9})),
    Fault("samples of a run under another start", "same-samples", _under_another_start),
    Fault("half the declared sample rate", "sample-rate", _host(0.0, 2.0)),
    Fault("twice the declared sample rate", "sample-rate", _host(0.0, 0.5)),
    Fault("start ten years before its blocks", "start-time", _host(3.2e8, 1.0)),
    Fault("start an hour after its blocks", "start-time", _host(-3600.0, 1.0)),
    Fault("20 spikes of 4 N m", "spikes", _spoilt(NEUTRAL, "sun", _spikes)),
    Fault("gain of the sun 1.5 in one run", "torque-balance", _torque(ENGAGED, lambda t: 1.5 * t, "sun")),
    Fault("zero of the sun 300 mN m off under load", "torque-balance", _torque("30.mcap", lambda t: t + 0.3, "sun")),
    Fault("torque of the sun of the wrong sign", "torque-balance", _torque("30.mcap", lambda t: -t, "sun"), void=True),
    Fault("encoder of the ring 0.15 % too many counts", "encoder-ratio", _all_faster(1.0015, "ring")),
    Fault("gain of the sun's transducer one half", "transducer-ratio", _all_scaled(0.5, "sun")),
    Fault("gain of the ring's transducer 1.2", "transducer-ratio", _all_scaled(1.2, "ring")),
)
"""Faults that nothing in their file alone gives away, but for the clocks, and the check that names each."""

HELD_WITH_DITHER = _spoilt(NEUTRAL, "sun", _held_with_dither)


def write_campaign(folder: Path, runs: Runs) -> Path:
    """All runs as files of a folder."""
    for name, one in runs.items():
        write(folder / name, one)
    return folder


def _load_by(factor: float, name: str) -> Callable[[Runs], str]:
    def plant(runs: Runs) -> str:
        torque = runs[name].torque
        less = (1.0 - factor) * float(runs[name].run["ring_torque_set_Nm"] or "nan")
        runs[name] = replace(runs[name], torque={"sun": torque["sun"] - less / RATIO, "ring": torque["ring"] - less})
        return name

    return plant


def _all_swapped(runs: Runs) -> str:
    for name, one in runs.items():
        runs[name] = replace(one, torque={"sun": one.torque["ring"], "ring": one.torque["sun"]})
    return ""


def _spiky(size: float, every: int, side: str) -> Callable[[Values], Values]:
    def after(values: Values) -> Values:
        out = values.copy()
        out[5::every] += size / NOMINAL[side] * SPAN_HZ[side]
        return out

    return after


def _held(values: Values) -> Values:
    out = values.copy()
    out[200:400] = values[200]
    return out


MORE_FAULTS = (
    Fault("zero check in which the ring turns", "zero-check", _told("02.mcap", configuration="zero")),
    Fault("load at 0.75 of its set-point", "load", _load_by(0.75, "17.mcap")),
    Fault("load at 1.3 of its set-point", "load", _load_by(1.3, "17.mcap")),
    Fault("load of reversed flow at half", "load", _load_by(0.5, "30.mcap")),
    Fault("repeat 80 mN m off on the sun", "repeats", _torque("08.mcap", lambda t: t + 0.08, "sun")),
    Fault("repeat 300 mN m off on both", "repeats", _torque("10.mcap", lambda t: t + 0.3, "sun", "ring")),
    Fault(
        "span of the ring's calibration 5 % less", "calibration", _calibration("span_Hz = -4900.0", "span_Hz = -4655.0")
    ),
    Fault("nominal torque of one calibration doubled", "calibration", _calibration("Nm = 5.0", "Nm = 10.0")),
    Fault("zero of the ring's calibration 50 Hz off", "calibration", _calibration("9996.9", "10046.9")),
    Fault("gear 2 declared on a run of reversed flow", "gear", _told("29.mcap", gear="2")),
    Fault("slow neutral run declared as engaged", "gear", _told("02.mcap", configuration="engaged")),
    Fault("engaged run of reversed flow declared neutral", "configuration", _told("30.mcap", configuration="neutral")),
    Fault("reversed flow declared as driven by the sun", "drive", _told("30.mcap", drive="sun")),
    Fault("ring 0.3 % off its set speed", "speed", _changed("07.mcap", speed={"sun": 1300.0, "ring": 300.9})),
    Fault("0.7 of the declared sample rate", "sample-rate", _host(0.0, 1.0 / 0.7)),
    Fault("1.4 of the declared sample rate", "sample-rate", _host(0.0, 1.0 / 1.4)),
    Fault("start a day after its blocks", "start-time", _host(-86_400.0, 1.0)),
    Fault("3 spikes of 4 N m", "spikes", _spoilt(NEUTRAL, "sun", _spiky(4.0, 400, "sun"))),
    Fault("50 spikes of -2 N m on the ring", "spikes", _spoilt(NEUTRAL, "ring", _spiky(-2.0, 20, "ring"))),
    Fault("gain of the ring's transducer one half", "transducer-ratio", _all_scaled(0.5, "ring")),
    Fault("gain of the sun's transducer 1.3", "transducer-ratio", _all_scaled(1.3, "sun")),
    Fault("transducers taken for each other", "transducer-ratio", _all_swapped),
    Fault("torque held for 1 s with dither", "", HELD_WITH_DITHER),
    Fault("torque held for 0.4 s to the bit", "", _spoilt(NEUTRAL, "sun", _held)),
)
"""More of them, for the bench; those without a check are faults of their file, rejected when it is read."""

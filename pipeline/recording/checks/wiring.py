"""Channels that are reversed or swapped, by what the run was asked to do and by what a gear can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.findings import Code
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.run_records import RunInfo, Setpoints
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

SLOWEST = 10.0 * RPM
"""Below this speed a shaft tells nothing of its direction [rad/s]."""
SPEED_TOLERANCE = 0.05
"""Part by which a speed may be off the one that it is taken for."""
DRAG, LOAD = 0.01, 0.05
"""Least torques, as parts of the nominal one, whose sign is trusted: of drag in neutral, of load when engaged."""
LOAD_TOLERANCE, LOAD_MISSED = 0.1, 0.3
"""Part of the torque set-point within which a reading meets it, and beyond which one misses it."""
MOST = 1 << 20
"""Readings of a stretch from which its median is taken; of more, every second, third and so on."""


@dataclass(frozen=True)
class HeldStretch:
    """Both shafts while the set-points were held.

    Parameters
    ----------
    samples : (int, int)
        Sample indices, the end left out.
    setpoints : Setpoints
        What was asked for.
    speed : mapping of str to float
        Mean by shaft [rad/s].
    torque : mapping of str to float
        By shaft, mean or median, whichever is smaller; 0 where they differ in sign, so that neither a spoilt part nor
        a large ripple makes a claim [N m].
    """

    samples: tuple[int, int]
    setpoints: Setpoints
    speed: Mapping[str, float]
    torque: Mapping[str, float]


def stretch_of(
    columns: Mapping[str, Array], first: int, samples: tuple[int, int], setpoints: Setpoints, rate_hz: float
) -> HeldStretch | None:
    """Speeds and torques of a stretch of the samples that begin with `first`; None where a channel is unknown in it."""
    part = slice(max(0, samples[0] - first), max(0, samples[1] - first))
    speed, torque = {}, {}
    for side in SIDES:
        angle, reading = columns[f"angle_{side}"][part], columns[f"torque_{side}"][part]
        known, sound = np.isfinite(angle), np.isfinite(reading)
        reading = reading if sound.all() else reading[sound]
        if np.count_nonzero(known) < 2 or not len(reading):
            return None
        start, last = int(np.argmax(known)), len(known) - 1 - int(np.argmax(known[::-1]))
        speed[side] = float((angle[last] - angle[start]) * rate_hz / (last - start))
        middle, mean = float(np.median(reading[:: 1 + len(reading) // MOST])), float(reading.mean())
        torque[side] = min(middle, mean, key=abs) if middle * mean > 0.0 else 0.0
    return HeldStretch(samples, setpoints, speed, torque)


def check_wiring(
    held: Iterable[HeldStretch], run: RunInfo, calibration: Calibration, bench: BenchParameters, findings: Findings
) -> None:
    """Tell which channels are reversed or swapped; each once, with the first stretch that shows it.

    Parameters
    ----------
    held : iterable of HeldStretch
        Where set-points were held.
    run : RunInfo
        Configuration, gear, driving side.
    calibration : Calibration
        Nominal torques.
    bench : BenchParameters
        Ratios of its stages.
    findings : Findings
        Receives what is found.

    Notes
    -----
    Encoders are held against the set-points, and engaged against the ratio of the stage, in which the shafts turn
    against each other. A torque is held against power: a shaft that is driven in neutral takes power in; engaged, the
    driving side takes it in and the other gives it out. Swapped torques show only engaged, by the torque set-point, and
    only where they fit the ratio of the gear better the other way: at a low load the drag is more than the difference.
    """
    reported: set[tuple[Code, str]] = set()
    ratio = bench.gear(run.gear).ratio if run.configuration is Configuration.ENGAGED else None
    for stretch in held:
        for code, where, message in (*_encoders(stretch, ratio), *_torques(stretch, run, calibration, ratio)):
            if (code, where) not in reported:
                reported.add((code, where))
                do = "Correct the wiring or the channel names in the recorder; pmg does not turn or swap channels."
                findings.error(code, where, message, do, sample_range=stretch.samples)


def _encoders(stretch: HeldStretch, ratio: float | None) -> list[tuple[Code, str, str]]:
    speed, wanted = stretch.speed, {"sun": stretch.setpoints.speed_sun, "ring": stretch.setpoints.speed_ring}
    if ratio is not None:
        sun, ring = wanted["sun"], wanted["ring"]
        if sun is not None:
            wanted["ring"] = -sun / ratio
        elif ring is not None:
            wanted["sun"] = -ring * ratio
    if wanted["sun"] is not None and wanted["ring"] is not None and abs(wanted["sun"] - wanted["ring"]) > SLOWEST:
        crossed = {"sun": wanted["ring"], "ring": wanted["sun"]}
        sizes = {side: abs(goal) for side, goal in crossed.items()}
        differ = abs(sizes["sun"] - sizes["ring"]) > SLOWEST
        straight = all(_near(abs(speed[side]), abs(crossed[other])) for side, other in (SIDES, SIDES[::-1]))
        if differ and not straight and all(_near(abs(speed[side]), sizes[side]) for side in SIDES):
            came = " and ".join(f"{side} {speed[side] / RPM:.1f} rpm" for side in SIDES)
            goal = " and ".join(f"{side} {wanted[side] / RPM:.1f} rpm" for side in SIDES)  # type: ignore[operator]
            return [(Code.CHANNEL_SWAPPED, "/daq/encoder_sun/count", f"the encoders give {came}; expected {goal}")]
    found = []
    for side in SIDES:
        goal_of = wanted[side]
        if goal_of is not None and abs(goal_of) > SLOWEST and _near(speed[side], -goal_of):
            message = f"the shaft turns at {speed[side] / RPM:.1f} rpm; expected {goal_of / RPM:.1f} rpm"
            found.append((Code.CHANNEL_REVERSED, f"/daq/encoder_{side}/count", message))
    if not found and ratio is not None and wanted["sun"] is None and abs(speed["sun"]) > SLOWEST:
        if _near(speed["ring"], speed["sun"] / ratio):
            message = "both shafts turn the same way; expected them to turn against each other in the gear"
            found.append((Code.CHANNEL_REVERSED, "/daq/encoder_ring/count", message))
        elif _near(abs(speed["ring"]), abs(speed["sun"]) * ratio):
            message = f"the ring turns {ratio:.3g} times as fast as the sun; expected {1.0 / ratio:.3g} times"
            found.append((Code.CHANNEL_SWAPPED, "/daq/encoder_sun/count", message))
    return found


def _torques(
    stretch: HeldStretch, run: RunInfo, calibration: Calibration, ratio: float | None
) -> list[tuple[Code, str, str]]:
    torque, speed = stretch.torque, stretch.speed
    nominal = {side: calibration[side].nominal_torque for side in SIDES}
    if run.configuration is Configuration.NEUTRAL:
        expected = dict.fromkeys(SIDES, 1)
        least = DRAG
    elif run.configuration is Configuration.ENGAGED:
        expected = {side: 1 if side == run.drive else -1 for side in SIDES}
        least = LOAD
        goal = stretch.setpoints.torque_ring
        if goal is not None and min(abs(torque["sun"]), abs(torque["ring"])) > least * nominal["sun"]:
            missed = {side: abs(abs(torque[side]) - abs(goal)) / max(abs(goal), 1e-9) for side in SIDES}
            sun, ring = abs(torque["sun"]), abs(torque["ring"])
            likelier = ratio is None or abs(ring - sun / ratio) < abs(sun - ring / ratio)
            if missed["sun"] < LOAD_TOLERANCE and missed["ring"] > LOAD_MISSED and likelier:
                came = f"sun {torque['sun']:.3f} N m, ring {torque['ring']:.3f} N m"
                return [(Code.CHANNEL_SWAPPED, "/daq/torque_sun", f"{came}; expected {goal:g} N m on the ring")]
    else:
        return []
    found = []
    for side in SIDES:
        power = torque[side] * speed[side] * expected[side]
        if power < 0.0 and abs(torque[side]) > least * nominal[side] and abs(speed[side]) > SLOWEST:
            way = "take power in" if expected[side] > 0 else "give power out"
            message = (
                f"{torque[side]:+.3f} N m at {speed[side] / RPM:+.1f} rpm; expected the shaft to {way} as "
                f"configuration '{run.configuration}' and drive '{run.drive}' say"
            )
            found.append((Code.CHANNEL_REVERSED, f"/daq/torque_{side}", message))
    return found


def _near(value: float, goal: float) -> bool:
    return abs(value - goal) < SPEED_TOLERANCE * abs(goal) + RPM

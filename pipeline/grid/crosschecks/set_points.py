"""Readings held against what was asked for: loads, speeds, and zero checks that turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.contradiction import (
    SIGMAS,
    Contradiction,
    accepted_rows,
    least_absolute,
    robust_scale,
)
from pmg.pipeline.windows.steadiness import REST_SPEED
from pmg.pipeline.wording.units import IMPERIAL_TORQUE, SPEED, TORQUE, misread
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.grid.crosschecks.contradiction import Row
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

LOAD_OF_NOMINAL, LOAD_OF_SET = 0.02, 0.15
"""How far a load may be off its set-point where a campaign has too few of them to tell: the drag of the shaft between
motor and transducer is part of the reading."""
FEWEST = 12
"""Loads of a campaign from which each is held against what the others lead one to expect."""
SPREAD_OF_NOMINAL, SPREAD_OF_SET = 0.01, 0.05
"""And how far a load may be off what the others say in any case."""
SCALE_LIMIT = 1e-3
"""How far a speed may be off, as part of its set-point, beyond what the campaign's other speeds are."""
OF_UNIT, SAME_UNIT = 0.12, 0.02
"""Part by which loads, which hold some drag, and speeds may be off the factor between two units that explains them."""
SLOWEST = 50.0 * RPM
"""Set speed below which a part of it says nothing [rad/s]."""


def zero_checks_that_turn(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Zero checks in which a shaft turns; a zero is read with both at rest."""
    for row in accepted_rows(manifests):
        if row.window.configuration != Configuration.ZERO:
            continue
        for side in SIDES:
            speed = abs(row.window.means[side].speed)
            if speed > REST_SPEED:
                message = (
                    f"a zero check in which the {side} turns at {speed / RPM:.1f} rpm, limit {REST_SPEED / RPM:g} rpm"
                )
                yield Contradiction(row, speed, REST_SPEED, message, "Repeat it with both shafts at rest.")
                break


def loads_off_set_point(manifests: Sequence[Manifest], bench: BenchParameters) -> Iterator[Contradiction]:
    """Loads that are not those that were asked for, beyond what the drag of the shaft adds.

    Notes
    -----
    From `FEWEST` loads on, the distance between reading and set-point is fitted by a constant, the set-point, the
    sense of rotation and the speed, which stand for a zero, a gain and the drag; a load may be off that line by
    `SIGMAS` of the scatter, or by a part of the nominal torque or the set-point, whichever is largest.
    """
    rows = [
        row
        for row in accepted_rows(manifests)
        if row.window.configuration == Configuration.ENGAGED and row.window.setpoints.torque_ring is not None
    ]
    if not rows:
        return
    asked = np.array([row.window.setpoints.torque_ring for row in rows], dtype=np.float64)
    torque = np.array([row.window.means.ring.torque for row in rows])
    speed = np.array([row.window.means.ring.speed for row in rows])
    for drive in SIDES:
        driven = np.array([row.window.drive == drive for row in rows])
        opposite = (
            driven & np.isfinite(torque) & (np.abs(asked) > LOAD_OF_NOMINAL * bench.transducer_ring.nominal_torque)
        )
        if opposite.sum() > 1 and (np.sign(torque[opposite]) == -np.sign(asked[opposite])).all():
            message = f"all {opposite.sum()} loads driven by the {drive} have the opposite sign of their set-points"
            do = "Check the convention of ring_torque_set_Nm: it is signed as the reading. Sizes are compared."
            yield Contradiction(None, float(opposite.sum()), 0.0, message, do)
            asked[driven] *= -1.0
    off = torque - asked
    widest = LOAD_OF_NOMINAL * float(bench.transducer_ring.nominal_torque) + LOAD_OF_SET * np.abs(asked)
    expected, limit, gain = _usual_loads(asked, speed, off, widest, bench)
    if abs(gain) > LOAD_OF_SET:
        units = TORQUE | IMPERIAL_TORQUE
        read, asked_for = (
            misread((1.0 + gain) ** sign, units, "N m", OF_UNIT) if gain > -1.0 else "" for sign in (1, -1)
        )
        message = (
            f"the loads of the campaign are {1.0 + gain:.3g} times their set-points, limit 1 +- {LOAD_OF_SET:g}; a "
            f"gain of the load control, or of the ring's transducer, explains it"
        )
        if read:
            message += f": {read}, or the set-points {asked_for}"
        do = "Check span, nominal torque and unit of the calibration, and the unit of the set-points."
        yield Contradiction(None, abs(gain), LOAD_OF_SET, message, do)
    for row, set_to, reading, distance, most in zip(rows, asked, asked + off, off - expected, limit, strict=True):
        if abs(distance) > most:
            usual = "" if not expected.any() else ", drag and gain of the campaign's other loads allowed for"
            message = (
                f"a load of {reading:.3f} N m where {set_to:.3f} N m were asked for{usual}; "
                f"off by {abs(distance):.3f} N m, limit {most:.3f} N m"
            )
            do = "Check the load control; run it again."
            yield Contradiction(row, float(abs(distance)), float(most), message, do)


def _usual_loads(
    asked: Array, speed: Array, off: Array, widest: Array, bench: BenchParameters
) -> tuple[Array, Array, float]:
    """Distances from the set-points that the campaign lets expect, their limits [N m] (n,), and the gain in them.

    With fewer than `FEWEST` loads none is expected, and the widest limits hold.
    """
    known = np.isfinite(off)
    if int(known.sum()) < FEWEST:
        return np.zeros(len(off)), widest, 0.0
    basis = np.column_stack((np.ones(len(off)), asked, np.sign(speed), speed / np.max(np.abs(speed), initial=RPM)))
    found = least_absolute(basis[known], off[known])
    expected = basis @ found
    least = np.maximum(SPREAD_OF_NOMINAL * float(bench.transducer_ring.nominal_torque), SPREAD_OF_SET * np.abs(asked))
    limit = np.maximum(SIGMAS * robust_scale((off - expected)[known]), least)
    return expected, np.minimum(limit, np.maximum(widest, least)), float(found[1])


def _unit_of_speeds(manifests: Sequence[Manifest]) -> Iterator[Contradiction]:
    """Speeds that are all as many times their set-points as one unit is of another, though each was rejected for it."""
    times = []
    for window in (window for manifest in manifests for window in manifest.windows):
        for side in SIDES:
            asked, found = getattr(window.setpoints, f"speed_{side}"), window.means[side].speed
            if asked and np.isfinite(found) and abs(found) > SLOWEST:
                times.append(abs(found / asked))
    usual = float(np.median(times)) if len(times) >= FEWEST else 1.0
    unit = misread(1.0 / usual, SPEED | {"1/s": REVOLUTION}, "rpm", SAME_UNIT)
    if unit and robust_scale(np.array(times)) < SAME_UNIT * usual:
        message = f"the speeds of the campaign are {usual:.4g} times their set-points, which look {unit}"
        yield Contradiction(None, usual, 1.0, message, "Correct the unit of the set-points in the runs' metadata.")


def speeds_off_the_others(manifests: Sequence[Manifest], _: BenchParameters) -> Iterator[Contradiction]:
    """Speeds off their set-points by another part than those of the campaign: a wrong sample rate or encoder."""
    yield from _unit_of_speeds(manifests)
    for side in SIDES:
        rows: list[Row] = []
        parts: list[float] = []
        for row in accepted_rows(manifests):
            asked = getattr(row.window.setpoints, f"speed_{side}")
            if asked is not None and abs(asked) > SLOWEST and np.isfinite(row.window.means[side].speed):
                rows.append(row)
                parts.append(row.window.means[side].speed / asked - 1.0)
        if len(rows) < FEWEST:
            continue
        found = np.array(parts)
        usual, limit = float(np.median(found)), max(SCALE_LIMIT, SIGMAS * robust_scale(found))
        for row, part in zip(rows, parts, strict=True):
            if abs(part - usual) > limit:
                message = (
                    f"the {side} is off its set speed by {100 * part:+.2f} %, the campaign's others by "
                    f"{100 * usual:+.2f} %, limit {100 * limit:.2f} %"
                )
                do = "Check the sample rate, the counts per revolution and the drive of this run."
                yield Contradiction(row, abs(part - usual), limit, message, do)

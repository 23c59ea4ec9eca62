"""Two windows side by side: what of them differs, and whether their means differ beyond U."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from pmg.pipeline.grid.transducer_uncertainty import RECTANGULAR
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, SPEEDS, TORQUES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pmg.pipeline.catalogue.entries import Cell
    from pmg.pipeline.catalogue.find_run import FoundRun
    from pmg.pipeline.recording.calibration import Calibration
    from pmg.sim.bench import BenchParameters

ENDS = math.sqrt(6.0)
"""A step over the standard deviation of the difference of two readings that are each rounded to it."""
SINE = math.pi
"""Steepest slope of one period of a sine over a range of two, for an amplitude of one."""
WHAT = ("run", "calibration", "limits", "rate_hz", "size", "sha256", "origin")
"""Parts of two manifests that are compared."""
OF_WINDOW = ("configuration", "gear", "drive", "start", "seconds", "sun_set_rpm", "ring_set_rpm", "load")
OF_WINDOW_TOO = ("accepted", "reasons", "analysed", "rest_sun", "rest_ring", "findings", "simulated", "status")


@dataclass(frozen=True)
class MeanDifference:
    """The mean of one quantity in two windows.

    Parameters
    ----------
    name, unit : str
        Column, and its unit.
    a, b : float
        Both means.
    u : float or None
        Standard uncertainty of their difference; None where it is not known.
    """

    name: str
    unit: str
    a: float
    b: float
    u: float | None

    @property
    def value(self) -> float:
        """The first minus the second."""
        return self.a - self.b

    @property
    def beyond(self) -> bool | None:
        """Whether it is larger than U; None where that is not known."""
        return None if self.u is None else abs(self.value) > COVERAGE_FACTOR * self.u

    def document(self) -> dict[str, Any]:
        """The same for JSON."""
        expanded = None if self.u is None else COVERAGE_FACTOR * self.u
        values = {"a": self.a, "b": self.b, "difference": self.value, "u": self.u, "U": expanded}
        return {"quantity": self.name, "unit": self.unit} | values | {"beyond_U": self.beyond}


def paired(a: FoundRun, b: FoundRun) -> Iterator[tuple[dict[str, Cell] | None, dict[str, Cell] | None]]:
    """Windows that belong together: one and one, else those of the same test point in turn; None where one is alone."""
    if len(a.rows) == len(b.rows) == 1:
        yield a.rows[0], b.rows[0]
        return
    for point in dict.fromkeys(row["point"] for row in (*a.rows, *b.rows)):
        own, other = ([row for row in side.rows if row["point"] == point] for side in (a, b))
        yield from zip_longest(own, other)


def differing(a: Mapping[str, Any], b: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Entries of two documents that differ, each by its path, with both values; None where one lacks it."""
    one, other = (dict(_leaves({key: of[key] for key in WHAT if key in of})) for of in (a, b))
    return {
        key: (one.get(key), other.get(key)) for key in dict.fromkeys((*one, *other)) if one.get(key) != other.get(key)
    }


def differing_rows(a: Mapping[str, Cell], b: Mapping[str, Cell]) -> dict[str, tuple[Cell, Cell]]:
    """Facts of two windows that differ, other than their means."""
    return {key: (a[key], b[key]) for key in (*OF_WINDOW, *OF_WINDOW_TOO) if a[key] != b[key]}


def _leaves(document: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in document.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def mean_differences(
    a: Mapping[str, Cell], b: Mapping[str, Cell], calibrations: tuple[Calibration | None, ...], bench: BenchParameters
) -> tuple[MeanDifference, ...]:
    """Differences of mean torques and speeds of two windows, with their uncertainty.

    Parameters
    ----------
    a, b : dict
        Both windows as the catalogue has them.
    calibrations : tuple of two Calibration or None
        Of both recordings; None where there is none.
    bench : BenchParameters
        Tolerances of the transducers.

    Notes
    -----
    Torque: what differs from point to point adds in quadrature. What all readings share is taken in full for two
    transducers. Of one and the same, with the same calibration, the sensitivity goes with the difference of the
    torques, the tare drops out, and the non-linearity, taken for one period of a sine over the range from minus to
    plus the nominal torque, cannot change by more than pi times its half-width times that difference over the nominal
    torque.
    Speed: one count of the encoder at both ends of each window; how the drive holds its speed is not in it.
    """
    found = []
    for side in SIDES:
        torque, speed = TORQUES[side], SPEEDS[side]
        known = _means(a, b, torque.display_name)
        if known is not None:
            u = _torque_uncertainty(a, b, side, calibrations, bench)
            found.append(MeanDifference(torque.display_name, torque.display_unit, *known, u))
        known = _means(a, b, f"{side}_{speed.display_unit}")
        if known is not None:
            steps = [_speed_step(row, side, calibration) for row, calibration in zip((a, b), calibrations, strict=True)]
            u = None if None in steps else float(speed.display(math.hypot(*(step or 0.0 for step in steps))))
            found.append(MeanDifference(f"{side}_{speed.display_unit}", speed.display_unit, *known, u))
    return tuple(found)


def _means(a: Mapping[str, Cell], b: Mapping[str, Cell], name: str) -> tuple[float, float] | None:
    one, other = a[name], b[name]
    return (one, other) if isinstance(one, float) and isinstance(other, float) else None


def _torque_uncertainty(
    a: Mapping[str, Cell],
    b: Mapping[str, Cell],
    side: str,
    calibrations: tuple[Calibration | None, ...],
    bench: BenchParameters,
) -> float | None:
    """Standard uncertainty of the difference of two mean torques [N m]."""
    parts = [row[f"u_torque_{side}_Nm"] for row in (a, b)]
    torques = [row[f"torque_{side}_Nm"] for row in (a, b)]
    if not all(isinstance(value, float) for value in (*parts, *torques)):
        return None
    own = math.hypot(*(float(value or 0.0) for value in parts))
    of = bench.transducers[side]
    transducers = [None if calibration is None else calibration[side] for calibration in calibrations]
    nominal = [
        each.nominal_torque if each is not None and each.nominal_torque > 0.0 else float(of.nominal_torque)
        for each in transducers
    ]
    if transducers[0] == transducers[1]:
        apart = abs(float(torques[0] or 0.0) - float(torques[1] or 0.0))
        linear = float(of.nonlinearity) * min(SINE * apart, math.sqrt(2.0) * nominal[0])
        return math.hypot(own, float(of.sensitivity_tolerance) * apart / RECTANGULAR, linear / RECTANGULAR)
    shared = []
    for row, size, torque in zip((a, b), nominal, torques, strict=True):
        plain = math.hypot(float(of.sensitivity_tolerance) * float(torque or 0.0), float(of.nonlinearity) * size)
        common = row[f"common_{side}_Nm"]
        shared.append(float(common) if isinstance(common, float) else plain / RECTANGULAR)
    return math.hypot(own, *shared)


def _speed_step(row: Mapping[str, Cell], side: str, calibration: Calibration | None) -> float | None:
    """Standard uncertainty of a mean speed from the step of its encoder [rad/s]."""
    counts, seconds = 0 if calibration is None else calibration.counts_per_rev[side], row["seconds"]
    if not counts or not isinstance(seconds, float) or seconds <= 0.0:
        return None
    return REVOLUTION / float(counts) / seconds / ENDS

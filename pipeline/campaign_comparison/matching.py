"""Points of two campaigns matched by what was set, one to one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from pmg.pipeline.wording.quantities import SPEED_OF_SHAFT, TORQUE_OF_SHAFT, quantity
from pmg.sim.errors import GridError
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.grid import Grid, OperatingPoints
    from pmg.sim.signals import Array

    Rows = npt.NDArray[np.intp]

REPEAT_WEIGHT = 1e-2
"""Cost of one place in the order of repeats, in squared tolerances: it decides between points that lie a tenth of the
tolerance apart, and leaves all others to their distance."""

OUT_OF_REACH = 1e6
"""Cost of a pair that is no match: more than all that are, so that as many points as possible find a partner."""


@dataclass(frozen=True)
class Reach:
    """Distances within which two points are the same test.

    Parameters
    ----------
    speed : float
        Of either shaft [rad/s].
    load : float
        Load asked for [N m].
    """

    speed: float = 5.0 * RPM
    load: float = 0.02

    def __post_init__(self) -> None:
        given = (("--speed-tolerance", self.speed / RPM, "rpm"), ("--load-tolerance", self.load, "N m"))
        for option, value, unit in given:
            if not (np.isfinite(value) and value > 0.0):
                raise GridError(option, f"{value:g} {unit}", "a finite value above 0", "Give a positive tolerance.")

    @classmethod
    def parsed(cls, speed: str | None, load: str | None) -> Reach:
        """The reach in the words of a user, such as ``"5 rpm"`` and ``"0.02 N m"``."""
        usual = cls()
        return cls(
            usual.speed if speed is None else quantity(speed, SPEED_OF_SHAFT, "--speed-tolerance", GridError),
            usual.load if load is None else quantity(load, TORQUE_OF_SHAFT, "--load-tolerance", GridError),
        )


@dataclass(frozen=True)
class Unmatched:
    """A point without a partner.

    Parameters
    ----------
    row : int
        Row of its grid.
    nearest : int or None
        Row of the other grid that comes nearest, of the same kind; None where there is none of that kind.
    speed_sun, speed_ring, load : float
        How far that one is: its speeds [rad/s] and load [N m] minus those of the point; NaN where there is none.
    why : str
        Why they are no match.
    """

    row: int
    nearest: int | None
    speed_sun: float
    speed_ring: float
    load: float
    why: str


@dataclass(frozen=True)
class Matching:
    """Which points of two campaigns are the same test.

    Parameters
    ----------
    reach : Reach
        Tolerances.
    a, b : (m,) array of int
        Rows of both grids that belong together, in the order of A's points.
    only_a, only_b : tuple of Unmatched
        Points without a partner.
    """

    reach: Reach
    a: Rows
    b: Rows
    only_a: tuple[Unmatched, ...]
    only_b: tuple[Unmatched, ...]

    def __len__(self) -> int:
        return len(self.a)


def match(a: Grid, b: Grid, reach: Reach) -> Matching:
    """Match the accepted points of two grids.

    Notes
    -----
    Only points of one kind can match: same configuration, gear, driving side and shafts at rest. Within a kind, pairs
    within the tolerances are assigned so that as many points as possible find a partner and the sum of the squared
    distances, in tolerances, is least. Repeats of a set-point are paired in the order of time: the first of A with
    the first of B; averaging them first would hide a drift, and pairs of repeats average in the means all the same.
    """
    kinds_a, kinds_b = _kinds(a.points), _kinds(b.points)
    usable_a, usable_b = _in_order(a), _in_order(b)
    pairs: list[tuple[int, int]] = []
    for kind in dict.fromkeys(kinds_a[row] for row in usable_a):
        rows = tuple(
            np.array([row for row in usable if kinds[row] == kind], dtype=np.intp)
            for usable, kinds in ((usable_a, kinds_a), (usable_b, kinds_b))
        )
        if len(rows[1]):
            pairs += _assigned(a.points, b.points, rows[0], rows[1], reach)
    pairs.sort()
    found_a, found_b = (np.array([pair[i] for pair in pairs], dtype=np.intp) for i in (0, 1))
    return Matching(
        reach,
        found_a,
        found_b,
        _left(a, b, kinds_a, kinds_b, set(found_a.tolist()), set(found_b.tolist()), reach),
        _left(b, a, kinds_b, kinds_a, set(found_b.tolist()), set(found_a.tolist()), reach),
    )


def _kinds(at: OperatingPoints) -> list[tuple[object, ...]]:
    """Facts that must be the same for two points to be the same test."""
    columns = (at.configuration, at.gear, at.drive, at.rest_sun, at.rest_ring)
    neutral = at.configuration != "engaged"
    kinds: list[tuple[object, ...]] = []
    for row, (configuration, gear, drive, rest_sun, rest_ring) in enumerate(zip(*columns, strict=True)):
        driving = "" if neutral[row] else str(drive)
        kinds.append((str(configuration), int(gear), driving, bool(rest_sun), bool(rest_ring)))
    return kinds


def _in_order(grid: Grid) -> list[int]:
    """Accepted rows by time, or where that is not known by set-point and reading: whatever order they are listed in."""
    at = grid.points
    keys = (grid.torque_ring, grid.torque_sun, at.load_set, at.speed_ring, at.speed_sun, at.name)
    order = np.lexsort((*keys, np.nan_to_num(at.started_at, nan=np.inf)))
    return [int(row) for row in order if grid.accepted[row]]


def _apart(a: OperatingPoints, b: OperatingPoints, rows_a: Rows, rows_b: Rows) -> Array:
    """B minus A (3, k, l): sun speed, ring speed [rad/s], load [N m]."""
    return np.stack(
        [
            getattr(b, name)[rows_b][None, :] - getattr(a, name)[rows_a][:, None]
            for name in ("speed_sun", "speed_ring", "load_set")
        ]
    )


def _in_tolerances(apart: Array, reach: Reach) -> Array:
    scale = np.array([reach.speed, reach.speed, reach.load])
    return np.asarray(apart / scale.reshape(3, *(1,) * (apart.ndim - 1)))


ROUNDING = 1e-9
"""Allowance beyond a tolerance, relative, for the rounding of numbers."""


def _assigned(
    a: OperatingPoints, b: OperatingPoints, rows_a: Rows, rows_b: Rows, reach: Reach
) -> list[tuple[int, int]]:
    """Pairs of one kind."""
    apart = _in_tolerances(_apart(a, b, rows_a, rows_b), reach)
    within = np.all(np.abs(apart) <= 1.0 + ROUNDING, axis=0)
    turn_a, turn_b = _turns(a, rows_a, reach), _turns(b, rows_b, reach)
    turns = REPEAT_WEIGHT * (turn_a[:, None] - turn_b[None, :]) ** 2
    cost = np.where(within, np.sum(apart**2, axis=0) + turns, OUT_OF_REACH)
    chosen_a, chosen_b = linear_sum_assignment(cost)
    return [(int(rows_a[i]), int(rows_b[j])) for i, j in zip(chosen_a, chosen_b, strict=True) if within[i, j]]


def _turns(at: OperatingPoints, rows: Rows, reach: Reach) -> Array:
    """Count of points of the same set-point before each, rows being in order."""
    near = (np.abs(_in_tolerances(_apart(at, at, rows, rows), reach)) <= 1.0).all(axis=0)
    return np.asarray(np.tril(near, -1).sum(axis=1), dtype=np.float64)


def _left(
    one: Grid,
    other: Grid,
    kinds: list[tuple[object, ...]],
    kinds_other: list[tuple[object, ...]],
    matched: set[int],
    taken: set[int],
    reach: Reach,
) -> tuple[Unmatched, ...]:
    """Points without a partner, each with what comes nearest."""
    left = []
    for row in range(len(one)):
        if row in matched:
            continue
        same = np.array([i for i, kind in enumerate(kinds_other) if kind == kinds[row]], dtype=np.intp)
        if not len(same):
            why = "rejected here" if not one.accepted[row] else "no point of that kind there"
            left.append(Unmatched(row, None, np.nan, np.nan, np.nan, why))
            continue
        apart = _apart(one.points, other.points, np.array([row], dtype=np.intp), same)[:, 0]
        far = np.sum(_in_tolerances(apart, reach) ** 2, axis=0)
        free = np.array([other.accepted[i] and i not in taken for i in same])
        best = int(np.lexsort((~free, far))[0])
        nearest = int(same[best])
        within = bool((np.abs(_in_tolerances(apart[:, best], reach)) <= 1.0 + ROUNDING).all())
        if not one.accepted[row]:
            why = "rejected here"
        elif not within:
            why = "out of tolerance"
        elif not other.accepted[nearest]:
            why = "rejected there"
        else:
            why = "that one has a partner"
        left.append(Unmatched(row, nearest, float(apart[0, best]), float(apart[1, best]), float(apart[2, best]), why))
    return tuple(left)

"""The torques that the source's own simulation gave, as a data set beside the measured ones, and how they differ."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.grid.tables import ROUNDING_PUBLISHED
from pmg.pipeline.thesis_figures.tables import LOADS, SPEEDS, TORQUE_RING, TWICE_RING, printed
from pmg.sim.errors import GridError
from pmg.sim.losscurve import SPEED_REFERENCE_SUN
from pmg.sim.signals import RESIDUAL, SPEED_RING, SPEED_SUN
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pmg.pipeline.thesis_figures.tables import Sample
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array


PATTERN_LEVEL = 0.01
"""p-value below which the differences follow speed, or load."""


@dataclass(frozen=True)
class PatternTest:
    """Test whether a difference changes with speed, or with load.

    Parameters
    ----------
    share : float
        Part of the sum of squares about the mean.
    f, p : float
        F against what neither speed nor load takes, and its p-value.
    """

    share: float
    f: float
    p: float


@dataclass(frozen=True)
class PrintedSimulation:
    r"""Measured torques against those that the source's simulation printed for the same points.

    Parameters
    ----------
    sample : Sample
        The tables.

    Notes
    -----
    Measured and simulated points have the same ring torque and speeds, so the difference of the sun torques is that
    of the total loss torque, referred to the sun: :math:`\Delta T = T_s - \hat T_s = \Delta P / \omega_s`.
    """

    sample: Sample

    @property
    def difference(self) -> Array:
        """Measured less simulated sun torque [N m] (4, 12): one row a load, one column a speed."""
        return np.asarray(self.sample.grid.torque_sun[self.sample.rows] - self.sample.sun)

    @property
    def u(self) -> float:
        """Standard uncertainty of each difference: the rounding of the measured torque [N m]."""
        return ROUNDING_PUBLISHED / math.sqrt(12.0)

    @property
    def speed_ring(self) -> Array:
        """Ring speeds, magnitude [rad/s] (12,)."""
        return np.asarray(np.abs(self.sample.grid.points.speed_ring[self.sample.rows[0]]))

    @property
    def r_squared(self) -> float:
        """Coefficient of determination of the simulated loss power over the 48 points."""
        at = self.sample.grid.points
        w_s, w_r = np.abs(at.speed_sun[self.sample.rows]), np.abs(at.speed_ring[self.sample.rows])
        measured = self.sample.grid.torque_sun[self.sample.rows] * w_s - self.sample.ring * w_r
        return 1.0 - float(np.sum((self.difference * w_s) ** 2) / np.sum((measured - measured.mean()) ** 2))

    @property
    def _dof(self) -> int:
        return (len(LOADS) - 1) * (len(SPEEDS) - 1)

    @property
    def scatter(self) -> float:
        """Standard deviation of what neither speed nor load takes [N m]."""
        d = self.difference
        left = d - d.mean(axis=0) - d.mean(axis=1)[:, None] + d.mean()
        return math.sqrt(float(np.sum(left**2)) / self._dof)

    def pattern(self) -> tuple[PatternTest, PatternTest]:
        """Over speed, and over load: analysis of variance in two ways without repeats."""
        about = self.difference - self.difference.mean()
        of_speed, of_load = about.mean(axis=0), about.mean(axis=1)
        total, dof, noise = float(np.sum(about**2)), self._dof, self.scatter**2
        found = []
        for effect, across in ((of_speed, len(of_load)), (of_load, len(of_speed))):
            squares, own = across * float(np.sum(effect**2)), len(effect) - 1
            f = squares / own / noise
            found.append(PatternTest(squares / total, f, float(stats.f.sf(f, own, dof))))
        return found[0], found[1]


def printed_simulation(grid: Grid) -> PrintedSimulation | None:
    """The data set beside a grid; None where that is not the thesis's."""
    if grid.origin != "published":
        return None
    try:
        return PrintedSimulation(printed(grid))
    except GridError:
        return None


def oddities(grid: Grid) -> tuple[tuple[str, str], ...]:
    """What a reader of the source's tables should know first, each with its chapter; none of other grids."""
    found = printed_simulation(grid)
    if found is None:
        return ()
    used = grid.torque_ring[found.sample.rows]
    twice = ((text, "printed-simulation") for text in _printed_twice(used))
    return (*twice, (_ring_follows_sun(grid), "neutral"), (_pattern_sentence(found), "printed-simulation"))


def _printed_twice(used: Array) -> tuple[str, ...]:
    return tuple(
        f"At {SPEED_SUN.display(SPEEDS[j]):.0f} rpm and {LOADS[i]:.2f} N m the source prints two measured ring "
        f"torques: {value:.2f} N m in table A.5 and {TORQUE_RING[i, j]:.4f} N m in table 6.3. "
        + ("The second fits its neighbours and is used." if used[i, j] == TORQUE_RING[i, j] else "The first is used.")
        for (i, j), value in TWICE_RING.items()
    )


def _ring_follows_sun(grid: Grid) -> str:
    at = grid.points
    turning = at.neutral & grid.accepted & ~at.rest_ring
    speed, row = np.unique(np.round(SPEED_SUN.display(np.abs(at.speed_sun[turning]))), return_inverse=True)
    mean = np.bincount(row, grid.torque_ring[turning]) / np.bincount(row)
    least = int(np.argmin(mean))
    rest, top = (RESIDUAL.display(mean[i] - mean[least]) for i in (0, -1))
    return (
        f"The ring's no-load torque follows the sun's speed: it is {rest:.0f} mN m higher with the sun at rest, and "
        f"{top:.0f} at {speed[-1]:.0f} rpm, than at {speed[least]:.0f} rpm. Bearings of the ring alone do not do that."
    )


def _pattern_sentence(found: PrintedSimulation) -> str:
    mean, speed = RESIDUAL.display(found.difference.mean(axis=0)), SPEED_RING.display(found.speed_ring)
    low = int(np.argmin(mean))
    shown = (0, low, -1)
    sizes = ", ".join(f"{mean[i]:+.0f}" for i in shown).replace("-", "−")
    _, of_load = found.pattern()
    same = of_load.p >= PATTERN_LEVEL
    alike = "one pattern over speed, the same at all loads" if same else "a pattern over speed and load"
    return (
        f"The source's simulation misses its loss by {alike}: measured − simulated {sizes} mN m at the sun "
        f"at {', '.join(f'{speed[i]:.0f}' for i in shown)} rpm of the ring. Its R² of {found.r_squared:.3f} hides it."
    )


RECOVERED_POWERS = (0.0, 1.0, 2.0, 3.0, 4.0)
"""Terms of the loss torque that the printed torques follow, to 0.14 mN m."""


def recovered_losses(
    grid: Grid, model: LossModel, bench: BenchParameters, torques: tuple[Array, ...] | None = None
) -> LossModel:
    """The losses with which the source's 48 printed sun torques come out.

    Parameters
    ----------
    grid : Grid
        The published grid.
    model : LossModel
        Ring curve, K_corr and damping constants, which are kept.
    bench : BenchParameters
        Numbers of the bench.
    torques : tuple of (4, 12) array, optional
        Of sun and ring in place of those printed, as drawn within their last digit [N m].

    Raises
    ------
    GridError
        The grid is not the thesis's.

    Notes
    -----
    The torques determine the total loss torque, referred to the sun, as a polynomial of degree four in speed; how it
    divides between sun, ring and gear they do not tell. Here the ring and the gear keep theirs, and the sun's curve
    takes what is left, by least squares over the 48 points.
    """
    sample = printed(grid)
    at = grid.points[sample.rows.ravel()]
    sun, ring = torques or (sample.sun, sample.ring)
    at = replace(at, torque_ring=ring.ravel())
    curve = replace(
        model.curve_sun,
        powers=RECOVERED_POWERS,
        coefficients=np.zeros(len(RECOVERED_POWERS)),
        speed_reference=SPEED_REFERENCE_SUN,
    )

    def torque(coefficients: Array) -> Array:
        of_sun = replace(model, curve_sun=replace(curve, coefficients=coefficients))
        return steady(Gearbox.calibrated(bench, of_sun), at).torque_sun

    bare = torque(curve.coefficients)
    design = np.stack([torque(unit) - bare for unit in np.eye(len(RECOVERED_POWERS))], axis=1)
    found = np.linalg.lstsq(design, sun.ravel() - bare, rcond=None)[0]
    return replace(model, curve_sun=replace(curve, coefficients=np.asarray(found, dtype=np.float64)))

"""Least squares within bounds: solved, and brought to where its last digits are settled, on any processor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from pmg.pipeline.fit.span import lengths
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

STEP = 1e-2
"""Step of the central differences, in usual sizes of a parameter: so wide that rounding is nothing compared with it."""

AT_BOUND = 1e-4
"""Distance from a bound, in usual sizes of a parameter, below which the parameter sits on it."""

RISE = 1e-5
"""Relative rise of the sum of squares that putting parameters on their bounds may cost."""

FLAT = 1e-8
"""Ratio of curvatures (slopes of unit length) below which a direction is left as it is."""

WITHOUT_EFFECT = 1e-6
"""Change of all rows together [standard deviations of their noise] by the usual size of a parameter, below which it has
no effect compared with the others."""

SETTLED = 1e-8
"""Length of a step, in standard deviations of the noise of all rows together, after which the next changes nothing."""

SLOW = 0.5
"""Length of a step over that of the one before, above which the curvature is made anew."""

MOST_ROUNDS = 12
"""Newton steps at most."""


@dataclass(frozen=True)
class SettledFit:
    """A minimum of a sum of squares.

    Parameters
    ----------
    values : (k,) array
        The parameters.
    free : (k,) array of bool
        Those inside their bounds.
    cost : float
        Sum of squares.
    """

    values: Array
    free: Mask
    cost: float


def settle(residuals: Callable[[Array], Array], start: Array, size: Array, bounds: Array) -> SettledFit:
    r"""The minimum near which a search has stopped, as exactly as the residuals are known.

    Parameters
    ----------
    residuals : callable
        Whitened residuals (m,) of parameters (k,).
    start : (k,) array
        Where the search stopped.
    size : (k,) array
        Usual sizes of the parameters.
    bounds : (2, k) array
        Their bounds.

    Notes
    -----
    A search stops once the sum of squares hardly falls, and there its last steps hang on the rounding of the linear
    algebra below, which differs from processor to processor. Newton steps go on to where the gradient
    :math:`J^T r` vanishes. Its slopes are central differences with wide steps; the curvature
    :math:`J^T J + \sum_i r_i \nabla^2 r_i` need not be exact: it is made once, and anew where steps do not shrink
    or a parameter reaches a bound. A parameter without effect compared with the others takes its usual size. Where
    this leads uphill, the search's own result is kept.
    """
    low, high = bounds
    begin = _snapped(start, size, bounds)
    values, free = begin, (begin > low) & (begin < high)
    left, curvature, last = residuals(values), None, np.inf
    for _ in range(MOST_ROUNDS):
        if not free.any():
            break
        at, width, up, down = _central_steps(residuals, values, free, (size, bounds))
        slopes = (up - down) / (2.0 * width)
        values = values.copy()
        without = at[np.linalg.norm(slopes, axis=0) * size[at] < WITHOUT_EFFECT]
        values[without] = np.clip(size, low, high)[without]
        if curvature is None:
            curvature = slopes.T @ slopes + _bend(residuals, values, left, (at, width), (up, down))
        step = _newton(curvature, slopes, left)
        values[at] = np.clip(values[at] + step, low[at], high[at])
        left, length = residuals(values), float(np.linalg.norm(slopes @ step))
        free = (values > low) & (values < high)
        if free[at].all() and length < SETTLED:
            break
        if not free[at].all() or length > SLOW * last:
            curvature = None
        last = length
    searched, at_bounds = residuals(start), _snapped(values, size, bounds)
    cost, found = float(left @ left), float(searched @ searched)
    if (at_bounds != values).any():  # what ends next to a bound is on it, as what began there
        on_bounds = settle(residuals, at_bounds, size, bounds)
        values, free, cost = on_bounds.values, on_bounds.free, on_bounds.cost
    if cost <= found + RISE * max(found, 1.0):
        return SettledFit(values, free, cost)
    return SettledFit(start, (begin > low) & (begin < high), found)


def _snapped(values: Array, size: Array, bounds: Array) -> Array:
    """The parameters (k,), those next to a bound put on it."""
    low, high = bounds
    return np.where(values - low <= AT_BOUND * size, low, np.where(high - values <= AT_BOUND * size, high, values))


def slopes_at(residuals: Callable[[Array], Array], fit: SettledFit, size: Array, bounds: Array) -> Array:
    """Slopes (m, j) of the residuals to the parameters of a settled fit that are inside their bounds."""
    _, width, up, down = _central_steps(residuals, fit.values, fit.free, (size, bounds))
    return np.asarray((up - down) / (2.0 * width))


def _central_steps(
    residuals: Callable[[Array], Array], values: Array, free: Mask, scale: tuple[Array, Array]
) -> tuple[npt.NDArray[np.intp], Array, Array, Array]:
    """Free parameters, their steps (j,), and the residuals with each moved up and down by its step (m, j)."""
    (size, (low, high)), at = scale, np.flatnonzero(free)
    width = np.minimum(STEP * size, 0.5 * np.minimum(values - low, high - values))[at]
    moves = np.zeros((len(at), len(values)))
    moves[np.arange(len(at)), at] = width
    up, down = (np.array([residuals(values + sign * move) for move in moves]).T for sign in (1.0, -1.0))
    return at, width, up, down


def _bend(
    residuals: Callable[[Array], Array],
    values: Array,
    left: Array,
    steps: tuple[npt.NDArray[np.intp], Array],
    moved_residuals: tuple[Array, Array],
) -> Array:
    """Second derivatives of the residuals, each times its residual and added up (j, j)."""
    (at, width), (up, down) = steps, moved_residuals
    bend = np.diag(left @ (up + down - 2.0 * left[:, None]) / width**2)
    for i, j in combinations(range(len(at)), 2):
        moved = values.copy()
        moved[at[[i, j]]] += width[[i, j]]
        mixed = residuals(moved) - up[:, i] - up[:, j] + left
        bend[i, j] = bend[j, i] = float(left @ mixed) / (width[i] * width[j])
    return bend


def _newton(curvature: Array, slopes: Array, left: Array) -> Array:
    """The step (j,) to where the gradient vanishes, along directions that curve upwards."""
    length = lengths(slopes)
    bent, way = np.linalg.eigh(curvature / np.outer(length, length))
    sure = bent > FLAT * bent.max(initial=0.0)
    along = way[:, sure]
    return np.asarray(-(along @ ((along.T @ (slopes.T @ left / length)) / bent[sure])) / length)


@dataclass(frozen=True)
class BoundedProblem:
    """Bounded least squares of the readings over the free parameters.

    Parameters
    ----------
    names : tuple of str
        The parameters.
    lower, upper, scale, begin : (k,) array
        Their bounds, usual sizes, and where the search begins.
    residuals, slopes : callable
        From their values: (m,) weighted residuals, and (m, k) derivatives of these.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    scale: Array
    begin: Array
    residuals: Callable[[Array], Array]
    slopes: Callable[[Array], Array]

    def step(self, weights: Array, values: Array) -> tuple[Array, Array]:
        """Gauss-Newton step with further weights (m,) within the bounds: values (k,), and the residuals they leave."""
        root, slopes = np.sqrt(weights), self.slopes(values) * self.scale
        found = lsq_linear(
            slopes * root[:, None],
            (slopes @ (values / self.scale) - self.residuals(values)) * root,
            (self.lower / self.scale, self.upper / self.scale),
            method="bvls",
        )
        return found.x * self.scale, self.residuals(found.x * self.scale)

    def solve(self, weights: Array) -> tuple[Array, str]:
        """Values (k,) of the minimum with further weights (m,), those at a bound on it, and why the solver stopped."""
        root = np.sqrt(weights)

        def residuals(values: Array) -> Array:
            return self.residuals(values) * root

        def slopes(values: Array) -> Array:
            return self.slopes(values) * root[:, None]

        found = least_squares(
            residuals,
            self.begin,
            jac=slopes,
            bounds=(self.lower, self.upper),
            x_scale=self.scale,
            xtol=1e-12,
            ftol=1e-12,
        )
        if not found.success:
            came = f"no convergence ({found.message})"
            raise FitError("calibration", came, "a minimum", "Check the grids for outliers.")
        margin = 1e-4 * self.scale
        values = np.where(found.x - self.lower < margin, self.lower, found.x)
        return np.where(self.upper - values < margin, self.upper, values), str(found.message)

"""Covariance of rows that the white noise of transducer and encoders makes through the filters, in time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pmg.pipeline.motion.smooth import PER_ROW, row_weights
from pmg.sim.shafts import other_side

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.motion.smooth import SmoothRun
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array, Mask


class _ShownOf(NamedTuple):
    """What rows show of a white sequence: its size at the n fine samples (n,), the weights (w,) of samples in a row."""

    size: Array
    weights: Array


def filtered_noise(stretch: RotorRows, inertia: float, stiffness: PerShaft[float]) -> Array:
    r"""Covariance (m, b) of each row of a run with as many later ones, by what the filters leave [(N m)2].

    Parameters
    ----------
    stretch : RotorRows
        Of the rotor.
    inertia : float
        Upstream of the transducer too [kg m2].
    stiffness : PerShaft of float
        Torque on the rotor per angle of either encoder [N m/rad]; zero in neutral.

    Notes
    -----
    A row is a sum of samples with weights w, and a source of density S that is m(t) times as large at some instant adds
    :math:`\tfrac12 f_s S \sum_t w_i(t) w_j(t) m^2(t)`. The size m goes by steps of a fine sample.
    """
    run, found = stretch.run, np.zeros((len(stretch.run), 1))
    for density, one, another in _sources(stretch, inertia, stiffness):
        shared = _shared(run, one.weights, another.weights)
        reach = len(shared) // 2
        around = sliding_window_view(np.pad(one.size * another.size, reach, mode="edge"), len(shared))
        around = around[len(run.weights) // 2 :: PER_ROW][: len(run)]
        found = found + 0.5 * run.run.rate * density * (around @ shared)
    return found


def banded_rows(by_row: Array, rows: Mask) -> Array:
    """Covariance (b, n) of n `rows` with those that come next, from that of each (m, b) with the b later ones."""
    at, length = np.flatnonzero(rows), by_row.shape[1]
    found = np.zeros((length, len(at)))
    for later in range(min(length, len(at))):
        first = at[: len(at) - later]
        apart = at[later:] - first
        found[later, : len(first)] = np.where(apart < length, by_row[first, np.minimum(apart, length - 1)], 0.0)
    return found


def _sources(
    stretch: RotorRows, inertia: float, stiffness: PerShaft[float]
) -> Iterator[tuple[float, _ShownOf, _ShownOf]]:
    """What two parts of the rows have in common: its density, one-sided, and what they show of it."""
    run, side, other = stretch.run, stretch.side, other_side(stretch.side)
    own, (value, curvature) = stretch.shaft, row_weights(run)
    torque = _ShownOf(np.ones(len(run.time)), value)
    yield own.density, torque, torque
    if stretch.at_rest:
        return

    def in_time(of: str, *, bent: bool) -> Array:
        course = run.shafts[of].angle_noise.course
        return np.interp(run.time, course.time, course.curvature if bent else course.value)

    of_own, of_other = (run.shafts[of].angle_noise for of in (side, other))
    turned = _ShownOf(in_time(side, bent=True), inertia * curvature)
    yield of_own.density, turned, turned
    if not stiffness[side]:
        return
    twisted = _ShownOf(in_time(side, bent=False), stiffness[side] * value)
    across = _ShownOf(in_time(other, bent=False), stiffness[other] * value)
    yield of_own.value_density, twisted, twisted
    yield of_other.value_density, across, across
    for density, one, another in (
        (math.sqrt(of_own.density * of_own.value_density), turned, twisted),
        (run.common, turned, across),
        (run.common, twisted, across),
    ):
        yield density, one, another
        yield density, another, one


def _shared(run: SmoothRun, one: Array, another: Array) -> Array:
    """Products (f, b) of the weights of samples in a row and in one b later, by fine sample about the first."""
    width, fine = len(one), round(run.run.rate / run.fine_rate)
    at = (np.arange(width) - width // 2 + fine // 2) // fine
    reach, step = max(at[-1], -at[0]), PER_ROW * fine
    found = np.zeros((2 * reach + 1, width // step + 1))
    for later in range(found.shape[1]):
        np.add.at(found[:, later], reach + at[later * step :], one[later * step :] * another[: width - later * step])
    return found

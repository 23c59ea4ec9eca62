"""Covariance of rows that the white noise of transducer and encoders makes through the filters, in time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pmg.pipeline.motion.smooth import MOST_COMMON, PER_ROW, row_weights
from pmg.sim.shafts import other_side

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.motion.smooth import SmoothRun
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array, Mask


LEAST = 1e-30
"""Smallest density of the noise of both angles that is divided by [rad2/Hz]: a channel may have none."""


class _Part(NamedTuple):
    """A part of the noise of a row: the size of its white sequence at the n fine samples, weights (w,) of samples."""

    size: Array
    weights: Array


def filtered_noise(stretch: RotorRows, inertia: float, stiffness: PerShaft[float]) -> tuple[Array, Array]:
    r"""Covariance (m, b) of each row of a run with b later ones, by what the filters leave of torque and of angles.

    Parameters
    ----------
    stretch : RotorRows
        Of the rotor.
    inertia : float
        Upstream of the transducer too [kg m2].
    stiffness : PerShaft of float
        Torque on the rotor per angle of either encoder [N m/rad]; zero in neutral.

    Returns
    -------
    of_torque, of_angles : (m, b) array
        [(N m)2].

    Notes
    -----
    A row is a sum of samples with weights w, and a source of the one-sided density S(t) adds
    :math:`\tfrac12 f_s \sum_t w_i(t) w_j(t) S(t)`; S changes in steps of a fine sample.
    """
    run = stretch.run

    def covariance(together: Array | float, one: _Part, another: _Part) -> Array:
        shared = _shared(run, one.weights, another.weights)
        power, reach = together * one.size * another.size, len(shared) // 2
        around = sliding_window_view(np.pad(power, reach, mode="edge"), len(shared))
        around = around[len(run.weights) // 2 :: PER_ROW][: len(run)]
        return np.asarray(0.5 * run.run.rate * (around @ shared))

    of_torque, *of_angles = (covariance(*parts) for parts in _parts(stretch, inertia, stiffness))
    return of_torque, sum(of_angles, start=np.zeros_like(of_torque))


def banded_rows(by_row: Array, rows: Mask) -> Array:
    """Covariance (b, n) of n `rows` with those that come next, from that of each (m, b) with the b later ones."""
    at, length = np.flatnonzero(rows), by_row.shape[1]
    found = np.zeros((length, len(at)))
    for later in range(min(length, len(at))):
        first = at[: len(at) - later]
        apart = at[later:] - first
        found[later, : len(first)] = np.where(apart < length, by_row[first, np.minimum(apart, length - 1)], 0.0)
    return found


def _parts(
    stretch: RotorRows, inertia: float, stiffness: PerShaft[float]
) -> Iterator[tuple[Array | float, _Part, _Part]]:
    """Parts of the rows two by two, each of them with itself too, and how far their white sequences go together."""
    run, side, other = stretch.run, stretch.side, other_side(stretch.side)
    own, (value, curvature) = stretch.shaft, row_weights(run)
    of_torque = _Part(np.full(len(run.time), math.sqrt(own.density)), value)
    yield 1.0, of_torque, of_torque
    if stretch.at_rest:
        return

    noise, others = (run.shafts[of].angle_noise for of in (side, other))
    of_acceleration = _Part(np.sqrt(noise.density_at(run.time)), inertia * curvature)
    yield 1.0, of_acceleration, of_acceleration
    if not stiffness[side]:
        return
    of_own = _Part(np.sqrt(noise.value_density_at(run.time)), stiffness[side] * value)
    of_other = _Part(np.sqrt(others.value_density_at(run.time)), stiffness[other] * value)
    product = np.sqrt(noise.density_at(run.time) * others.density_at(run.time))
    common = np.clip(run.common / np.maximum(product, LEAST), -MOST_COMMON, MOST_COMMON)
    yield 1.0, of_own, of_own
    yield 1.0, of_other, of_other
    for together, one, another in (
        (1.0, of_acceleration, of_own),
        (common, of_acceleration, of_other),
        (common, of_own, of_other),
    ):
        yield together, one, another
        yield together, another, one


def _shared(run: SmoothRun, one: Array, another: Array) -> Array:
    """Products (f, b) of the weights of samples in a row and in one b later, by fine sample about the first."""
    width, fine = len(one), round(run.run.rate / run.fine_rate)
    at = (np.arange(width) - width // 2 + fine // 2) // fine
    reach, step = max(at[-1], -at[0]), PER_ROW * fine
    found = np.zeros((2 * reach + 1, width // step + 1))
    for later in range(found.shape[1]):
        np.add.at(found[:, later], reach + at[later * step :], one[later * step :] * another[: width - later * step])
    return found

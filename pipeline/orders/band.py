"""The noise at a line, from the spectrum next to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, special

from pmg.sim import sources

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

FALSE_ALARM = 0.05
"""Part of the lines of pure noise whose amplitude exceeds its band."""
NEIGHBOURS = 40
"""Bins next to a line whose noise is taken."""
FEWEST = 8
"""Fewest of them from which a band is made."""
KEPT_CLEAR = 2.0
"""Bins on either side of a fitted line that it has emptied."""
LOWEST_BIN = 2
"""First bin that the fitted trend leaves alone."""
WIDEST = 3.0
"""Neighbours lie within this factor of the line's frequency."""
STRAY = 1e-3
"""A neighbour less probable than this is another line, and no noise."""
ROUNDS = 6
TINY = float(np.finfo(np.float64).tiny)

SOURCE = sources.PERCIVAL_WALDEN.at("sections 6.6 and 7.3: distribution of the periodogram, log-linear models of it")


@dataclass(frozen=True)
class LineNoise:
    """Noise at lines, for each signal.

    Parameters
    ----------
    power : (s, ...) array
        Expected squared amplitude of a line of pure noise, in the square of the signal's unit; NaN without
        neighbours.
    dof : (s, ...) array
        Degrees of freedom of `power`.
    """

    power: Array
    dof: Array

    def band(self, false_alarm: float = FALSE_ALARM) -> Array:
        """Amplitude that a line of pure noise exceeds with this probability."""
        known = np.isfinite(self.power)
        dof = np.where(known, self.dof, 1.0)
        return np.where(known, np.sqrt(special.fdtri(2.0, dof, 1.0 - false_alarm) * self.power), np.nan)


def periodogram(x: Array) -> Array:
    """Squared amplitude of each frequency bin of signals without mean and trend.

    Parameters
    ----------
    x : (s, n) array
        Signals.

    Returns
    -------
    (s, n // 2 + 1) array
        In the square of the signal's unit; for noise its mean is that of a least-squares amplitude squared.
    """
    found = fft.rfft(x, axis=-1)
    return np.asarray((found.real**2 + found.imag**2) * (2.0 / x.shape[-1]) ** 2, dtype=np.float64)


def emptied(bins: int, lines: npt.ArrayLike) -> Mask:
    """Bins that a fit of a trend and of lines at these places [bins] has emptied."""
    gone = np.zeros(bins, dtype=np.bool_)
    gone[:LOWEST_BIN] = gone[-1] = True
    for line in np.asarray(lines).tolist():
        gone[max(0, math.ceil(line - KEPT_CLEAR)) : max(0, math.floor(line + KEPT_CLEAR) + 1)] = True
    return gone


def noise_around(power: Array, gone: Mask, line: npt.ArrayLike) -> LineNoise:
    r"""Noise at a line from the residual's periodogram next to it.

    Parameters
    ----------
    power : (s, b) array
        From `periodogram`, of what the fit leaves.
    gone : (b,) array of bool
        Bins not to be used.
    line : (...) array
        Place of the line, or of each line [bins].

    Notes
    -----
    The nearest `NEIGHBOURS` bins are fitted by :math:`\log S = a + b\log(f/f_0)`, so noise that falls with frequency
    does not bias the level at the line. A bin of noise is exponential with mean S; the likelihood of that is made
    largest by iterated least squares. Its variance h at the line makes the ratio of a line's power to the level
    follow F with 2 and 2/h degrees of freedom. Bins that stand out by more than `STRAY` allows are other lines and
    are left out.

    References
    ----------
    `SOURCE`.
    """
    at, known = _neighbours(gone, np.asarray(line, dtype=np.float64)[..., None])
    x = np.log(np.where(known, at / np.asarray(line)[..., None], 1.0))
    y = np.where(known, np.maximum(power[:, at], TINY), 1.0)
    weight = np.broadcast_to(known, y.shape).astype(np.float64)
    level = np.log(np.maximum((weight * y).sum(axis=-1), TINY) / np.maximum(weight.sum(axis=-1), 1.0))
    slope = np.zeros_like(level)
    for round_ in range(ROUNDS):
        fitted = np.exp(np.clip(level[..., None] + slope[..., None] * x, -700.0, 700.0))
        ratio = y / fitted
        if round_ in (ROUNDS // 2, ROUNDS - 2):
            weight = np.where(ratio > -np.log(STRAY), 0.0, known)
        step_level, step_slope, _ = _weighted_line(x, ratio - 1.0, weight)
        level = level + np.clip(step_level, -2.0, 2.0)
        slope = slope + np.clip(step_slope, -2.0, 2.0)
    _, _, variance = _weighted_line(x, np.zeros_like(y), weight)
    enough = weight.sum(axis=-1) >= FEWEST
    kept = 1.0 + STRAY * np.log(STRAY) / (1.0 - STRAY)  # mean of what is left of noise, relative to that of all
    dof = 2.0 / np.where(enough, variance, 1.0)
    return LineNoise(np.where(enough, np.exp(level) / kept, np.nan), np.where(enough, dof, np.nan))


def _neighbours(gone: Mask, line: Array) -> tuple[npt.NDArray[np.intp], Mask]:
    """The nearest bins to each line (..., 1) that may be used (..., `NEIGHBOURS`), and which of them there are."""
    usable = np.append(np.flatnonzero(~gone), -1)
    near = np.searchsorted(usable[:-1], line) + np.arange(-NEIGHBOURS, NEIGHBOURS)
    at = usable[np.where((near >= 0) & (near < len(usable)), near, -1)]
    distance = np.where((at <= line * WIDEST) & (at * WIDEST >= line), np.abs(at - line), np.inf)
    nearest = np.sort(np.argsort(distance, axis=-1, kind="stable")[..., :NEIGHBOURS], axis=-1)
    return np.take_along_axis(at, nearest, -1), np.isfinite(np.take_along_axis(distance, nearest, -1))


def _weighted_line(x: Array, y: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Level at x = 0, slope, and variance of the level for unit variance of each value."""
    w, wx, wxx = weight.sum(axis=-1), (weight * x).sum(axis=-1), (weight * x**2).sum(axis=-1)
    wy, wxy = (weight * y).sum(axis=-1), (weight * x * y).sum(axis=-1)
    determinant = np.maximum(w * wxx - wx**2, TINY)
    return (wxx * wy - wx * wxy) / determinant, (w * wxy - wx * wy) / determinant, wxx / determinant

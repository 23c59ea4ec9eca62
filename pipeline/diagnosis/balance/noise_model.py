"""Noise of a record that follows nothing: an autoregression that whitens it, and the spectrum of what is left."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.serial import fit_noise
from pmg.pipeline.fit.span import orthonormal, taken_out

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array

ROUNDS = 2
"""Times that the structure is taken out of whitened rows, and the noise fitted to what that leaves."""

NARROWEST, WIDENING, WIDE = 12, 1.3, 1.0 / 30.0
"""Frequencies of the lowest band of a spectrum, growth from band to band, and widest band as part of the spectrum.

Chosen on 80 clean campaigns of other machines and 40 clean drives of the tests: with them 4 and 1 lie below 5 %.
"""

FREE = 0.15
"""Part of the power of a band that structure must have left, for the noise in it to be known; else it goes with its
neighbours."""

LEAST_KNOWN = 1.0
"""Frequencies by which the power of any band is known at least: a spectrum is smooth, so neighbours tell it too."""

TURNS, LEAST_SHARED = 3, 0.5
"""Times that the noise which all rows share is found anew beside that of single ones, and its least size, over the
median of theirs."""

SPREAD = (1.5, 3.0, 10.0)
"""Standard deviations of a row, over that which all share, between which rows are of one kind: what a row has of its
own is an upper bound, so that those with much of it hold less than they are divided by."""

SILENT = 1e-12
"""Least power of a band [of noise of unit variance]: a record without noise has none."""


@dataclass(frozen=True)
class Bands:
    """Bands of the spectrum of n whitened rows, from which columns were projected out.

    Parameters
    ----------
    rows : int
        The n.
    edges : (b + 1,) array of int
        First frequency of each band, and one beyond the last.
    free : (b,) array
        Frequencies of each band that are left: each column takes one in all.
    """

    rows: int
    edges: npt.NDArray[np.int64]
    free: Array

    @classmethod
    def of(cls, basis: Array) -> Bands:
        """Bands of rows from which an orthonormal basis (n, k) was projected out."""
        rows = len(basis)
        last = rows // 2 + 1
        edges, width = [1], float(NARROWEST)
        while edges[-1] + 2 * width < last:
            edges.append(edges[-1] + round(width))
            width = min(WIDENING * width, max(WIDE * last, NARROWEST))
        bounds = np.array([*edges, last], dtype=np.int64)
        taken = np.sum(np.abs(np.fft.rfft(basis, axis=0)) ** 2, axis=1) / rows
        return cls(rows, bounds, np.add.reduceat(np.maximum(1.0 - taken, 0.0), bounds[:-1]))

    def power(self, left: Array) -> Array:
        """Power of each band (b,), what was projected out with the columns made up for."""
        square = np.abs(np.fft.rfft(left)) ** 2 / self.rows
        power = np.add.reduceat(square, self.edges[:-1]) / np.maximum(self.free, SILENT)
        known = self.free > FREE * np.diff(self.edges)
        if known.any():
            level = np.log(np.maximum(power, SILENT))
            power = np.exp(np.interp(self.centres, self.centres[known], level[known]))
        return np.maximum(power, SILENT)

    @property
    def centres(self) -> Array:
        """Middle of each band (b,) [cycles a row]."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1] - 1) / self.rows)

    def draw(self, power: Array, draws: int, rng: np.random.Generator) -> Array:
        """Noise anew (n, draws) whose power may be off by what the free frequencies of each band do not tell."""
        free = np.maximum(self.free, LEAST_KNOWN)[:, None]
        level = np.log(power[:, None] * free / rng.gamma(free, size=(len(free), draws)))
        at = np.interp(np.fft.rfftfreq(self.rows), self.centres, np.arange(len(power)))
        below = at.astype(np.int64)
        above = np.minimum(below + 1, len(power) - 1)
        part = (at - below)[:, None]
        shape = np.exp(0.5 * ((1.0 - part) * level[below] + part * level[above]))
        spectrum = np.fft.rfft(rng.standard_normal((self.rows, draws)), axis=0)
        return np.asarray(np.fft.irfft(shape * spectrum, self.rows, axis=0))


@dataclass(frozen=True)
class NoiseModel:
    """Noise of a record, and how well it is known.

    Parameters
    ----------
    noise : SerialNoise
        The autoregression that whitens it.
    bands : Bands
        Of the whitened rows.
    power : (b,) array
        Power that the whitened noise has in each band; one where the autoregression is right.
    size : (n - p,) array
        Standard deviation that it has in each row; one in those without much noise of their own.
    """

    noise: SerialNoise
    bands: Bands
    power: Array
    size: Array

    def whitened_draws(self, draws: int, rng: np.random.Generator) -> Array:
        """Whitened synthetic noise (n - p, draws)."""
        return self.noise.without_joins(self.size[:, None] * self.bands.draw(self.power, draws, rng))


def noise_of(residual: Array, structured: Array, starts: tuple[int, ...] = (), own: Array | None = None) -> NoiseModel:
    """Noise of a record: what is left when every structure is projected out.

    Parameters
    ----------
    residual : (n,) array
        Force, or what a regression left of it [N].
    structured : (n, k) array
        Baseline, families and terms.
    starts : tuple of int
        Samples with which further recordings begin.
    own : (n,) array, optional
        Standard deviation that a row has beside the noise of all [N].

    Notes
    -----
    Projecting out columns of plain rows fills the quiet part of a spectrum with what the columns hold there, so they
    are projected out of whitened rows. That takes the noise at their frequencies along: an autoregression knows
    nothing of it, so the spectrum of the whitened rows is averaged over bands, each over the frequencies that are
    free. Synthetic noise has that spectrum; the scale of the autoregression is set by the median of its bands. Rows
    with noise of their own are divided by what that makes of theirs, which calls for the noise of the others: it is
    found in turns.
    """
    rows = np.c_[structured, residual]
    noise = _fitted(rows, starts)
    for _ in range(ROUNDS):
        noise = _fitted_anew(noise, rows)
    found = _in_bands(noise, rows)
    if own is None or not own.any():
        return found
    least, level = LEAST_SHARED * float(np.median(own)), found.noise.sigma / noise.sigma
    for _ in range(TURNS):
        spread = np.hypot(1.0, own / max(level * noise.standard_deviation, least))
        even = rows / spread[:, None]
        noise = _fitted_anew(noise, even)
    found = _in_bands(noise, even, spread)
    return replace(found, noise=replace(found.noise, spread=spread))


def _fitted(rows: Array, starts: tuple[int, ...]) -> SerialNoise:
    """Noise of structure and residual (n, k + 1) whose rows are off by as much."""
    left, rank = taken_out(rows[:, :-1], rows[:, -1])
    return fit_noise(left, spent=rank, starts=starts)


def _fitted_anew(noise: SerialNoise, rows: Array) -> SerialNoise:
    """The same where the structure is taken out of what is new in each row by the noise as found before."""
    white = noise.innovations(rows)
    left, rank = taken_out(white[:, :-1], white[:, -1])
    return fit_noise(noise.coloured(left), spent=rank, starts=noise.starts)


def _in_bands(noise: SerialNoise, rows: Array, spread: Array | None = None) -> NoiseModel:
    """How much of it each band of the whitened rows (n - p, k + 1) holds; its size by the rows that tell it."""
    white = noise.whiten(rows)
    basis, last = orthonormal(white[:, :-1]), white[:, -1]
    bands, left = Bands.of(basis), last - basis @ (basis.T @ last)
    power = bands.power(left)
    size = _sizes(left, np.ones(len(left)) if spread is None else spread[noise.lags :])
    level = float(np.median(power)) / float(np.mean(size**2))
    return NoiseModel(replace(noise, sigma=noise.sigma * math.sqrt(level)), bands, power / np.median(power), size)


def _sizes(left: Array, spread: Array) -> Array:
    """Size of the whitened noise in rows (m,) of about as much of their own, over that in rows of little."""
    classes = np.digitize(spread, SPREAD)
    square = [float(np.mean(left[classes == k] ** 2)) if (classes == k).any() else 1.0 for k in range(len(SPREAD) + 1)]
    return np.asarray(np.sqrt(np.array(square) / max(square[0], SILENT))[classes])

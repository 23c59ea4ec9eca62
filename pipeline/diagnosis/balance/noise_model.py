"""Noise of a record that follows nothing: an autoregression that whitens it, and the spectrum of what is left."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.serial import autoregression, fit_noise, most_lags
from pmg.pipeline.fit.span import freed, taken_out

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array, Mask

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

REFITS, LEAST_SHARED = 4, 0.5
"""Times that the noise which all rows share is found anew beside that of single ones, and its least size, over the
median of theirs."""

SPREAD = (1.5, 3.0, 10.0)
"""Standard deviations of a row, over that which all share, between which rows are of one kind: what a row has of its
own is an upper bound, so that those with much of it hold less than they are divided by."""

ALIKE = 3.0
"""Frequencies for which a band counts at most in the power of the one below it, however well it is known."""

DRAWN, STEPS, SEED, FINE = 24, 200, 5, 4096
"""Draws of noise in each band, steps of the iteration, seed of the draws, and rows of a fine spectrum."""

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

    def sums(self, left: Array) -> Array:
        """Power of rows (n,) or (n, d) over all frequencies of each band (b,) or (b, d)."""
        square = np.abs(np.fft.rfft(left, axis=0)) ** 2 / self.rows
        return np.asarray(np.add.reduceat(square, self.edges[:-1], axis=0))

    def power(self, left: Array) -> Array:
        """Power of each band (b,), what was projected out with the columns made up for."""
        return np.maximum(self.between(self.sums(left) / np.maximum(self.free, SILENT), self.free), SILENT)

    def between(self, power: Array, free: Array) -> Array:
        """Power of each band (b,), that of a band of which few frequencies are free (b,) by its neighbours."""
        known = free > FREE * np.diff(self.edges)
        if not known.any():
            return power
        return np.asarray(
            np.exp(np.interp(self.centres, self.centres[known], np.log(np.maximum(power, SILENT))[known]))
        )

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
    own : (n,) array
        Standard deviation that each row has beside the noise of all [N]; empty where none has any.
    """

    noise: SerialNoise
    bands: Bands
    power: Array
    own: Array

    def whitened_draws(self, draws: int, rng: np.random.Generator) -> Array:
        """Whitened synthetic noise (n - p, draws)."""
        drawn = self.bands.draw(self.power, draws, rng)
        if not len(self.own):
            return self.noise.without_joins(drawn)
        of_own = self.own[:, None] * rng.standard_normal((len(self.own), draws))
        return self.noise.whitened(drawn) + self.noise.whiten(of_own)


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
    found in turns. Structure then lies in the few rows without, and takes much of their slow noise along, and what
    follows a row with much is whitened by nothing: what each band would leave in the rows without is drawn, and the
    autoregression follows the spectrum that leaves what is seen. Most of what is seen in a band may have come from
    others, so that the draws also say how many frequencies tell its own power.

    References
    ----------
    W. H. Richardson, 'Bayesian-based iterative method of image restoration', Journal of the Optical Society of America
    62 (1), 1972, doi:10.1364/JOSA.62.000055.
    """
    rows = np.c_[structured, residual]
    noise = _fitted(rows, starts)
    for _ in range(ROUNDS):
        noise = _fitted_anew(noise, rows)
    found = _in_bands(noise, rows)
    if own is None or not own.any():
        return found
    least, noise = LEAST_SHARED * float(np.median(own)), found.noise
    for turn in range(REFITS):
        spread = np.hypot(1.0, own / max(noise.standard_deviation, least))
        fitted = _following(noise, found) if turn else _fitted_anew(noise, rows / spread[:, None])
        noise = replace(fitted, spread=spread)
        found = _in_gaps(noise, rows)
    return replace(found, own=own * _parts_of_own(found, rows, own))


def _fitted(rows: Array, starts: tuple[int, ...]) -> SerialNoise:
    """Noise of structure and residual (n, k + 1) whose rows are off by as much."""
    left, rank = taken_out(rows[:, :-1], rows[:, -1])
    return fit_noise(left, spent=rank, starts=starts)


def _fitted_anew(noise: SerialNoise, rows: Array) -> SerialNoise:
    """The same where the structure is taken out of what is new in each row by the noise as found before."""
    white = noise.innovations(rows)
    left, rank = taken_out(white[:, :-1], white[:, -1])
    return fit_noise(noise.coloured(left), spent=rank, starts=noise.starts)


def _in_bands(noise: SerialNoise, rows: Array) -> NoiseModel:
    """How much of it each band of the whitened rows (n - p, k + 1) holds."""
    basis, left = _whitened(noise, rows)
    bands = Bands.of(basis)
    return _levelled(noise, bands, bands.power(left))


def _in_gaps(noise: SerialNoise, rows: Array) -> NoiseModel:
    """The same by the rows without noise of their own: by what each band would leave there of what is seen."""
    basis, left = _whitened(noise, rows)
    bands, plain = Bands.of(basis), _plain(noise.spread)[noise.lags :, None]
    spectrum = np.fft.rfft(np.random.default_rng(SEED).standard_normal((bands.rows, DRAWN)), axis=0)
    leaves, every = np.zeros((len(bands.free), len(bands.free))), np.zeros((len(basis), DRAWN))
    for k, (first, last) in enumerate(itertools.pairwise(bands.edges.tolist())):
        part = np.zeros_like(spectrum)
        part[first:last] = spectrum[first:last]
        shown = noise.whitened(np.fft.irfft(part, bands.rows, axis=0))
        shown -= basis @ (basis.T @ shown)
        leaves[:, k] = bands.sums(plain * shown).mean(axis=1)
        every += shown
    power = _power_that_leaves(bands.sums(plain[:, 0] * left), leaves)
    power = bands.between(power, leaves.sum(axis=0) / max(float(plain.mean()), SILENT))
    scatter = np.maximum(bands.sums(plain * every).var(axis=1), SILENT)
    free = np.clip(np.diag(leaves) ** 2 / scatter, SILENT, np.diff(bands.edges))
    for k in range(len(power) - 2, -1, -1):
        above = 1.0 / (1.0 / free[k + 1] + 1.0 / ALIKE)
        power[k] = (free[k] * power[k] + above * power[k + 1]) / (free[k] + above)
        free[k] += above
    return _levelled(noise, replace(bands, free=free), np.maximum(power, SILENT))


def _plain(spread: Array) -> Mask:
    """Rows (n,) that tell the noise of all: those without much of their own; of others the half that has least."""
    found = spread < SPREAD[0]
    return np.asarray(found if found.any() else spread <= np.median(spread))


def _whitened(noise: SerialNoise, rows: Array) -> tuple[Array, Array]:
    """Orthonormal basis of whitened structure (n - p, k), and what it leaves of the whitened residual (n - p,)."""
    white = noise.whiten(rows)
    return freed(white[:, :-1], white[:, -1])


def _levelled(noise: SerialNoise, bands: Bands, power: Array) -> NoiseModel:
    """A noise whose median band has a power of one."""
    level = float(np.median(power))
    return NoiseModel(replace(noise, sigma=noise.sigma * math.sqrt(level)), bands, power / level, np.zeros(0))


def _power_that_leaves(seen: Array, leaves: Array) -> Array:
    """Power of each band (b,) of which `leaves` (b, b) makes what is seen (b,), by Richardson's iteration."""
    whole = np.maximum(leaves.sum(axis=0), SILENT)
    power = np.full(len(seen), max(float(seen.sum() / whole.sum()), SILENT))
    for _ in range(STEPS):
        power = power * (leaves.T @ (seen / np.maximum(leaves @ power, SILENT))) / whole
    return power


def _following(noise: SerialNoise, found: NoiseModel) -> SerialNoise:
    """The autoregression whose spectrum is that of the noise as found, which another one whitened for its bands."""
    frequency = np.fft.rfftfreq(FINE)
    power = np.exp(np.interp(frequency, found.bands.centres, np.log(found.power)))
    response = np.fft.rfft(np.r_[1.0, -noise.coefficients], FINE)
    covariance = np.fft.irfft(found.noise.sigma**2 * power / np.abs(response) ** 2, FINE)
    plain = int(np.sum(_plain(noise.spread)))
    most = most_lags(plain)
    coefficients, variance = autoregression(covariance[: most + 1], plain, range(most + 1))
    return replace(noise, coefficients=coefficients, sigma=math.sqrt(variance))


def _parts_of_own(found: NoiseModel, rows: Array, own: Array) -> Array:
    """What rows (n,) have of their own as part of the bound on it: by how much those of about as much scatter more."""
    basis, left = _whitened(found.noise, rows)
    rng, spread = np.random.default_rng(SEED), found.noise.spread
    shared = found.noise.whitened(found.bands.draw(found.power, DRAWN, rng))
    of_own = found.noise.whiten(own[:, None] * rng.standard_normal((len(own), DRAWN)))
    seen = (each - basis @ (basis.T @ each) for each in (left[:, None], shared, of_own))
    squares = [np.mean(each**2, axis=1) for each in seen]
    classes, part = np.digitize(spread, SPREAD), np.zeros(len(spread))
    for k in range(1, len(SPREAD) + 1):
        alike = classes[found.noise.lags :] == k
        if alike.any():
            all_of_it, of_all, alone = (float(square[alike].mean()) for square in squares)
            part[classes == k] = math.sqrt(max(all_of_it - of_all, 0.0) / max(alone, SILENT))
    return part

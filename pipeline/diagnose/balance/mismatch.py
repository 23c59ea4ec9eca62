"""Is there a mismatch: the noise that follows nothing, and the smallest p-value of all families, paid for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.diagnose.balance.serial import SerialNoise, fit_noise
from pmg.pipeline.diagnose.balance.structure import scan_of
from pmg.pipeline.diagnose.grid.naming import Remainder
from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnose.balance.structure import Family
    from pmg.sim.signals import Array

DRAWS = 400
"""Synthetic records behind a p-value."""

VARIANTS = 20
"""Synthetic records from which the noise is fitted anew: what its estimate is uncertain and biased by."""

LEVEL = 0.05
"""False-alarm rate of the mismatch test."""

STABLE = 0.999
"""Largest root of an autoregression that is drawn from."""


@dataclass(frozen=True)
class NoiseModel:
    """Noise of a record, and how well it is known.

    Parameters
    ----------
    noise : SerialNoise
        Bias of the estimate taken out.
    variants : (v, p) array
        Coefficients that the noise may as well have.
    """

    noise: SerialNoise
    variants: Array

    def whitened_draws(self, length: int, draws: int, rng: np.random.Generator) -> Array:
        """Whitened synthetic noise (length - p, draws); each share of the draws from another variant."""
        per = -(-draws // len(self.variants))
        parts = [replace(self.noise, coefficients=a).draw(length, per, rng) for a in self.variants]
        return self.noise.whiten(np.hstack(parts)[:, :draws])


def _stable(coefficients: Array) -> bool:
    roots = np.roots(np.r_[1.0, -coefficients])
    return bool(len(roots) == 0 or np.abs(roots).max() < STABLE)


def noise_of(residual: Array, structured: Array, rng: np.random.Generator) -> NoiseModel:
    """Noise of a record: what is left when every structure is projected out, as an autoregression.

    Parameters
    ----------
    residual : (n,) array
        Force, or what a regression left of it [N].
    structured : (n, k) array
        Baseline, families and terms.
    rng : numpy.random.Generator
        Draws the synthetic records.

    Notes
    -----
    Projecting out many columns takes part of the noise along. Synthetic noise is projected and fitted alike; the mean
    shift of its coefficients is taken off, their scatter goes into every p-value.
    """
    basis = orthonormal(structured)
    spent = basis.shape[1]

    def rest(values: Array) -> Array:
        return np.asarray(values - basis @ (basis.T @ values))

    first = fit_noise(rest(residual), spent=spent)
    if first.lags == 0:
        return NoiseModel(first, np.zeros((1, 0)))
    synthetic = rest(first.draw(len(residual), VARIANTS, rng))
    again = np.stack([fit_noise(column, first.lags).coefficients for column in synthetic.T])
    centre = 2.0 * first.coefficients - again.mean(axis=0)
    if not _stable(centre):
        centre = first.coefficients
    spread = centre + again - again.mean(axis=0)
    kept = np.stack([a if _stable(a) else centre for a in spread])
    news = lfilter(np.r_[1.0, -centre], [1.0], rest(residual))[len(centre) :]
    sigma = float(np.sqrt(news @ news / max(len(news) - spent - len(centre), 1)))
    return NoiseModel(SerialNoise(centre, sigma, (news - news.mean()) / np.std(news)), kept)


@dataclass(frozen=True)
class Place:
    """A family of structure that the residual follows.

    Parameters
    ----------
    name : str
        The covariate, in words.
    p_value : float
        Of the whole search, for this family.
    rms : float
        Root mean square of the structure in the whitened residual, in units of the noise.
    """

    name: str
    p_value: float
    rms: float


@dataclass(frozen=True)
class Mismatch:
    """The mismatch test.

    Parameters
    ----------
    p_value : float
        Of the smallest of all families' p-values.
    places : tuple of Place
        Families beyond `LEVEL`, most significant first.
    draws : int
        Synthetic records behind it.
    """

    p_value: float
    places: tuple[Place, ...]
    draws: int

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return self.p_value <= LEVEL


def find_mismatch(model: NoiseModel, baseline: Array, left: Array, looked: tuple[Family, ...], null: Array) -> Mismatch:
    """Whether what a baseline leaves follows any family; the search over families is paid for (Westfall, Young).

    Parameters
    ----------
    model : NoiseModel
        The noise.
    baseline : (m, k) array
        Whitened columns of the baseline.
    left : (m,) array
        Whitened force.
    looked : tuple of Family
        What it may follow.
    null : (m, d) array
        Whitened synthetic noise.
    """
    scan = scan_of(baseline, [model.noise.whiten(family.columns) for family in looked])
    observed = scan(left[:, None])[: len(looked), 0]
    smallest = scan(null)[: len(looked)].min(axis=0)
    paid = (1.0 + (smallest[None, :] <= observed[:, None]).sum(axis=1)) / (null.shape[1] + 1.0)
    residual = left - scan.baseline @ (scan.baseline.T @ left)
    sizes = [float(np.sqrt(np.sum((basis.T @ residual) ** 2) / len(left))) for basis in scan.bases]
    places = [Place(f.name, float(p), s) for f, p, s in zip(looked, paid, sizes, strict=True) if p <= LEVEL]
    order = sorted(places, key=lambda place: (place.p_value, -place.rms))
    return Mismatch(float(paid.min()), tuple(order), null.shape[1])


def make_judge(model: NoiseModel, looked: tuple[Family, ...], null: Array) -> Callable[[Array, Array], Remainder]:
    """A judge of what an explanation leaves: by the families of the mismatch test, as `leftover.make_judge`."""
    columns = [model.noise.whiten(family.columns) for family in looked]

    def judge(baseline: Array, left: Array) -> Remainder:
        scan = scan_of(baseline, columns)
        observed = float(scan(left[:, None])[: len(looked), 0].min())
        smallest = scan(null)[: len(looked)].min(axis=0)
        p_value = (1.0 + float(np.sum(smallest <= observed))) / (null.shape[1] + 1.0)
        along = scan.everything.T @ left
        rest = left - scan.everything @ along
        dof = max(len(rest) - scan.everything.shape[1], 1)
        dimensions = scan.everything.shape[1] - scan.baseline.shape[1]
        inside = float(along @ along) - float(np.sum((scan.baseline.T @ left) ** 2))
        variance = max(float(rest @ rest) / dof, 1e-12)
        of_noise = np.sum((scan.everything.T @ null) ** 2, axis=0) - np.sum((scan.baseline.T @ null) ** 2, axis=0)
        usual = float(np.quantile(of_noise, 0.95)) - dimensions
        return Remainder(p_value, max(0.0, inside / variance - dimensions), usual)

    return judge

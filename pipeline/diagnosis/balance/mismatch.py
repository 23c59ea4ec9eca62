"""A record as evidence: the noise that follows nothing, and which families its force follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.serial import fit_noise
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, Mismatch, search
from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermProblem
    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.sim.signals import Array

DRAWS = 400
"""Synthetic records behind a p-value."""

VARIANTS = 20
"""Synthetic records from which the noise is fitted anew: what its estimate is uncertain and biased by."""

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
        drawn = (replace(self.noise, coefficients=a).draw(length, per, rng) for a in self.variants)
        return np.hstack([self.noise.whiten(part) for part in drawn])[:, :draws]


def _stable(coefficients: Array) -> bool:
    roots = np.roots(np.r_[1.0, -coefficients])
    return bool(len(roots) == 0 or np.abs(roots).max() < STABLE)


def noise_of(residual: Array, structured: Array, rng: np.random.Generator, starts: tuple[int, ...] = ()) -> NoiseModel:
    """Noise of a record: what is left when every structure is projected out, as an autoregression.

    Parameters
    ----------
    residual : (n,) array
        Force, or what a regression left of it [N].
    structured : (n, k) array
        Baseline, families and terms.
    rng : numpy.random.Generator
        Draws the synthetic records.
    starts : tuple of int
        Samples with which further recordings begin.

    Notes
    -----
    Projecting out many columns takes part of the noise along. Synthetic noise is projected and fitted alike; the mean
    shift of its coefficients is taken off, their scatter goes into every p-value.
    """
    basis = orthonormal(structured)
    spent = basis.shape[1]

    def rest(values: Array) -> Array:
        return np.asarray(values - basis @ (basis.T @ values))

    first = fit_noise(rest(residual), spent=spent, starts=starts)
    if first.lags == 0:
        return NoiseModel(first, np.zeros((1, 0)))
    synthetic = rest(first.draw(len(residual), VARIANTS, rng))
    again = np.stack([fit_noise(column, first.lags).coefficients for column in synthetic.T])
    centre = 2.0 * first.coefficients - again.mean(axis=0)
    if not _stable(centre):
        centre = first.coefficients
    spread = centre + again - again.mean(axis=0)
    kept = np.stack([a if _stable(a) else centre for a in spread])
    centred = replace(first, coefficients=centre)
    news = centred.new_in(rest(residual))
    sigma = float(np.sqrt(news @ news / max(len(news) - spent - len(centre), 1)))
    return NoiseModel(replace(centred, sigma=sigma, news=(news - news.mean()) / np.std(news)), kept)


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


def record_evidence(
    model: NoiseModel, problem: TermProblem, families: tuple[ResidualStructure, ...], null: Array
) -> Evidence:
    """A record as evidence: its whitened force, its families, and whitened synthetic noise (m, d)."""
    columns = [model.noise.whiten(family.columns) for family in families]
    rows = (np.ones(len(problem.left), dtype=np.bool_),)
    return Evidence(problem.left, problem.baseline, columns, rows, null)


def find_mismatch(evidence: Evidence, families: tuple[ResidualStructure, ...]) -> Mismatch[Place]:
    """Whether what a baseline leaves follows any family; every family beyond `FALSE_ALARM_RATE`, clearest first."""
    (step,) = search(evidence, steps=1)
    scan = step.scan
    residual = evidence.y - scan.baseline @ (scan.baseline.T @ evidence.y)
    places = []
    for k, (family, basis) in enumerate(zip(families, scan.bases, strict=True)):
        size = math.sqrt(float(np.sum((basis.T @ residual) ** 2)) / len(residual))
        places.append(Place(family.covariates[0], step.corrected(k), size))
    order = sorted(places, key=lambda place: (place.p_value, -place.rms))
    found = tuple(place for place in order if place.p_value <= FALSE_ALARM_RATE)
    return Mismatch(step.p_value, FALSE_ALARM_RATE, found, len(families), evidence.null.shape[1])

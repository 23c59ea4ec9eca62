"""Parameters of baseline and terms fitted together, with intervals that honour the serial correlation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.balance.fitting import shape_step
from pmg.pipeline.diagnosis.balance.library.term import NOISY
from pmg.pipeline.diagnosis.balance.serial import covariance_of
from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS
from pmg.pipeline.fit.span import lengths

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array

T_95 = float(stats.t.ppf(0.975, BLOCKS - 1))
"""Half-width of a 95 % interval in standard errors, for as many independent stretches as there are blocks."""


CERTAIN = 5.0
"""Standard errors by which a parameter must lie outside its range to be one that no machine has: a term named beside it
may take its part, as a power of speed takes that of dry friction."""

STEPS, LONGEST, ENOUGH = 20, 0.2, 1e-5
"""Steps in which shapes are fitted together, the longest, as part of a shape, and one that moves nothing any more."""

WORSE = 1.01
"""Squares over those before up to which shapes fitted together are taken: freed from noise, they are not the least."""

INERTIA = "inertia"
"""Term that the equation of motion is solved for."""


@dataclass(frozen=True)
class Estimate:
    """A parameter.

    Parameters
    ----------
    term, name, unit : str
        Whose it is, SI unit.
    value, standard_error : float
        By least squares, the published practice, noise of the acceleration allowed for; its error from a jackknife.
    whitened, whitened_error : float
        By least squares on whitened rows. NaN for a shape, which both share.
    """

    term: str
    name: str
    unit: str
    value: float
    standard_error: float
    whitened: float
    whitened_error: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        half = T_95 * self.standard_error
        return self.value - half, self.value + half


@dataclass(frozen=True)
class FittedTerms:
    """Baseline and terms fitted together to one recording.

    Parameters
    ----------
    baseline : tuple of Term
        Free terms of the baseline.
    fits : tuple of TermFit
        Further terms, with their shapes.
    values : (k,) array
        Amplitudes.
    estimates : tuple of Estimate
        The same with errors, and the shapes.
    """

    baseline: tuple[Term[Motion], ...]
    fits: tuple[TermFit, ...]
    values: Array
    estimates: tuple[Estimate, ...]

    def predict(self, recorded: Recorded) -> Array:
        """Thinned force of a recording [N, N m], known terms included."""
        return np.asarray(recorded.known + design_of(recorded, self.baseline, self.fits) @ self.values)

    def left(self, recorded: Recorded) -> Array:
        """Thinned force of a recording less what is predicted (n,) [N, N m]."""
        return recorded.force + recorded.known - self.predict(recorded)

    def relative_error(self, recorded: Recorded) -> float:
        """Root of the sum of squares of what is left, as part of `Recorded.size`."""
        return float(np.linalg.norm(self.left(recorded)) / recorded.size) if recorded.size > 0.0 else math.nan


def impossible_in(fitted: FittedTerms) -> tuple[Estimate, ...]:
    """Parameters that lie outside the range of their term with certainty, as a mass below zero."""
    terms = (*fitted.baseline, *(fit.candidate for fit in fitted.fits))
    bounds = {(term.identifier, q.name): q.bounds for term in terms for q in term.parameters}

    def outside(e: Estimate) -> bool:
        low, high = bounds[e.term, e.name]
        half = CERTAIN * e.standard_error
        return e.value + half < low or e.value - half > high

    return tuple(e for e in fitted.estimates if outside(e))


def design_of(recorded: Recorded, baseline: tuple[Term[Motion], ...], fits: tuple[TermFit, ...]) -> Array:
    """Thinned columns of baseline and terms at their shapes (n, k)."""
    blocks = [recorded.columns(term) for term in baseline] + [recorded.columns(f.candidate, f.shape) for f in fits]
    return np.hstack(blocks)


def for_search(
    recorded: Recorded, baseline: tuple[Term[Motion], ...], fits: tuple[TermFit, ...]
) -> tuple[Recorded, Array]:
    """Recordings and columns of a free baseline (n, k) for the search: the inertia stays free for slow parts alone.

    Notes
    -----
    Noise of an acceleration grows with frequency, and least squares on whitened rows weigh fast parts most: the inertia
    that they find is too small, and what is missing of it follows the acceleration, though nothing was left out. The
    fast part of the acceleration is taken out of the force with the inertia of plain least squares, beside the terms
    that were found before: what they explain would move it.
    """
    columns = design_of(recorded, baseline, ())
    place = _place_of_inertia(baseline)
    if place is None:
        return recorded, columns
    slow = recorded.slow(columns[:, place])
    inertia = solve(design_of(recorded, baseline, fits), recorded.force)[place]
    freed = replace(recorded, force=recorded.force - inertia * (columns[:, place] - slow))
    return freed, np.column_stack([columns[:, :place], slow, columns[:, place + 1 :]])


def _place_of_inertia(baseline: tuple[Term[Motion], ...]) -> int | None:
    """Which column of a baseline is that of the inertia; None without one."""
    return next((i for i, term in enumerate(baseline) if term.identifier == INERTIA), None)


def fit_together(
    recorded: Recorded, noise: SerialNoise, baseline: tuple[Term[Motion], ...], fits: tuple[TermFit, ...]
) -> FittedTerms:
    """Baseline and terms fitted together, the shapes of the terms too.

    Notes
    -----
    Least squares on the thinned rows is the practice of the published reference models. Noise of a measured
    acceleration would make the inertia too small, so what is left is made orthogonal to the acceleration freed from
    noise. Errors come from leaving out blocks of neighbours (`serial.covariance_of`), with the derivative to each
    shape as a further column, so that a shape that is not known widens the error of its amplitude; what is known of
    other terms with an error widens it, too.
    """
    fits = _shaped_together(recorded, noise, baseline, fits)
    design = design_of(recorded, baseline, fits)
    values = _solve_quiet(recorded, noise, baseline, design, recorded.force)
    full = np.hstack([design, _slopes(recorded, fits, _amplitudes(fits, values))])
    known = np.r_[values, np.zeros(full.shape[1] - len(values))]
    left, quiet = noise.even(recorded.force - design @ values), noise.even(_quiet(recorded, baseline, full))
    moves = [_solve_quiet(recorded, noise, baseline, full, column) for column in recorded.unsure.T]
    moved = np.stack(moves or [0.0 * known])
    error = np.sqrt(np.diag(covariance_of(noise.even(full), left, known, BLOCKS, quiet)) + np.sum(moved**2, axis=0))
    white, force = noise.whiten(full), noise.whiten(recorded.force[:, None])[:, 0]
    again = solve(white[:, : design.shape[1]], force)
    left, known = force - white[:, : design.shape[1]] @ again, np.r_[again, known[len(again) :]]
    unsure = noise.whiten(recorded.unsure).T if recorded.unsure.size else ()
    moved = np.stack([solve(white, column) for column in unsure] or [0.0 * known])
    white_error = np.sqrt(np.diag(covariance_of(white, left, known, BLOCKS)) + np.sum(moved**2, axis=0))
    names = [(t.identifier, q.name, q.unit) for t in baseline for q in t.amplitudes]
    names += [(f.identifier, q.name, q.unit) for f in fits for q in f.candidate.amplitudes]
    estimates = [
        Estimate(*name, float(v), float(e), float(w), float(we))
        for name, v, e, w, we in zip(names, values, error, again, white_error, strict=False)
    ]
    shaped = [fit for fit in fits if fit.candidate.shape is not None]
    for i, fit in enumerate(shaped, start=len(values)):
        quantity = fit.candidate.parameters[-1]
        estimates.append(
            Estimate(
                fit.identifier, quantity.name, quantity.unit, fit.shape, float(error[i]), float("nan"), float("nan")
            )
        )
    return FittedTerms(baseline, fits, values, tuple(estimates))


def _shaped_together(
    recorded: Recorded, noise: SerialNoise, baseline: tuple[Term[Motion], ...], fits: tuple[TermFit, ...]
) -> tuple[TermFit, ...]:
    """Terms with their shapes fitted together by steps of Gauss and Newton; as they were where those lead nowhere.

    Each was searched beside the terms that were found before it; those that came later move it.
    """
    tried, most = fits, math.inf
    for _ in range(STEPS):
        design = design_of(recorded, baseline, tried)
        values = _solve_quiet(recorded, noise, baseline, design, recorded.force)
        slopes = _slopes(recorded, tried, _amplitudes(tried, values))
        left = recorded.force - design @ values
        squares = float(np.sum(noise.even(left) ** 2))
        most = squares if tried is fits else most
        moves = _solve_quiet(recorded, noise, baseline, np.hstack([design, slopes]), left)[len(values) :]
        moved, farthest = _moved(tried, moves)
        if farthest < ENOUGH:
            return tried if squares <= WORSE * most else fits
        tried = moved
    return fits


def _moved(fits: tuple[TermFit, ...], moves: Array) -> tuple[tuple[TermFit, ...], float]:
    """Terms with their shapes moved where that keeps to the bounds, and the farthest move, as part of a shape."""
    rest, found, farthest = iter(moves), [], 0.0
    for fit in fits:
        quantity = fit.candidate.shape
        if quantity is not None:
            part = float(np.clip(next(rest) / fit.shape, -LONGEST, LONGEST))
            shape = fit.shape * math.exp(part)
            if quantity.bounds[0] < shape < quantity.bounds[1]:
                fit, farthest = replace(fit, shape=shape), max(farthest, abs(part))
        found.append(fit)
    return tuple(found), farthest


def _amplitudes(fits: tuple[TermFit, ...], values: Array) -> Array:
    """Those of the terms, which come last."""
    return values[len(values) - sum(len(f.amplitudes) for f in fits) :]


def _quiet(recorded: Recorded, baseline: tuple[Term[Motion], ...], columns: Array) -> Array:
    """Columns (n, k) with the acceleration of the inertia freed from noise; the same where none is known."""
    noise = recorded.motion.besides.get(NOISY)
    place = _place_of_inertia(baseline)
    if noise is None or place is None:
        return columns
    quiet = columns.copy()
    quiet[:, place] -= recorded.thin(noise[:, None])[:, 0]
    return quiet


def _solve_quiet(
    recorded: Recorded, noise: SerialNoise, baseline: tuple[Term[Motion], ...], columns: Array, y: Array
) -> Array:
    """Amplitudes (k,) that leave nothing along the quiet columns; by least squares where no noise is known."""
    quiet = _quiet(recorded, baseline, columns)
    plain = quiet is columns
    quiet, columns, y = noise.even(quiet), noise.even(columns), noise.even(y)
    if plain:
        return solve(columns, y)
    length = lengths(columns)
    return np.asarray(solve((quiet / length).T @ (columns / length), (quiet / length).T @ y) / length)


def _slopes(recorded: Recorded, fits: tuple[TermFit, ...], amplitudes: Array) -> Array:
    """Derivative of the force to each shape (n, shapes)."""
    columns = [np.zeros((len(recorded.force), 0))]
    first = 0
    for fit in fits:
        own = amplitudes[first : first + len(fit.amplitudes)]
        first += len(fit.amplitudes)
        if fit.candidate.shape is not None:
            low, high = shape_step(fit.candidate, fit.shape)
            rise = recorded.columns(fit.candidate, high) - recorded.columns(fit.candidate, low)
            columns.append((rise @ own / (high - low))[:, None])
    return np.hstack(columns)

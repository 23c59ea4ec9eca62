"""Parameters of baseline and terms fitted together, with intervals that honour the serial correlation."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.balance.fitting import shape_step
from pmg.pipeline.diagnosis.balance.serial import covariance_of
from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS

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
        By least squares, the published practice; its error from the scores of neighbouring samples.
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
        Further terms, whose shapes are kept.
    values : (k,) array
        Amplitudes by least squares.
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

    def relative_error(self, recorded: Recorded) -> float:
        """Root of the sum of squares of what is left, as part of `Recorded.size`."""
        left = recorded.force + recorded.known - self.predict(recorded)
        return float(np.linalg.norm(left) / recorded.size) if recorded.size > 0.0 else math.nan


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


def for_search(recorded: Recorded, baseline: tuple[Term[Motion], ...]) -> tuple[Recorded, Array]:
    """Recordings and columns of a free baseline (n, k) for the search: the inertia stays free for slow parts alone.

    Notes
    -----
    Noise of an acceleration grows with frequency, and least squares on whitened rows weigh fast parts most: the inertia
    that they find is too small, and what is missing of it follows the acceleration, though nothing was left out. The
    fast part of the acceleration is taken out of the force with the inertia of plain least squares.
    """
    columns = design_of(recorded, baseline, ())
    place = next((i for i, term in enumerate(baseline) if term.identifier == INERTIA), None)
    if place is None:
        return recorded, columns
    slow = recorded.slow(columns[:, place])
    inertia = solve(columns, recorded.force)[place]
    freed = replace(recorded, force=recorded.force - inertia * (columns[:, place] - slow))
    return freed, np.column_stack([columns[:, :place], slow, columns[:, place + 1 :]])


def reversals(recorded: Recorded) -> Array:
    """What dry friction shows in the moments in which it changes its sign (n, 3); no column where it never does.

    Notes
    -----
    The low-pass rounds a reversal off, and below the speed of rest no direction is seen: when it turns, how fast, and
    what friction there is before it counts as moving is not known. Free beside the baseline, all three are left out of
    what a search may explain.
    """
    m = recorded.motion
    turned = m.rate(m.direction)
    at_rest = np.where(np.abs(m.speed) < m.rest_speed, np.sign(m.speed), 0.0)
    found = recorded.thin(np.c_[turned, m.rate(turned), at_rest])
    return found if found.any() else found[:, :0]


def fit_together(
    recorded: Recorded, noise: SerialNoise, baseline: tuple[Term[Motion], ...], fits: tuple[TermFit, ...]
) -> FittedTerms:
    """Least squares of baseline and terms together.

    Notes
    -----
    Least squares on the thinned rows is the practice of the published reference models. Errors come from the scores,
    summed over lags up to a block of neighbours (`serial.covariance_of`), with the derivative to each shape as
    further columns, so that a shape that is not known widens the error of its amplitude.
    """
    design = design_of(recorded, baseline, fits)
    values = solve(design, recorded.force)
    slopes = _slopes(recorded, fits, values[len(design.T) - sum(len(f.amplitudes) for f in fits) :])
    lags = len(recorded.force) // BLOCKS
    full = np.hstack([design, slopes])
    error = np.sqrt(np.diag(covariance_of(full, recorded.force - design @ values, lags)))
    white, force = noise.whiten(full), noise.whiten(recorded.force[:, None])[:, 0]
    again = solve(white[:, : design.shape[1]], force)
    white_error = np.sqrt(np.diag(covariance_of(white, force - white[:, : design.shape[1]] @ again, lags)))
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

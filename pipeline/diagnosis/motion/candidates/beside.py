"""Mechanisms fitted together with the constants of the bench: their columns, torques, lags and measurement noise."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import shape_step
from pmg.pipeline.diagnosis.motion.candidates.terms import torque_of_terms
from pmg.pipeline.diagnosis.motion.rows import later_of
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.motion.lag import Lag

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array, Spectrum


def terms_of(fits: tuple[TermFit, ...]) -> list[MotionTerm]:
    """The mechanisms themselves."""
    return [cast("MotionTerm", fit.candidate) for fit in fits]


def columns_with_known(view: RotorView, fits: tuple[TermFit, ...]) -> Array:
    """Columns (n, a + l + 1) of mechanisms, of the skews of what lags, and what is known of them.

    Of a lag, all is known but its time over that of the fit: an amplitude would be no measure of it, as one of the
    first order does what a skew does. The skew is made of the torque of the model, too: the slope of what is shown has
    the slope of its noise, by which a lag and a skew would undo each other.
    """
    columns, known = [], np.zeros((len(view.speed), 1))
    for term, fit in zip(terms_of(fits), fits, strict=True):
        own = term.columns_on(view, fit.shape)
        if term.is_lag:
            low, high = shape_step(fit.candidate, fit.shape)
            longer = (term.columns_on(view, high) - term.columns_on(view, low)) * fit.shape / (high - low)
            known, own = known + own - longer, longer
        columns.append(own)
    return np.hstack([*columns, *(later_of(lag, view.state) for lag in _lags_with_skews(fits)), known])


def start_of(fits: tuple[TermFit, ...], sheet: DataSheet) -> tuple[Array, Array]:
    """Amplitudes (a + l,) of mechanisms and of the skews of what lags, and standard uncertainties; infinite if free."""
    amplitudes = np.concatenate([np.zeros(0), *(fit.amplitudes for fit in fits)])
    skews = sheet.spread[_skews(fits, sheet)]
    return np.pad(amplitudes, (0, len(skews))), np.r_[np.full(len(amplitudes), np.inf), skews]


def amounts_of(found: MotionBaseline, fits: tuple[TermFit, ...]) -> list[Array]:
    """Fitted amplitudes (a,) of each mechanism; of a lag, its time over that of the fit, inside its bounds."""
    amounts = np.split(found.amounts, np.cumsum([len(fit.amplitudes) for fit in fits]))[:-1]
    return [
        np.clip(own * fit.shape, *term.parameters[-1].bounds) / fit.shape if term.is_lag else own
        for term, fit, own in zip(terms_of(fits), fits, amounts, strict=True)
    ]


def with_skews(found: MotionBaseline, fits: tuple[TermFit, ...]) -> MotionBaseline:
    """A baseline whose skews beside lags are constants again, and no amplitudes."""
    lags = _lags_with_skews(fits)
    if not lags:
        return found
    amounts, skews = np.split(found.amounts, [-len(lags)])
    values = found.values.copy()
    values[_skews(fits, found.sheet)] += skews
    later = (np.hstack([later_of(lag, view.state) for lag in lags]) @ skews for view in views_of(found.clean))
    return replace(found, values=values, amounts=amounts, beside=tuple(map(np.subtract, found.beside, later)))


def _lags_with_skews(fits: tuple[TermFit, ...]) -> list[Lag]:
    """Lags that are told from a skew of their reading."""
    return [lag for lag in lags_of(fits) if lag.told_from_delay]


def _skews(fits: tuple[TermFit, ...], sheet: DataSheet) -> list[int]:
    """Their skews among the constants."""
    return [sheet.at(f"skew_{lag.side}") for lag in _lags_with_skews(fits)]


def torque_of_fits(
    signals: MotionBaseline, fits: tuple[TermFit, ...], amounts: list[Array], which: Callable[[MotionTerm], bool]
) -> tuple[Array, ...]:
    """Torque of some of the mechanisms at the fine samples of each stretch [N m], from the signals of a baseline."""
    parts = [
        (term, float(a[0]) * fit.shape, np.ones(1)) if term.is_lag else (term, fit.shape, a)
        for term, fit, a in zip(terms_of(fits), fits, amounts, strict=True)
        if which(term)
    ]
    return tuple(torque_of_terms(view, parts) for view in views_of(signals))


def lags_of(fits: tuple[TermFit, ...], amounts: list[Array] | None = None) -> tuple[Lag, ...]:
    """The transducers that lag, with the times of the fits, or with these times the fitted amplitudes (a,)."""
    parts = zip(terms_of(fits), fits, amounts or [np.ones(1)] * len(fits), strict=True)
    lagging = [(term, float(a[0]) * fit.shape) for term, fit, a in parts if term.is_lag]
    return tuple(Lag(side, time, term.sharpness) for term, time in lagging for side in term.sides)


class Heard:
    """What faults of transducers hold of the noise of the readings that they are made of.

    Parameters
    ----------
    fits : tuple of TermFit
        Mechanisms, faults of transducers among them.
    amounts : list of (a,) array
        Their amplitudes.
    """

    def __init__(self, fits: tuple[TermFit, ...], amounts: list[Array]) -> None:
        self.parts = [(t, float(a[0]), f.shape) for t, f, a in zip(terms_of(fits), fits, amounts, strict=True)]

    def __call__(self, side: str, rate: Spectrum) -> tuple[Spectrum | float, Spectrum | float]:
        """Weights of the noise of the own reading and of the other one, by side and rate of change (f,) of a wave."""
        own: Spectrum | float = 0.0
        other: Spectrum | float = 0.0
        for term, amount, shape in self.parts:
            if term.hears is not None and side in term.sides:
                mine, theirs = term.hears(rate, shape)
                own, other = own + amount * mine, other + amount * theirs
        return own, other

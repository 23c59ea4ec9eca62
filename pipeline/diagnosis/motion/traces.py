"""Measured and predicted torque of each stretch, and what is missing, before and after what was named."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.catalogue import columns_beside
from pmg.pipeline.diagnosis.motion.loss_curve import loss_names
from pmg.pipeline.diagnosis.motion.noise.row_noise import slow_spread
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.fit.span import pseudo_inverse

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.rows import RotorRows, RotorState
    from pmg.sim.signals import Array

SMOOTHED = 0.25
"""Time over which the missing torque is smoothed where it is drawn [s]."""


@dataclass(frozen=True)
class TorqueTrace:
    """Torque of a stretch at its n rows [N m].

    Parameters
    ----------
    stretch : RotorRows
        Which.
    state, state_before : RotorState
        Of its rotor, with what was named, and by the baseline alone.
    before, of_constants, after : (n,) array
        Predicted by the baseline alone, with the data sheet where that is named to be wrong or where a constant would
        take up what is named; by its constants beside what was named; and together with that.
    spread : (n,) array
        Standard deviation of the measured torque, smoothed over `SMOOTHED`.
    row_spread : (n,) array
        The same of each row by itself.
    band : (b, n) array
        Diagonals of the factor of the covariance of the noise that the filters leave, with a small white part [N m].
    slow : (n, k) array
        Directions of wander, ripple and quantisation, each as long as its standard deviation [N m].
    """

    stretch: RotorRows
    state: RotorState
    state_before: RotorState
    before: Array
    of_constants: Array
    after: Array
    spread: Array
    row_spread: Array
    band: Array
    slow: Array

    @property
    def time(self) -> Array:
        """Of the rows [s] (n,)."""
        return self.stretch.run.row_time[self.stretch.rows]

    def missing(self, predicted: Array) -> Array:
        """Measured less predicted torque, smoothed over `SMOOTHED` [N m] (n,)."""
        return _smoothed(self.stretch, (self.stretch.torque - predicted)[:, None])[:, 0]

    def draw_noise(self, rng: np.random.Generator, draws: int) -> Array:
        """Realisations of its noise [N m] (n, draws)."""
        found = self.slow @ rng.standard_normal((self.slow.shape[1], draws))
        white = rng.standard_normal((self.band.shape[1], draws))
        for lag, diagonal in enumerate(self.band[: len(found)]):
            found[lag:] += (diagonal[:, None] * white)[: len(found) - lag]
        return np.asarray(found)


def term_of(fit: TermFit) -> MotionTerm:
    """The mechanism of a fit."""
    return cast("MotionTerm", fit.candidate)


def named_fits(diagnosis: MotionDiagnosis) -> tuple[TermFit, ...]:
    """What a diagnosis names, or names first; none without a cause."""
    naming = diagnosis.naming
    return naming.best.fits if diagnosis.verdict.names and naming is not None else ()


def final_baseline(diagnosis: MotionDiagnosis) -> MotionBaseline:
    """The baseline with the constants that were fitted beside what is named."""
    return replace(diagnosis.evidence.baseline, values=diagnosis.constants, beside=())


def fitted_values(fit: TermFit) -> Array:
    """Parameters of a fit by itself, amplitudes then shape."""
    return np.asarray(np.r_[fit.amplitudes, [] if fit.candidate.shape is None else [fit.shape]])


def effects_of(diagnosis: MotionDiagnosis, others: tuple[TermFit, ...] = ()) -> tuple[tuple[Array, ...], ...]:
    """Torque of each named mechanism, or of others in their place, at the rows of each stretch [N m]."""
    baseline, fits = final_baseline(diagnosis), others or named_fits(diagnosis)
    views, sizes = views_of(baseline.clean), tuple(map(fitted_values, others)) or diagnosis.sizes
    found = []
    for fit, values in zip(fits, sizes, strict=True):
        term, count = term_of(fit), len(fit.amplitudes)
        shape = float(np.clip(values[count], *term.shape.bounds)) if term.shape is not None else fit.shape
        of_fit = []
        for place, view in enumerate(views):
            if term.constants:
                columns = baseline.clean.columns(place)[:, [baseline.sheet.at(name) for name in term.constants]]
            else:
                columns = term.rows_on(view, shape)
            of_fit.append(np.asarray(columns @ values[:count]))
        found.append(tuple(of_fit))
    return tuple(found)


def constants_covariance(diagnosis: MotionDiagnosis) -> Array:
    """Covariance (k, k) of the constants, fitted together with the parameters of what is named."""
    found = diagnosis.evidence
    fits = named_fits(diagnosis)
    columns = np.hstack([columns_beside(found, fits), *(found.problem.slopes(fit) for fit in fits)])
    return found.covariance_of(pseudo_inverse(columns)[: found.columns.shape[1]])


def traces_of(diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...]) -> tuple[TorqueTrace, ...]:
    """Torque of every stretch; `effects` are those of what was named.

    Notes
    -----
    A constant of which the data sheet is wrong is among the fitted ones, so that its effect is in the baseline already.
    Where a loss curve falls for want of a cause, the model before has the loss curve fitted beside the cause.
    """
    baseline, fits = final_baseline(diagnosis), named_fits(diagnosis)
    sheet, values = baseline.sheet, diagnosis.before.values.copy()
    wrong = [sheet.at(name) for fit in fits for name in (*term_of(fit).constants, *term_of(fit).mimicked_by)]
    values[wrong] = sheet.expected[wrong]
    hiding = {each.side for each in sheet.sums} & {term_of(fit).shaft for fit in fits}
    free = [sheet.at(name) for side in hiding for name in loss_names(side)]
    values[free] = baseline.values[free]
    before = replace(diagnosis.before, values=values)
    of_constants = [baseline.predicted(place) for place in range(len(baseline.stretches))]
    after = [
        sum((of[place] for fit, of in zip(fits, effects, strict=True) if not term_of(fit).constants), start=predicted)
        for place, predicted in enumerate(of_constants)
    ]
    noise, scatter = diagnosis.evidence.noise, diagnosis.evidence.scatter
    found = []
    for place, stretch in enumerate(baseline.stretches):
        slow = np.hstack([slow_spread(stretch, noise[place].slow_noise), noise[place].quantisation])
        band = scatter * noise[place].factor.band
        smooth, by_row = (_spread(stretch, band, slow, width) for width in (_width(stretch), 1))
        states = baseline.states[place], before.states[place]
        predicted = before.predicted(place), of_constants[place], after[place]
        found.append(TorqueTrace(stretch, *states, *predicted, smooth, by_row, band, slow))
    return tuple(found)


def _spread(stretch: RotorRows, band: Array, slow: Array, width: int) -> Array:
    """Standard deviation of the torque of a stretch as the mean over `width` rows that follow each other (n,).

    `band` holds the diagonals of the factor of what the filters leave, `slow` those of wander, ripple and quantisation.
    """
    half, n = width // 2, band.shape[1]
    upto = np.pad(np.cumsum(band, axis=0), ((1, 0), (0, 0)))  # what a mean takes of each column of the factor
    variance, taken = np.zeros(n), np.arange(n)
    among = np.minimum(taken, half) + np.minimum(n - 1 - taken, half) + 1
    # offsets of a column of the factor from the row in the middle of the mean
    for ahead in range(max(-half - len(band), -n) + 1, min(half + 1, n)):
        last, first = np.clip(np.array([half - ahead + 1, -half - ahead]), 0, len(band))
        rows = slice(max(-ahead, 0), n - max(ahead, 0))
        columns = slice(max(ahead, 0), n - max(-ahead, 0))
        variance[rows] += (upto[last, columns] - upto[first, columns]) ** 2
    slow = slow if width == 1 else _smoothed(stretch, slow)
    return np.asarray(np.sqrt(variance / among**2 + np.sum(slow**2, axis=1)))


def _width(stretch: RotorRows) -> int:
    return 2 * round(0.5 * SMOOTHED * stretch.run.row_rate) + 1


def _smoothed(stretch: RotorRows, rows: Array) -> Array:
    """Moving mean of rows (n, k) over those of a stretch that are near in time."""
    whole = np.zeros((len(stretch.run), rows.shape[1] + 1))
    whole[stretch.rows, :-1], whole[stretch.rows, -1] = rows, 1.0
    total = np.cumsum(np.pad(whole, ((_width(stretch) // 2 + 1, _width(stretch) // 2), (0, 0))), axis=0)
    means = total[_width(stretch) :] - total[: -_width(stretch)]
    return np.asarray(means[stretch.rows, :-1] / means[stretch.rows, -1:])

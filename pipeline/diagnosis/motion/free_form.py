"""Smooth changes of the law of a candidate in motion, along the quantities that it is a function of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.grid.free_form import DEGREE
from pmg.sim.mechanisms.base import LawCovariate
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


MIXED = (1.0 / 3.0, 3.0)
"""Shapes that a law may have besides its own, over that."""


def bent_columns(problem: TermProblem, fit: TermFit) -> Array:
    """Whitened columns (m, k) along which the law of a fit may bend; none where it is a function of nothing else."""
    term = cast("MotionTerm", fit.candidate)
    count = DEGREE * len(term.follows) + (len(term.follows) == 2) + len(MIXED) * term.mixes
    if not count:
        return np.zeros((len(problem.left), 0))

    def changes(view: RotorView, shape: float) -> Array:
        effect = term.columns(view, shape) @ fit.amplitudes
        columns = [effect[:, None] * _polynomials(view, term.follows)]
        if term.mixes:
            columns += [(term.columns(view, part * shape) @ fit.amplitudes - effect)[:, None] for part in MIXED]
        return np.hstack(columns)

    return problem.columns_of(replace(term, columns=changes, amplitudes=term.amplitudes[:1] * count), fit.shape)


def _polynomials(view: RotorView, follows: tuple[LawCovariate, ...]) -> Array:
    """Legendre polynomials of the root of each quantity, and with two of them the product of the first ones (n, k)."""
    each: list[Array] = [np.zeros((len(view.speed), 0))]
    for name in follows:
        values, most = _magnitude(view, name)
        root = np.sqrt(np.minimum(values / max(most, 1e-12), 1.0))
        each.append(np.asarray(np.polynomial.legendre.legvander(2.0 * root - 1.0, DEGREE)[:, 1:]))
    if len(follows) == 2:
        each.append(each[1][:, :1] * each[2][:, :1])
    return np.hstack(each)


def _magnitude(view: RotorView, name: LawCovariate) -> tuple[Array, float]:
    """Magnitude of a quantity at the fine samples of a stretch (n,), and its largest in the campaign."""
    if name is LawCovariate.TIME:
        return view.campaign_time, view.history.length
    if name is LawCovariate.LOAD:
        return np.abs(view.shaft.torque), view.history.largest(lambda shafts: shafts[view.side].torque)
    if name is LawCovariate.SPEED:
        return np.abs(view.speed), view.history.largest(lambda shafts: shafts[view.side].speed)
    if name is LawCovariate.DIFFERENCE:
        return np.abs(view.relative), view.history.largest(lambda shafts: shafts.sun.speed - shafts.ring.speed)
    poles = view.history.baseline.sheet.poles
    slip = view.history.largest(lambda shafts: np.asarray(sum(poles[side] * shafts[side].speed for side in SIDES)))
    return np.abs(view.slip), slip

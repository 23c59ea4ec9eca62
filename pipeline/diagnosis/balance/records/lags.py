"""Delays about which the columns of lags are taken: a step in time where it fits better than a first derivative."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import OF_LAGS
from pmg.pipeline.diagnosis.balance.records.reversals import reversals

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.sim.signals import Array

STEPS_OF_LAG = 3
"""Steps in which a delay settles."""


def with_lags(recorded: Recorded, case: Case) -> Recorded:
    """Recordings with the delays that fit beside their baseline; none where a first derivative fits as well.

    Notes
    -----
    A lag of the first order changes a force by its derivative, a pure delay by more where its product with the
    frequency is not small. Either is told by the same term. Both show most where dry friction changes its sign, where
    no record tells how: what it may do there is free.
    """
    if recorded.coasts:
        return recorded
    freed = [term for term in case.library if term.key in set(case.baseline) - set(case.fixed)]
    free = np.hstack([*(recorded.columns(term) for term in freed), reversals(recorded, case.axis.rises)])
    named = ((term, OF_LAGS[term.identifier]) for term in case.library if term.identifier in OF_LAGS)
    found = {name: _delay(recorded, free, term, name) for term, name in named}
    told = {name: delay for name, delay in found.items() if delay != 0.0}
    motion = recorded.motion
    return replace(recorded, motion=replace(motion, references={**motion.references, **told}))


def _delay(recorded: Recorded, free: Array, term: Term[Motion], name: str) -> float:
    low, high = term.amplitudes[0].bounds
    straight, least = _beside(recorded, free, term, {})
    delay, best = straight, 0.0
    for _ in range(STEPS_OF_LAG):
        if not low < delay < high or abs(delay) < 0.5 * recorded.motion.sample_time:
            return best
        at = delay
        delay, left = _beside(recorded, free, term, {name: at})
        best, least = (at, left) if left < least else (best, least)
    return best


def _beside(recorded: Recorded, free: Array, term: Term[Motion], lag: dict[str, float]) -> tuple[float, float]:
    """Amplitude of a term beside free columns, and the sum of squares that both leave."""
    motion = recorded.motion
    column = recorded.thin(term.columns(replace(motion, references={**motion.references, **lag}), float("nan")))
    both = np.hstack([free, column])
    values = np.linalg.lstsq(both, recorded.force, rcond=None)[0]
    left = recorded.force - both @ values
    return float(values[-1]), float(left @ left)

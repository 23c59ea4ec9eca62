"""Whether what no term explains lies at reversals, where a machine that sticks for a moment shows the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array, Mask

REACH = 2
"""Thinned samples before and after a reversal that are near it."""

MOST, CROWDED = 0.15, 4.0
"""Part of the squares from which on they are said to lie near reversals, and over the part of the samples there."""


def _near_reversals(speed: Array, breaks: tuple[int, ...]) -> Mask:
    """Thinned samples (n,) of a speed [SI] that are near a change of its sense, within each stretch without a rest."""
    near = []
    for part in np.split(speed, [each for each in breaks if each]):
        near.append(np.zeros(len(part), dtype=np.bool_))
        for turn in np.flatnonzero(np.diff(np.sign(part)) != 0.0) + 1:
            near[-1][max(turn - REACH, 0) : turn + REACH] = True
    return np.concatenate(near)


def reversal_sentence(d: TermsDiagnosis) -> str:
    """What part of what is left lies at reversals, and what else than a missing term would put it there; else empty.

    Friction that holds a machine is as large as it needs to be. A rest that is shorter than the filters resolve cannot
    be left out, and Coulomb friction is no model of it.
    """
    if d.verdict is not Verdict.NOT_IN_LIBRARY:
        return ""
    recorded = d.recorded
    squares = d.steps[-1].fitted.left(recorded) ** 2
    near = _near_reversals(recorded.at_rows(recorded.motion.speed), recorded.breaks)
    part, share = float(near.mean()), float(squares[near].sum() / max(squares.sum(), np.finfo(np.float64).tiny))
    if share < max(MOST, CROWDED * part):
        return ""
    reach = 1e3 * REACH * recorded.keep_every * recorded.motion.sample_time
    return (
        f"{share:.0%} of what is left (in squares) lies within {reach:.0f} ms of a reversal, in {part:.1%} of the "
        "samples: a machine that sticks there for less than the low-pass resolves shows the same."
    )

"""What a campaign in motion cannot see, however large: mechanisms that its runs excite too little to tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import Tabled
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.terms import MotionTerm
    from pmg.sim.signals import Array

TOLD = 4.0
"""Standard deviations from which on an effect stands out of the noise and of what the constants take up."""

WORTH_KNOWING = {
    "channel_delay": 0.03,
    "coupling_backlash": 2e-3,
    "direction_dependent_friction": 0.1,
}
"""Size in the unit of its amplitude, by mechanism, that a campaign must be able to tell: 30 ms of delay, 2 mrad of
play, a tenth more drag in one sense. A campaign that turns both ways and swings sees a tenth of it."""


@dataclass(frozen=True)
class Unseen:
    """A mechanism that a campaign cannot see.

    Parameters
    ----------
    term : MotionTerm
        The mechanism on its shaft.
    smallest : float
        Size of it that would just be told, in the unit of its amplitude.
    """

    term: MotionTerm
    smallest: float

    @property
    def ids(self) -> tuple[str, str]:
        """Mechanism and shaft."""
        return self.term.identifier, self.term.shaft


def unseen(found: MotionEvidence) -> tuple[Unseen, ...]:
    """The mechanisms of `WORTH_KNOWING` that evidence could not tell at that size, whatever the recordings show."""
    spots = []
    for tabled in found.problem.tables.values():
        term = cast("MotionTerm", tabled.term)
        if term.identifier in WORTH_KNOWING and not term.variant:
            smallest = TOLD / max(_length(tabled, found.problem.baseline), 1e-30)
            if smallest > WORTH_KNOWING[term.identifier]:
                spots.append(Unseen(term, smallest))
    return tuple(spots)


def _length(tabled: Tabled, baseline: Array) -> float:
    """Standard deviations by which one unit of a term stands out beside the baseline, at its plainest shape."""
    columns = tabled.columns.reshape(len(tabled.columns), -1)
    left = columns - baseline @ (baseline.T @ columns)
    return float(np.linalg.norm(left, axis=0).max())

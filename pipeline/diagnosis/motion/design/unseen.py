"""What a campaign in motion cannot see, however large: mechanisms that its runs excite too little to tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.candidates.terms import BOTH

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import Tabled
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.signals import Array

TOLD = 4.0
"""Standard deviations from which on an effect stands out of the noise and of what the constants take up."""

WORTH_KNOWING = {
    "channel_delay": (1e-3, "a delay below {:.1f} ms", 1e-3),
    "coupling_backlash": (2e-3, "play below {:.1f} mrad", 1e-3),
    "direction_dependent_friction": (0.1, "less than {:.0f} % more drag in one sense", 1e-2),
}
"""Size that a campaign must be able to tell, by mechanism, in SI units, and how the smallest one that it can tell
is told: in words, in units of so much. A campaign that turns both ways and swings sees a fifth of it or less."""


WHOLLY = {"direction_dependent_friction": (1.0, "drag that differs between the senses")}
"""Smallest size that can be told from which on nothing of it can, and how that is told."""


@dataclass(frozen=True)
class Unseen:
    """A mechanism that a campaign cannot see.

    Parameters
    ----------
    term : MotionTerm
        The mechanism on its shaft.
    smallest : float
        Size of it that would just be told, in the unit of `WORTH_KNOWING`.
    """

    term: MotionTerm
    smallest: float

    @property
    def ids(self) -> tuple[str, str]:
        """Mechanism and shaft."""
        return self.term.identifier, self.term.shaft

    @property
    def words(self) -> str:
        """What cannot be told, without the shaft."""
        _, words, unit = WORTH_KNOWING[self.term.identifier]
        if self.term.identifier in WHOLLY and self.smallest > WHOLLY[self.term.identifier][0]:
            return WHOLLY[self.term.identifier][1]
        return words.format(self.smallest / unit)


def unseen(found: MotionEvidence) -> tuple[Unseen, ...]:
    """The mechanisms of `WORTH_KNOWING` that evidence could not tell at that size, whatever the recordings show.

    Of shafts that turn; one that never does has no rows, and nothing is said of it.
    """
    spots = []
    for tabled in found.problem.tables.values():
        term = cast("MotionTerm", tabled.term)
        if term.identifier in WORTH_KNOWING and not term.variant and term.shaft != BOTH:
            smallest = _smallest(tabled, found)
            if smallest > worth_knowing(term):
                spots.append(Unseen(term, smallest))
    return tuple(spots)


def _smallest(tabled: Tabled, found: MotionEvidence) -> float:
    """Size of a term that stands out of what sensors and bench make of noise, beside the baseline.

    A mismatch that is there already scatters the rows; it is no noise that could hide a mechanism.
    """
    baseline = found.problem.baseline
    columns = tabled.columns - np.einsum("mk,kga->mga", baseline, np.einsum("mk,mga->kga", baseline, tabled.columns))
    return smallest_told(found.scatter * np.linalg.norm(columns, axis=0), tabled)


def smallest_told(lengths: Array, tabled: Tabled) -> float:
    """Size of a term that stands out, at its plainest shape, by the lengths (g, a) of what its columns leave.

    The size of a delay is its shape: what it changes is proportional to it while it is short.
    """
    least = TOLD / np.maximum(lengths, 1e-30)
    times = tabled.shapes[:, None] if tabled.term.shape is not None and tabled.term.shape.unit == "s" else 1.0
    return float((least * times).min())


def worth_knowing(term: MotionTerm) -> float:
    """Size of a mechanism that a campaign must be able to tell."""
    return WORTH_KNOWING[term.identifier][0]

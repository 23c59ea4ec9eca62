"""Free forms: could a smooth change of the law that was found, along its own covariates, take up what is left."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic

import numpy as np

from pmg.pipeline.diagnosis.engine.adequacy import ORDINARY
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest, Remainder
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.explanation import Explanation

FORM_ERROR = 0.03
"""Part of a candidate's gain that may be left over and pass for the error of its form rather than another candidate.

Other physical forms of the same mechanism leave less than two hundredths once it is taken in detail; mechanisms from
outside the catalogue leave four or more of their nearest look-alike."""

UNSEEN, CHANCE = 0.1, 0.5
"""Part of a candidate's gain, and of what noise exceeds one time in a hundred, that may be left over together where no
structure is seen in it."""

SMALL_PART = 0.3
"""Part of a candidate's gain that may be left over where it is within the noise."""

BENT = 0.15
"""Part of a candidate's gain that a free form of its law may add: beyond, it is another law."""


def explains(best: Explanation[F, P], remainder: Remainder) -> bool:
    """Whether what a set leaves is an error of form, or noise."""
    if not best.fits or not best.needed or any(fit.bends_to_anything for fit in best.fits):
        return False
    if remainder.within_noise and remainder.excess <= SMALL_PART * best.gain:
        return True
    if remainder.p_value >= ORDINARY:
        return remainder.excess <= UNSEEN * best.gain + CHANCE * remainder.usual
    return remainder.excess <= FORM_ERROR * best.gain


@dataclass(frozen=True)
class FreeForm(Generic[F, P]):
    """A candidate whose law may bend.

    Parameters
    ----------
    explanation : Explanation
        The candidate, with what its free law takes up.
    remainder : Remainder
        What it leaves.
    evidence : float
        What the free law takes up, less the cost of its columns [noise variances].
    """

    explanation: Explanation[F, P]
    remainder: Remainder
    evidence: float

    @property
    def explains(self) -> bool:
        """Whether it brings something, is still that law, and leaves noise or next to nothing."""
        same = self.explanation.bent <= BENT * self.explanation.gain
        return self.evidence > 0.0 and same and explains(self.explanation, self.remainder)

    def rivals(self, score: float) -> bool:
        """Whether it explains as well as a further candidate of that score."""
        return self.explains and self.evidence > score - MARGIN


def free_form(
    best: Explanation[F, P], catalogue: CandidateCatalogue[F, P], remainder_of: AdequacyTest
) -> FreeForm[F, P] | None:
    """A candidate with its law free along its own covariates; None where it has none, or in a set of several.

    Together with another candidate free laws would bend to almost anything.
    """
    if len(best.fits) > 1:
        return None
    problem = best.problem.take_up(np.hstack([catalogue.free_form(best.problem, fit) for fit in best.fits]))
    columns = problem.baseline.shape[1] - best.problem.baseline.shape[1]
    if not columns:
        return None
    bent = float(best.problem.left @ best.problem.left - problem.left @ problem.left)
    freed = replace(best, problem=problem, bent=bent)
    return FreeForm(freed, remainder_of(problem), bent - columns * math.log(len(problem.left)))

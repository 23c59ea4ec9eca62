"""Free forms: could a smooth change of the law that was found, along its own covariates, take up what is left."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from pmg.pipeline.diagnosis.engine.adequacy import ORDINARY
from pmg.pipeline.diagnosis.engine.catalogue import FORM_ERROR, MARGIN
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest, Remainder
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.sim.signals import Array

T = TypeVar("T", float, "Array")

UNSEEN, CHANCE = 0.1, 0.5
"""Part of a candidate's gain, and of what noise exceeds one time in a hundred, that may be left over together where no
structure is seen in it."""

SMALL_PART = 0.3
"""Part of a candidate's gain that may be left over where it is within the noise."""

BENT = 0.15
"""Part of a candidate's gain that a free form of its law may add: beyond, it is another law."""

BEND = 0.5
"""Standard deviation of what a change of a law is expected to multiply it with."""


def explains(best: Explanation[F, P], remainder: Remainder, form_error: float = FORM_ERROR) -> bool:
    """Whether what a set leaves is an error of form, or noise."""
    if not best.fits or not best.needed or any(fit.bends_to_anything for fit in best.fits):
        return False
    within = remainder.within_noise and remainder.excess <= SMALL_PART * best.gain
    return bool(within or remainder.excess <= form_room(best.gain, remainder, form_error))


def form_room(gain: T, remainder: Remainder, form_error: float = FORM_ERROR) -> T:
    """What may be left over of some gain and pass for an error of form: more where nothing is seen in it."""
    if remainder.p_value >= ORDINARY:
        return UNSEEN * gain + CHANCE * remainder.usual
    return form_error * gain


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
    form_error : float
        Part of its gain that may be left over.
    """

    explanation: Explanation[F, P]
    remainder: Remainder
    evidence: float
    form_error: float = FORM_ERROR

    @property
    def explains(self) -> bool:
        """Whether it brings something, is still that law, and leaves noise or next to nothing."""
        same = self.explanation.bent <= BENT * self.explanation.gain
        return self.evidence > 0.0 and same and explains(self.explanation, self.remainder, self.form_error)

    def rivals(self, score: float) -> bool:
        """Whether it explains as well as a further candidate of that score."""
        return self.explains and self.evidence > score - MARGIN


def free_form(
    best: Explanation[F, P], catalogue: CandidateCatalogue[F, P], remainder_of: AdequacyTest
) -> FreeForm[F, P] | None:
    r"""A candidate with its law free along its own covariates; None where it has none, or in a set of several.

    Together with another candidate free laws would bend to almost anything.

    Notes
    -----
    Each coefficient of the change, a part of the law, is zero before any reading, with a standard deviation of `BEND`:
    what takes a multiple of the law is no change of it. With the whitened columns :math:`X` and
    :math:`\Lambda = X^T X + I/s^2`, the evidence is :math:`y^T X \Lambda^{-1} X^T y - \ln\det(s^2\Lambda)`, twice the
    logarithm of the ratio of marginal likelihoods (Bishop 2006, section 3.5.1).

    References
    ----------
    C. M. Bishop, 'Pattern Recognition and Machine Learning', Springer, 2006.
    """
    if len(best.fits) > 1:
        return None
    start = best.problem
    columns = start.project(np.hstack([catalogue.free_form(start, fit) for fit in best.fits]))
    if not columns.any():
        return None
    along = columns.T @ start.left
    precision = columns.T @ columns + np.eye(columns.shape[1]) / BEND**2
    change = np.linalg.solve(precision, along)
    changed: dict[str, Any] = {"left": start.left - columns @ change}
    problem = replace(start, **changed)
    bent = float(start.left @ start.left - problem.left @ problem.left)
    evidence = float(along @ change - np.linalg.slogdet(precision * BEND**2).logabsdet)
    return FreeForm(replace(best, problem=problem, bent=bent), remainder_of(problem), evidence, catalogue.form_error)

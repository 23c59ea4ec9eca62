"""Evidence of one kind for any set of causes, with the sizes that another kind may hold against its own."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeAlias

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.explanation import explain_with, without
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.sim.signals import Array

Causes: TypeAlias = "dict[str, str]"
"""A set of mechanisms: the shaft of each by its id."""

ONE_SIZE = {
    "torque_gain_error": ("gain_sun", "gain_ring", "gain"),
    "torque_crosstalk": ("part_sun", "part_ring", "crosstalk"),
    "load_dependent_bearing_friction": ("mu_sun", "mu_ring", "mu"),
    "engaged_dry_friction": ("friction_sun", "friction_ring", "friction"),
}
"""Mechanisms whose size is the same number in both libraries, and its names there; beside other parameters it is not
that number."""

LEAST_SEEN = 1e-3
"""Part of a column that must survive the baseline for its size to be seen."""


@dataclass(frozen=True)
class WeighedSet:
    """A set of causes as one kind of evidence sees it.

    Parameters
    ----------
    score : float
        Fall of the sum of squares less what the parameters cost [noise variances].
    sizes : dict of str to (float, float)
        Size and its variance of each mechanism of `ONE_SIZE` that is fitted by that size alone, by its id.
    """

    score: float
    sizes: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class KindOfEvidence(ABC, Generic[F, P]):
    """Rows of one kind, what they say by themselves, and the candidates that may explain them.

    Parameters
    ----------
    conclusion : Conclusion
        What they say by themselves.
    p_value : float
        Of a mismatch in them.
    problem : WhitenedProblem
        The rows, their baseline free.
    catalogue : CandidateCatalogue
        Fits a candidate.
    """

    conclusion: Conclusion[F, P]
    p_value: float
    problem: P
    catalogue: CandidateCatalogue[F, P]

    @abstractmethod
    def forms(self, identifier: str, shaft: str) -> Sequence[Any]:
        """Forms that a mechanism may have there; none where the library does not hold it."""

    @abstractmethod
    def one_size(self, fit: F) -> tuple[str, float] | None:
        """Name and value of the only parameter of a fit; None where there are several."""

    def lacks(self, causes: Causes) -> bool:
        """Whether a mechanism acts on the rows, and the library has no law for it, so that they cannot judge a set."""
        del causes
        return False

    def variance_of(self, weights: Array) -> float:
        """Variance of a sum of the rows with `weights` (m,)."""
        return float(weights @ weights)

    @property
    def sets(self) -> tuple[tuple[Causes, bool], ...]:
        """Sets that it leaves by itself, the leading one first, and whether each stands by parts of the rows only."""
        naming = self.conclusion.naming
        if naming is None or not self.conclusion.verdict.names:
            return ()
        best = {fit.identifier: naming.shafts.get(fit.identifier, fit.place) for fit in naming.best.fits}
        rivals = [{fit.identifier: fit.place for fit in rival.fits} for rival in naming.rivals]
        apart = len(rivals) - naming.by_parts
        return ((best, False), *((rival, place >= apart) for place, rival in enumerate(rivals)))

    @property
    def tells_little(self) -> bool:
        """Whether its mismatch is too weak to name a cause, or to exclude one; what it bears out in part is strong."""
        return self.conclusion.weak and not self.conclusion.in_part

    @property
    def cost(self) -> float:
        """What a parameter costs [noise variances]."""
        return math.log(len(self.problem.left))

    @property
    def of_form(self) -> float:
        """Evidence that an error of form is worth [noise variances]."""
        naming = self.conclusion.naming
        return 0.0 if naming is None else self.catalogue.form_margin * max(naming.best.score, 0.0)

    @property
    def margin(self) -> float:
        """Evidence by which a set may fall short of the best one and not be told from it [noise variances]."""
        return MARGIN + self.of_form

    def weigh(self, causes: Causes) -> WeighedSet:
        """Evidence for a set, each mechanism in the form that fits best.

        One that is not seen, and whose size nobody else knows, is left out: it may be too small to be seen.
        """
        found = explain_with(self.problem, self.catalogue, ())
        for identifier, shaft in causes.items():
            fits = [self.catalogue.fit(found.problem, form) for form in self.forms(identifier, shaft)]
            if fits:
                found = found.plus(max(fits, key=found.problem.score))
        found = explain_with(self.problem, self.catalogue, [fit.candidate for fit in found.fits])
        sizes = self._sizes(found)
        shown = [f.candidate for f in found.fits if self.problem.score(f) > 0.0 or f.identifier in sizes]
        if len(shown) < len(found.fits):
            found = explain_with(self.problem, self.catalogue, shown)
            sizes = self._sizes(found)
        return WeighedSet(found.score, sizes)

    def _sizes(self, found: Explanation[F, P]) -> dict[str, tuple[float, float]]:
        """Sizes that another kind may know, too, with their variances."""
        sizes = ((fit.identifier, self._size(found, place)) for place, fit in enumerate(found.fits))
        return {name: size for name, size in sizes if size is not None}

    def _size(self, found: Explanation[F, P], place: int) -> tuple[float, float] | None:
        """Size of a fit beside the others, and its variance; None where another kind has no such size, or none is seen.

        That is where the baseline absorbs all of it.
        """
        fit = found.fits[place]
        size = self.one_size(fit)
        if size is None or size[0] not in ONE_SIZE.get(fit.identifier, ()):
            return None
        rest, _ = without(self.problem, found, place)
        whole = rest.slopes(fit)[:, 0]
        column = rest.project(whole)
        square = float(column @ column)
        seen = square > LEAST_SEEN**2 * float(whole @ whole)
        return (size[1], self.variance_of(column / square)) if seen else None

"""The catalogue: candidates fitted beside a baseline, ranked, in the detail that the data call for."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Generic

import numpy as np

from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.sim.signals import Array

ENTRY = 10.0
"""Evidence that a candidate must bring to enter: fall of the sum of squares in noise variances, beyond its cost."""

MARGIN = 10.0
"""Evidence by which a candidate must beat a rival to be named alone: odds of about 150 to 1."""

LEADERS = 2
"""Leading candidates that are compared in detail, so that a simple form does not lose to another's detailed one."""


FAINT, WEAK = 80.0, 160.0
"""Gains below which what any candidate leaves looks like noise, and below which an effect of another kind may pass for
the leading one: of trials with gains between them, three in ten had such a cause."""

FORM_ERROR = 0.03
"""Part of a candidate's gain that may be left over and pass for the error of its form rather than another candidate.

Other physical forms of the same mechanism leave less than two hundredths once it is taken in detail; mechanisms from
outside the catalogue leave four or more of their nearest look-alike."""


class CandidateCatalogue(ABC, Generic[F, P]):
    """Candidates that may explain what a baseline leaves."""

    pairs_at_once: ClassVar[bool] = False
    """Whether two may enter together where neither explains enough of the rest by itself."""

    tells_weak: ClassVar[bool] = True
    """Whether causes of which none is named, as the mismatch is too weak or none is proved, are reported as a set."""

    form_error: ClassVar[float] = FORM_ERROR
    """Part of a candidate's gain that may be left over and pass for the error of its form."""

    further_entry: ClassVar[float] = math.inf
    """Evidence with which a further candidate enters where no structure is seen in what those before leave; infinite,
    none does. It is one direction, and structure is looked for along hundreds."""

    form_margin: ClassVar[float] = 0.0
    """Part of a set's score by which another's may be less without being told from it: what an error in the form of
    the baseline brings the one and not the other."""

    def left_in_the_main(self, count: int) -> float:
        """Part of the gain of that many candidates that may be left over where they are the cause in the main."""
        del count
        return 0.0

    def left_by_named(self, count: int) -> float:
        """The same where withheld rows bear them out and they are named."""
        return self.left_in_the_main(count)

    def foretells(self, fits: tuple[F, ...]) -> bool:
        """Whether the laws of some fits foretell withheld rows to the noise; one that small errors upset does not."""
        del fits
        return True

    @abstractmethod
    def rank(self, problem: P, without: Collection[str] = ()) -> list[F]:
        """All candidates but some fitted, best score first."""

    @abstractmethod
    def fit(self, problem: P, candidate: Any) -> F:  # noqa: ANN401 - each catalogue has its own kind of candidate
        """Best values of one candidate with the baseline free to move."""

    def weak_below(self, leading: tuple[F, ...]) -> float:
        """Gain below which an effect of another kind may pass for the leading fits."""
        del leading
        return WEAK

    def in_detail(self, problem: P, fit: F, *, narrower: bool = False) -> F:
        """A fit in more detail where it has such a form and the data call for it; as it is otherwise.

        With `narrower`, one that acts in several places is tried in each of them alone, too.
        """
        return fit

    def free_form(self, problem: P, fit: F) -> Array:
        """Whitened columns (m, k) along which the law of a fit may bend smoothly by its own covariates; none here."""
        del fit
        return np.zeros((len(problem.left), 0))

    def choose(self, problem: P, without: Collection[str] = ()) -> F:
        """The best candidate but some; the leading ones are compared in detail."""
        detailed = [self.in_detail(problem, fit) for fit in leaders(self.rank(problem, without))]
        return max(detailed, key=problem.score)


def leaders(ranked: list[F]) -> list[F]:
    """The best fit of each of the leading candidates."""
    best: dict[str, F] = {}
    for fit in ranked:
        best.setdefault(fit.identifier, fit)
    return list(best.values())[:LEADERS]

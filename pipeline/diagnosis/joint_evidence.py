"""Evidence of steady points and runs in motion added up, for each set of causes that both allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.conclusion import Conclusion

Causes: TypeAlias = "dict[str, str]"
"""A set of mechanisms: the shaft of each by its id."""


@dataclass(frozen=True)
class SetEvidence:
    """Evidence of the sets that a conclusion leaves, in their order.

    Parameters
    ----------
    scores : tuple of float
        In noise variances, as far as it counts as evidence.
    of_form : float
        Evidence that an error of form is worth.
    by_parts : int
        How many of them, the last ones, are there because parts of the rows name them, not by their evidence.
    """

    scores: tuple[float, ...]
    of_form: float
    by_parts: int

    def by_evidence(self, place: int) -> bool:
        """Whether a set stands by its evidence."""
        return place < len(self.scores) - self.by_parts


def evidence_of(conclusion: Conclusion[Any, Any], form_margin: float) -> SetEvidence:
    """Evidence of the sets of a conclusion, of which an error of form is worth a part."""
    naming = conclusion.naming
    if naming is None:
        return SetEvidence((), 0.0, 0)
    scores = tuple(naming.evidence_scale * each.score for each in (naming.best, *naming.rivals))
    return SetEvidence(scores, form_margin * max(scores[0], 0.0), naming.by_parts)


def of_most_evidence(
    sets: list[tuple[Causes, int, int]], steady: SetEvidence, moving: SetEvidence
) -> tuple[Causes, ...]:
    """Sets that both kinds allow, whose evidence together comes near that of the best, which is the first.

    Each stands with its place in what either kind leaves. What parts of the rows name instead is not judged by its
    evidence: it stays.
    """

    def evidence(one: tuple[Causes, int, int]) -> float:
        _, a, b = one
        return steady.scores[a] + moving.scores[b]

    ranked = sorted(sets, key=lambda one: -evidence(one))
    judged = [one for one in ranked if steady.by_evidence(one[1]) and moving.by_evidence(one[2])]
    if not judged:
        return tuple(causes for causes, _, _ in sets)
    least = evidence(judged[0]) - MARGIN - steady.of_form - moving.of_form
    return tuple(one[0] for one in ranked if one not in judged or one is judged[0] or evidence(one) > least)

"""Steady points and runs in motion of one campaign: the causes that both kinds of evidence allow, as one diagnosis."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.joint.weighing import Causes, KindOfEvidence, WeighedSet

    Kinds: TypeAlias = tuple[KindOfEvidence[Any, Any], KindOfEvidence[Any, Any]]

ANYWHERE = "either"
"""A shaft that another kind of evidence may make definite."""

BY_BOTH, APART = "both kinds allow it", "each kind has a cause of its own"
CONTRADICTED = "the sizes that either kind shows contradict each other"
BY_STEADY, BY_MOTION = "the steady points show it", "the runs in motion show it"


@dataclass(frozen=True)
class JointDiagnosis:
    """What two kinds of evidence say together.

    Parameters
    ----------
    verdict : Verdict
        Of both.
    p_value : float
        Of a mismatch in either, corrected for there being two.
    sets : tuple of dict of str to str
        Sets of causes that may be, the leading one first: the shaft of each by its id.
    by : str
        Which evidence shows them.
    something_else : bool
        Whether a cause may be one that no library has.
    weights : tuple of float
        Probability of each set, for equal prior odds, where it is one of them.
    ruled_out : tuple of dict of str to str
        Sets that one kind allows and the other does not.
    sizes : dict of str to (float, float)
        Size in the leading set, and its standard uncertainty, of each mechanism whose size both kinds know, by its id.
    """

    verdict: Verdict
    p_value: float
    sets: tuple[Causes, ...] = ()
    by: str = ""
    something_else: bool = False
    weights: tuple[float, ...] = ()
    ruled_out: tuple[Causes, ...] = ()
    sizes: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def found(self) -> bool:
        """Whether either kind differs from the model beyond the noise."""
        return self.p_value <= FALSE_ALARM_RATE


@dataclass(frozen=True)
class _JointSet:
    """A set as both kinds see it; `apart_in` says in which it stands by parts of the rows only.

    `fair` is its evidence in each to be held against that of the best set there: what a size costs is not counted
    against it that the other kind knows, too.
    """

    causes: Causes
    shares: tuple[WeighedSet, WeighedSet]
    fair: tuple[float, float]
    disagreement: float
    score: float
    apart_in: tuple[bool, bool]


def join(steady: KindOfEvidence[Any, Any], moving: KindOfEvidence[Any, Any]) -> JointDiagnosis:
    r"""One diagnosis from that of the steady points and that of the runs in motion.

    Parameters
    ----------
    steady, moving : KindOfEvidence
        Each with what it says by itself.

    Notes
    -----
    The readings are independent, so logarithms of likelihoods add up. Every set that one kind leaves is fitted to the
    rows of the other, too, whether those show a mismatch or not. A size :math:`a` that both know is one size: beside
    the two fits by themselves it costs :math:`(a_1 - a_2)^2 / (u_1^2 + u_2^2)` and saves the cost of a parameter. What
    one library does not have, or a size it does not share, is no evidence there. A set goes where one kind has another
    whose evidence is larger by the margin by which it would name that, or where its sizes differ by as much; not by
    evidence too weak to name a cause, which may have one beside the set, nor where the library lacks a law. If all go,
    a set of either kind together are tried, and if those go, too, each kind has a cause of its own. Of those that stay
    the ones near the best are left. Where neither kind proves a set by itself, one size in both does. The p-value is
    Bonferroni's.
    """
    kinds = (steady, moving)
    p_value = min(1.0, 2.0 * min(kind.p_value for kind in kinds))
    verdicts = {kind.conclusion.verdict for kind in kinds}
    if p_value > FALSE_ALARM_RATE:
        return JointDiagnosis(Verdict.CONFOUNDED if Verdict.CONFOUNDED in verdicts else Verdict.CONSISTENT, p_value)
    naming = [kind for kind in kinds if kind.sets]
    if not naming:
        none = Verdict.NOT_IN_LIBRARY if Verdict.NOT_IN_LIBRARY in verdicts else Verdict.CONFOUNDED
        return JointDiagnosis(none, p_value)
    alone = [_weighed(kinds, causes, apart) for causes, apart in _distinct(kinds)]
    left = _left(kinds, alone, alone) or _left(kinds, alone, _together(kinds))
    unexplained = any(not kind.sets and kind.p_value <= FALSE_ALARM_RATE for kind in kinds)
    unexplained |= any(kind.conclusion.in_part for kind in kinds)
    if not left:
        leading = tuple({frozenset(kind.sets[0][0].items()): kind.sets[0][0] for kind in naming}.values())
        weights = (1.0 / len(leading),) * len(leading)
        if len(leading) == 1:
            return JointDiagnosis(Verdict.AMBIGUOUS, p_value, leading, CONTRADICTED, True, weights)
        return JointDiagnosis(Verdict.AMBIGUOUS, p_value, leading, APART, unexplained, weights)
    left += _beside_weak(kinds, alone, left[0])
    sets, weights = _merged(left, _limit(kinds))
    by = [share.score > 0.0 for share in left[0].shares]  # more than it costs there
    showing = [kind for kind, shows in zip(kinds, by, strict=True) if shows and kind.sets] or naming
    else_ = unexplained or (all(kind.conclusion.weak for kind in showing) and not _predicted(left[0]))
    kept = [each.causes for each in left]
    gone = tuple(each.causes for each in alone if each.causes not in kept)
    verdict = Verdict.NAMED if len(sets) == 1 and not else_ else Verdict.AMBIGUOUS
    words = BY_BOTH if all(by) else BY_STEADY if by[0] or naming == [steady] else BY_MOTION
    sizes = _sizes_of_both(left[0]) if sets[0] == left[0].causes else {}
    return JointDiagnosis(verdict, p_value, sets, words, else_, weights, _ruled_out(gone, kept), sizes)


def _distinct(kinds: Kinds) -> list[tuple[Causes, tuple[bool, bool]]]:
    """Sets of both kinds, each once, on definite shafts; and in which kind each stands by parts of the rows only."""
    found: dict[frozenset[tuple[str, str]], tuple[Causes, list[bool]]] = {}
    for place, kind in enumerate(kinds):
        for causes, by_parts in kind.sets:
            for each in _definite(causes):
                apart = found.setdefault(frozenset(each.items()), (each, [False, False]))[1]
                apart[place] |= by_parts
    return [(causes, (apart[0], apart[1])) for causes, apart in found.values()]


def _definite(causes: Causes) -> list[Causes]:
    """A set on each of the shafts that it leaves open."""
    choices = [[(name, side) for side in (SIDES if shaft == ANYWHERE else (shaft,))] for name, shaft in causes.items()]
    return [dict(chosen) for chosen in itertools.product(*choices)]


def _beside(causes: Causes, kind: KindOfEvidence[Any, Any]) -> list[Causes]:
    """Sets of a kind that may stand beside some causes: no mechanism is on two shafts then."""
    sets = [each for one, _ in kind.sets for each in _definite(one)]
    return [one for one in sets if all(one[name] == causes[name] for name in one.keys() & causes.keys())]


def _weighed(
    kinds: Kinds,
    causes: Causes,
    apart_in: tuple[bool, bool] = (False, False),
) -> _JointSet:
    """A set as both kinds see it."""
    one, other = (kind.weigh(causes) for kind in kinds)
    disagreement, shared = 0.0, one.sizes.keys() & other.sizes.keys()
    for name in shared:
        (a, variance), (b, of_other) = one.sizes[name], other.sizes[name]
        disagreement += (a - b) ** 2 / (variance + of_other)
    score = one.score + other.score + len(shared) * min(kind.cost for kind in kinds) - disagreement
    ours, theirs = (each.score + len(shared) * kind.cost for each, kind in zip((one, other), kinds, strict=True))
    return _JointSet(causes, (one, other), (ours, theirs), disagreement, score, apart_in)


def _together(kinds: Kinds) -> list[_JointSet]:
    """A set of one kind with one of the other."""
    one, other = kinds
    ours = [each for causes, _ in one.sets for each in _definite(causes)]
    return [_weighed(kinds, each | theirs) for each in ours for theirs in _beside(each, other)]


def _left(kinds: Kinds, alone: list[_JointSet], tried: list[_JointSet]) -> list[_JointSet]:
    """Sets that neither kind excludes, near the best of them, which is the first."""
    own, limit = _own(kinds, alone), _limit(kinds)

    def allowed(each: _JointSet) -> bool:
        excluded = (
            own[k] - each.fair[k] > kind.margin
            for k, kind in enumerate(kinds)
            if not (each.apart_in[k] or kind.tells_little or kind.lacks(each.causes))
        )
        return each.disagreement <= limit and not any(excluded)

    judged = sorted((e for e in tried if allowed(e)), key=lambda e: -e.score)
    best = next((each for each in judged if not any(each.apart_in)), None)
    if best is None:
        return judged
    near = (each for each in judged if any(each.apart_in) or best.score - each.score <= limit)
    return [best, *(each for each in near if each is not best)]


def _limit(kinds: Kinds) -> float:
    """Evidence by which sets, and sizes of a set, may differ and not be told apart [noise variances]."""
    return MARGIN + sum(kind.of_form for kind in kinds)


def _own(kinds: Kinds, alone: list[_JointSet]) -> list[float]:
    """Evidence of the best set in each kind, of those that stand by evidence there; 0 without any."""
    return [max([0.0, *(e.shares[k].score for e in alone if not e.apart_in[k])]) for k in range(len(kinds))]


def _beside_weak(kinds: Kinds, alone: list[_JointSet], best: _JointSet) -> list[_JointSet]:
    """The leading set with what a weak mismatch in one kind may be due to, where the set does not explain that.

    It is as likely as the leading set: a mismatch that is too weak to be named says no more.
    """
    for k, (kind, own) in enumerate(zip(kinds, _own(kinds, alone), strict=True)):
        if not kind.tells_little or own - best.fair[k] <= kind.margin or kind.lacks(best.causes):
            continue
        pairs = [_weighed(kinds, best.causes | one) for one in _beside(best.causes, kind)]
        pairs = [each for each in pairs if each.disagreement <= _limit(kinds) and each.causes != best.causes]
        if pairs:
            return [replace(max(pairs, key=lambda each: each.fair[k]), score=best.score)]
    return []


def _merged(left: list[_JointSet], limit: float) -> tuple[tuple[Causes, ...], tuple[float, ...]]:
    """Sets without those that differ by a shaft alone, which is then open; and the probability of each."""
    even = 0.5 * MARGIN / limit
    found: list[tuple[Causes, float]] = []
    for each in left:
        weight = math.exp(even * (each.score - left[0].score))
        for place, (known, so_far) in enumerate(found):
            if (merged := _on_either(known, each.causes)) is not None:
                found[place] = merged, so_far + weight
                break
        else:
            found.append((each.causes, weight))
    whole = sum(weight for _, weight in found)
    return tuple(causes for causes, _ in found), tuple(weight / whole for _, weight in found)


def _on_either(one: Causes, other: Causes) -> Causes | None:
    """Two sets as one whose only difference is the shaft of one mechanism, which is open then; None for others."""
    if one.keys() != other.keys():
        return None
    differ = [name for name in one if one[name] != other[name]]
    if len(differ) > 1 or any({one[name], other[name]} - {*SIDES, ANYWHERE} for name in differ):
        return None
    return one | dict.fromkeys(differ, ANYWHERE)


PREDICTED = 3.0
"""Standard errors from zero of a size in each kind from which on that of one kind, as large, predicts the other."""


def _predicted(leading: _JointSet) -> bool:
    """Whether each kind shows every size of a set by itself, and the sizes agree: the one is a proof of the other."""
    one, other = leading.shares
    shown = [
        min(abs(size) / math.sqrt(variance) for size, variance in (one.sizes[name], other.sizes[name]))
        for name in leading.causes.keys() & one.sizes.keys() & other.sizes.keys()
    ]
    return len(shown) == len(leading.causes) and min(shown) > PREDICTED and leading.disagreement < PREDICTED**2


def _sizes_of_both(leading: _JointSet) -> dict[str, tuple[float, float]]:
    r"""Sizes that both kinds know, and their standard uncertainties.

    The weighted mean; where the two differ by more than they are known its uncertainty grows by their distance over
    that (R. T. Birge, 'The Calculation of Errors by the Method of Least Squares', Phys. Rev. 40 (1932) 207).
    """
    one, other = leading.shares
    found = {}
    for name in sorted(one.sizes.keys() & other.sizes.keys()):
        (a, variance), (b, of_other) = one.sizes[name], other.sizes[name]
        both = variance + of_other
        apart = max(1.0, abs(a - b) / math.sqrt(both))
        found[name] = (a * of_other + b * variance) / both, apart * math.sqrt(variance * of_other / both)
    return found


def _ruled_out(gone: Iterable[Causes], kept: list[Causes]) -> tuple[Causes, ...]:
    """Sets that went, each once; of ids that none of those has that stayed."""
    return tuple({frozenset(one): one for one in gone if not any(one.keys() <= each.keys() for each in kept)}.values())

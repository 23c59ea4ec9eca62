"""Steady points and runs in motion of one campaign: the causes that both kinds of evidence allow, as one diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.conclusion import KNOWN
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.diagnosis.grid.rivals import NONE_KNOWN
from pmg.pipeline.diagnosis.grid.statement import PHRASES, SHAFT_WORDS
from pmg.pipeline.diagnosis.joint_evidence import evidence_of, of_most_evidence
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.catalogue import FORM_MARGIN
from pmg.pipeline.wording.plurals import uncapitalised

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
    from pmg.pipeline.diagnosis.joint_evidence import Causes

ANYWHERE = "either"
"""A shaft that another kind of evidence may make definite."""

OR_ELSE = "one that the catalogue does not have"

BY_BOTH, APART = "both kinds allow it", "each kind has a cause of its own"
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
        Which evidence allows them.
    something_else : bool
        Whether one kind differs in a way that no mechanism of the catalogue explains.
    """

    verdict: Verdict
    p_value: float
    sets: tuple[Causes, ...] = ()
    by: str = ""
    something_else: bool = False

    @property
    def found(self) -> bool:
        """Whether either kind differs from the model beyond the noise."""
        return self.p_value <= FALSE_ALARM_RATE


def join(steady: Conclusion[Any, Any], moving: Conclusion[Any, Any], p_values: tuple[float, float]) -> JointDiagnosis:
    """One diagnosis from that of the steady points and that of the runs in motion.

    Parameters
    ----------
    steady, moving : Conclusion
        Each made by itself.
    p_values : tuple of float
        Of the mismatch in each.

    Notes
    -----
    The readings are independent, so a set is allowed by both where both allow it: on mechanisms that both libraries
    have the sets must be the same, on shafts that do not exclude each other; a mechanism of one library alone cannot be
    asked of the other. Logarithms of likelihoods of independent readings add up: of the sets that both allow, those go
    whose evidence in both kinds together is less than that of the best by the margin by which one kind would name it.
    Sizes are free in each kind. A kind that does not differ is not held against what the other names: whether it would
    have seen it is not asked. The p-value is Bonferroni's.
    """
    p_value = min(1.0, 2.0 * min(p_values))
    verdicts = {steady.verdict, moving.verdict}
    if p_value > FALSE_ALARM_RATE:
        blind = Verdict.CONFOUNDED in verdicts
        return JointDiagnosis(Verdict.CONFOUNDED if blind else Verdict.CONSISTENT, p_value)
    ours, theirs = _sets_of(steady), _sets_of(moving)
    if not ours and not theirs:
        none = Verdict.NOT_IN_LIBRARY if Verdict.NOT_IN_LIBRARY in verdicts else Verdict.CONFOUNDED
        return JointDiagnosis(none, p_value)
    if not ours or not theirs:
        one, silent = (steady, p_values[1]) if ours else (moving, p_values[0])
        other = silent <= FALSE_ALARM_RATE  # it differs, and nothing explains it
        verdict = Verdict.AMBIGUOUS if other else one.verdict
        by = BY_STEADY if ours else BY_MOTION
        return JointDiagnosis(verdict, p_value, ours or theirs, by, other or one.weak)
    shared = _ids_of_steady() & _ids_in_motion()

    def joined(a: int, b: int) -> Causes | None:
        return _joined(ours[a], theirs[b], shared)

    pairs = ((each, a, b) for a in range(len(ours)) for b in range(len(theirs)) if (each := joined(a, b)) is not None)
    both = {frozenset(each.items()): (each, a, b) for each, a, b in pairs}
    if not both:
        return JointDiagnosis(Verdict.AMBIGUOUS, p_value, (ours[0], theirs[0]), APART)
    distinct = of_most_evidence(list(both.values()), evidence_of(steady, 0.0), evidence_of(moving, FORM_MARGIN))
    weak = steady.weak and moving.weak
    verdict = Verdict.NAMED if len(distinct) == 1 and not weak else Verdict.AMBIGUOUS
    return JointDiagnosis(verdict, p_value, distinct, BY_BOTH, weak)


def _sets_of(conclusion: Conclusion[Any, Any]) -> tuple[Causes, ...]:
    """Sets that a conclusion leaves, the leading one first; none where it names nothing."""
    naming = conclusion.naming
    if naming is None or not conclusion.verdict.names:
        return ()
    best = {fit.identifier: naming.shafts.get(fit.identifier, fit.place) for fit in naming.best.fits}
    return (best, *({fit.identifier: fit.place for fit in rival.fits} for rival in naming.rivals))


def _joined(one: Causes, other: Causes, shared: frozenset[str]) -> Causes | None:
    """Two sets as one; None where they contradict each other."""
    if {name for name in one if name in shared} != {name for name in other if name in shared}:
        return None
    found = one | other
    for name in one.keys() & other.keys():
        shafts = {one[name], other[name]} - {ANYWHERE}
        if len(shafts) > 1:
            return None
        found[name] = shafts.pop() if shafts else one[name]
    return found


def _ids_of_steady() -> frozenset[str]:
    return frozenset(candidate.identifier for candidate in candidates())


def _ids_in_motion() -> frozenset[str]:
    return frozenset(term.identifier for term in library())


def titles() -> dict[str, str]:
    """Titles of the mechanisms of both libraries by their ids."""
    moving = {term.identifier: term.title for term in reversed(library())}  # the plainest form comes first
    return moving | {candidate.identifier: candidate.kind.title for candidate in candidates()}


def _joint_statement(joint: JointDiagnosis, documents: tuple[Mapping[str, Any], Mapping[str, Any]]) -> str:
    """The joint verdict in a sentence, and what each kind of evidence says alone."""
    known = titles()

    def words(causes: Causes) -> str:
        return " together with ".join(
            f"{uncapitalised(known[name])}{SHAFT_WORDS[shaft]}" for name, shaft in causes.items()
        )

    causes = "; or ".join([*map(words, joint.sets), *[OR_ELSE] * joint.something_else])
    together = "together name" if joint.verdict is Verdict.NAMED else "together leave"
    match joint.verdict:
        case Verdict.AMBIGUOUS if joint.by == APART:
            found = f"name different causes: {' and '.join(map(words, joint.sets))}"
        case Verdict.NAMED | Verdict.AMBIGUOUS:
            one = joint.by.removesuffix(" it")
            found = f"{together} {causes}" if joint.by == BY_BOTH else f"differ from the model: {one} {causes}"
        case Verdict.NOT_IN_LIBRARY:
            found = "differ from the model, and no mechanism of the catalogue explains it"
        case Verdict.CONFOUNDED:
            found = "together cannot tell"
        case _:
            found = f"do not differ from the model beyond the noise (p = {joint.p_value:.3g} of both)"
    steady, moving = documents
    alone = f"Steady points alone, {steady['phrase']}: {steady['statement']}"
    return (
        f"Steady points and runs in motion {found}. {alone} "
        f"Runs in motion alone, {moving['phrase']}: {moving['statement']}"
    )


def joint_document(joint: JointDiagnosis, steady: Mapping[str, Any], moving: Mapping[str, Any]) -> dict[str, Any]:
    """One document ``pmg.diagnosis/1`` from those of both kinds; its shape is that of the steady one.

    A mechanism that both have stands with the numbers of the kind that knows its first parameter better, of those that
    say the joint shaft.
    """
    design = {**(steady["design"] or {"blind_to_slow_changes": [], "look_alike": []})}
    design["unseen"] = [*design.get("unseen", []), *(moving["design"] or {}).get("unseen", [])]
    told = {
        **steady,
        "verdict": str(joint.verdict),
        "phrase": PHRASES[joint.verdict],
        "statement": _joint_statement(joint, (steady, moving)),
        "weak": joint.something_else,
        "p_value": joint.p_value,
        "near_ties": [],
        "form": None,
        "decoys": None,
        "shape": None,
        "mechanisms": [],
        "rivals": [],
        "design": design,
    }
    if not joint.found:
        return told | {"locations": [], "absorbed": [], "held_out": None, "next_tests": []}
    undecided = joint.verdict in (Verdict.AMBIGUOUS, Verdict.CONFOUNDED)
    known = KNOWN if joint.something_else else 1.0
    names = dict.fromkeys((name, shaft) for causes in joint.sets for name, shaft in causes.items())
    mechanisms = []
    for name, shaft in names:
        share = sum(causes.get(name) == shaft for causes in joint.sets) / len(joint.sets)
        mechanisms.append(_row(name, shaft, (moving, steady)) | {"probability": known * share})
    rivals = [
        {
            "ids": list(causes),
            "shafts": list(causes.values()),
            "why": joint.by,
            "separating_test": _test(causes, steady),
        }
        for causes in joint.sets[1:]
    ]
    if joint.something_else:
        rivals.append(NONE_KNOWN)
    return told | {
        "locations": [*steady["locations"], *moving["locations"]],
        "mechanisms": mechanisms,
        "rivals": rivals if joint.verdict is Verdict.AMBIGUOUS else [],
        "absorbed": [*steady["absorbed"], *moving["absorbed"]],
        "held_out": steady["held_out"] or moving["held_out"],
        "next_tests": [*steady["next_tests"], *moving["next_tests"]] if undecided else [],
    }


def _row(name: str, shaft: str, documents: tuple[Mapping[str, Any], ...]) -> dict[str, Any]:
    """The mechanism as the kind has it that says that shaft, and knows its first parameter best."""
    rows = [row for document in documents for row in document["mechanisms"] if row["id"] == name]
    same = [row for row in rows if row["shaft"] == shaft]
    found: dict[str, Any] = min(same or rows, key=_relative_error)
    return found | {"shaft": shaft}


def _test(causes: Causes, steady: Mapping[str, Any]) -> str:
    """The test by which the steady points would tell a set."""
    tests = (row["separating_test"] for row in steady["rivals"] if set(causes) <= set(row["ids"]))
    return next(tests, "")


def _relative_error(row: Mapping[str, Any]) -> float:
    """Standard error of the first parameter of a mechanism over its value; infinite where it has none."""
    for parameter in row["parameters"][:1]:
        if parameter["standard_error"] and parameter["value"]:
            return abs(float(parameter["standard_error"]) / float(parameter["value"]))
    return float("inf")

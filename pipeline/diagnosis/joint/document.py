"""The joint diagnosis in the shape of ``pmg.diagnosis/1``, and in a sentence."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.conclusion import KNOWN
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.diagnosis.grid.rivals import NONE_KNOWN
from pmg.pipeline.diagnosis.grid.statement import PHRASES
from pmg.pipeline.diagnosis.joint.join import APART, BY_BOTH, CONTRADICTED
from pmg.pipeline.diagnosis.joint.weighing import ONE_SIZE
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS, TOGETHER
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.sim.shafts import SIDES, other_side

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.diagnosis.joint.join import JointDiagnosis
    from pmg.pipeline.diagnosis.joint.weighing import Causes

OR_ELSE = "one that the catalogue does not have"


def titles() -> dict[str, str]:
    """Titles of the mechanisms of both libraries by their ids."""
    moving = {term.identifier: term.title for term in reversed(library())}  # the plainest form comes first
    return moving | {candidate.identifier: candidate.kind.title for candidate in candidates()}


def joint_sentence(joint: JointDiagnosis) -> str:
    """The joint verdict in a sentence, and what is ruled out."""
    known = titles()

    def words(causes: Causes) -> str:
        return TOGETHER.join(f"{uncapitalised(known[name])}{SHAFT_WORDS[shaft]}" for name, shaft in causes.items())

    causes = "; or ".join([*map(words, joint.sets), *[OR_ELSE] * joint.something_else])
    ruled_out = f" They rule out {' and '.join(map(words, joint.ruled_out))}." if joint.ruled_out else ""
    together = "together name" if joint.verdict is Verdict.NAMED else "together leave"
    match joint.verdict:
        case Verdict.AMBIGUOUS if joint.by == APART:
            found = f"name different causes: {' and '.join(map(words, joint.sets))}"
        case Verdict.AMBIGUOUS if joint.by == CONTRADICTED:
            found = f"differ from the model, and would have {causes} at sizes that contradict each other"
        case Verdict.NAMED | Verdict.AMBIGUOUS:
            one = joint.by.removesuffix(" it")
            found = f"{together} {causes}" if joint.by == BY_BOTH else f"differ from the model: {one} {causes}"
        case Verdict.NOT_IN_LIBRARY:
            found = "differ from the model, and no mechanism of the catalogue explains it"
        case Verdict.CONFOUNDED:
            found = "together cannot tell"
        case _:
            found = f"do not differ from the model beyond the noise (p = {joint.p_value:.3g} of both)"
    return f"Steady points and runs in motion {found}.{ruled_out}"


def _joint_statement(joint: JointDiagnosis, documents: tuple[Mapping[str, Any], Mapping[str, Any]]) -> str:
    """The joint verdict, and what each kind of evidence says alone."""
    steady, moving = documents
    return (
        f"{joint_sentence(joint)} Steady points alone, {steady['phrase']}: {steady['statement']} "
        f"Runs in motion alone, {moving['phrase']}: {moving['statement']}"
    )


def joint_document(joint: JointDiagnosis, steady: Mapping[str, Any], moving: Mapping[str, Any]) -> dict[str, Any]:
    """One document ``pmg.diagnosis/1`` from those of both kinds; its shape is that of the steady one.

    A mechanism that both have stands with the numbers of the kind that knows its first parameter better, of those that
    say the joint shaft; a size that is one in both is that of both together.
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
        share = sum(w for each, w in zip(joint.sets, joint.weights, strict=True) if each.get(name) == shaft)
        row = _row(name, shaft, (moving, steady))
        if joint.sets[0].get(name) == shaft and name in joint.sizes:
            row = _with_size(row, *joint.sizes[name])
        mechanisms.append(row | {"probability": known * share})
    rivals = [
        {
            "ids": list(causes),
            "shafts": list(causes.values()),
            "why": joint.by,
            "separating_test": _test(causes, (steady, moving)),
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
    """The mechanism as the kind has it that says that shaft, and knows its first parameter best.

    Where one leaves the shaft open, its part and parameters are those of the joint shaft.
    """
    rows = [row for document in documents for row in document["mechanisms"] if row["id"] == name]
    same = [row for row in rows if row["shaft"] == shaft]
    found: dict[str, Any] = min(same or rows, key=_relative_error)
    if not same and shaft in SIDES:
        of_shaft = [p for p in found["parameters"] if not p["name"].endswith(f"_{other_side(shaft)}")]
        parts = (each for each in _components() if each[:2] == (name, shaft))
        component = next((part for *_, part in parts), found["component"])
        found = found | {"parameters": of_shaft, "component": component}
    return found | {"shaft": shaft}


def _with_size(row: dict[str, Any], value: float, uncertainty: float) -> dict[str, Any]:
    """The mechanism with the size that both kinds together give it, where it has no other parameter."""
    if len(row["parameters"]) != 1 or row["parameters"][0]["name"] not in ONE_SIZE[row["id"]]:
        return row
    return row | {"parameters": [row["parameters"][0] | {"value": value, "standard_error": uncertainty}]}


@cache
def _components() -> tuple[tuple[str, str, str], ...]:
    """Id, shaft and component of the mechanisms of both libraries."""
    of_points = (
        (each.identifier, shaft, str(part)) for each in candidates() for shaft, part in each.kind.components.items()
    )
    return (*of_points, *((term.identifier, term.place, str(term.component)) for term in library()))


def _test(causes: Causes, documents: tuple[Mapping[str, Any], ...]) -> str:
    """The test by which one kind would tell a set."""
    rivals = (row for document in documents for row in document["rivals"] if set(causes) <= set(row["ids"]))
    return next((row["separating_test"] for row in rivals if row["separating_test"]), "")


def _relative_error(row: Mapping[str, Any]) -> float:
    """Standard error of the first parameter of a mechanism over its value; infinite where it has none."""
    for parameter in row["parameters"][:1]:
        if parameter["standard_error"] and parameter["value"]:
            return abs(float(parameter["standard_error"]) / float(parameter["value"]))
    return float("inf")

"""Steady points and runs in motion together: what one leaves open the other settles, and what both contradict."""

from __future__ import annotations

import json
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from tests.conftest import ROOT

from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.joint import APART, BY_BOTH, BY_MOTION, BY_STEADY, join, joint_document

GAIN, LOAD, IRON = "torque_gain_error", "load_dependent_bearing_friction", "load_dependent_iron_loss"
INERTIA, WINDAGE, VISCOSITY = "rotor_inertia", "windage", "lubricant_viscosity"
FOUND = (0.002, 0.002)
QUIET: Conclusion[Any, Any] = Conclusion(verdict=Verdict.CONSISTENT)


def concluded(
    *sets: dict[str, str],
    verdict: Verdict | None = None,
    weak: bool = False,
    scores: tuple[float, ...] = (),
    by_parts: int = 0,
) -> Conclusion[Any, Any]:
    """A conclusion that leaves some sets of causes, each the shaft by the id, of even evidence where none is given."""
    each = [
        SimpleNamespace(
            fits=[SimpleNamespace(identifier=name, place=place) for name, place in one.items()], score=score
        )
        for one, score in zip(sets, scores or [100.0] * len(sets), strict=True)
    ]
    naming: Any = (
        SimpleNamespace(best=each[0], rivals=each[1:], shafts=sets[0], evidence_scale=1.0, by_parts=by_parts)
        if sets
        else None
    )
    found = Verdict.NAMED if len(sets) == 1 else Verdict.AMBIGUOUS
    return Conclusion(verdict=verdict or found, naming=naming, weak=weak)


def test_what_one_leaves_open_the_other_settles() -> None:
    steady = concluded({LOAD: "sun"}, {IRON: "both"}, {GAIN: "either"})
    for moving in (concluded({GAIN: "ring"}), concluded({GAIN: "ring"}, {IRON: "sun", LOAD: "sun"})):
        found = join(steady, moving, FOUND)
        assert (found.verdict, found.sets, found.by) == (Verdict.NAMED, ({GAIN: "ring"},), BY_BOTH)
    still = join(steady, concluded({GAIN: "ring"}, {LOAD: "sun"}), FOUND)
    assert still.verdict is Verdict.AMBIGUOUS
    assert still.sets == ({LOAD: "sun"}, {GAIN: "ring"})


@pytest.mark.parametrize(
    ("steady", "moving", "named"),
    [
        ((100.0, 93.0), (50.0, 43.0), GAIN),  # odds of e^7 are no proof; those of e^14 are
        ((100.0, 93.0), (50.0, 49.0), None),
        ((100.0, 93.0), (28.0, 50.0), LOAD),  # the clearer of both leads
        ((100.0, 93.0), (43.0, 50.0), None),
        ((100.0, 93.0), (950.0, 940.0), None),  # an error of form is worth as much
    ],
)
def test_evidence_of_both_kinds_adds_up(
    steady: tuple[float, float], moving: tuple[float, float], named: str | None
) -> None:
    ours = concluded({GAIN: "sun"}, {LOAD: "sun"}, scores=steady)
    theirs = concluded({GAIN: "sun"}, {LOAD: "sun"}, scores=moving)
    found = join(ours, theirs, FOUND)
    assert found.verdict is (Verdict.AMBIGUOUS if named is None else Verdict.NAMED)
    assert len(found.sets) == 2 if named is None else found.sets == ({named: "sun"},)
    by_parts = concluded({GAIN: "sun"}, {LOAD: "sun"}, scores=moving, by_parts=1)
    assert join(ours, by_parts, FOUND).verdict is Verdict.AMBIGUOUS


def test_a_cause_that_only_one_kind_knows_stands_beside_the_shared_one() -> None:
    found = join(concluded({GAIN: "sun", WINDAGE: "sun"}), concluded({GAIN: "sun", INERTIA: "ring"}), FOUND)
    assert found.verdict is Verdict.NAMED
    assert found.sets == ({GAIN: "sun", WINDAGE: "sun", INERTIA: "ring"},)


def test_causes_that_exclude_each_other_are_both_told() -> None:
    for moving in (concluded({GAIN: "ring"}), concluded({LOAD: "sun"})):
        found = join(concluded({GAIN: "sun"}), moving, FOUND)
        assert (found.verdict, found.by, len(found.sets)) == (Verdict.AMBIGUOUS, APART, 2)


def test_one_kind_may_see_what_the_other_cannot() -> None:
    for pair, by in (
        ((concluded({GAIN: "sun"}), QUIET), BY_STEADY),
        ((QUIET, concluded({INERTIA: "ring"})), BY_MOTION),
    ):
        found = join(*pair, (0.002, 0.6) if by == BY_STEADY else (0.6, 0.002))
        assert (found.verdict, found.by, found.something_else) == (Verdict.NAMED, by, False)
    unknown: Conclusion[Any, Any] = concluded(verdict=Verdict.NOT_IN_LIBRARY)
    found = join(concluded({GAIN: "sun"}), unknown, FOUND)
    assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, True)
    assert join(unknown, QUIET, FOUND).verdict is Verdict.NOT_IN_LIBRARY


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_two_looks_are_counted_as_two(one: float, other: float) -> None:
    found = join(concluded({GAIN: "sun"}), QUIET, (one, other))
    assert found.p_value == min(1.0, 2.0 * min(one, other))
    assert (found.verdict is Verdict.CONSISTENT) == (found.p_value > 0.05)


def test_a_blind_kind_stays_blind_where_nothing_is_found() -> None:
    blind: Conclusion[Any, Any] = Conclusion(verdict=Verdict.CONFOUNDED)
    assert join(blind, QUIET, (0.5, 0.5)).verdict is Verdict.CONFOUNDED
    assert join(QUIET, QUIET, (0.5, 0.5)).verdict is Verdict.CONSISTENT


def test_two_weak_kinds_name_nothing_for_sure() -> None:
    weak = concluded({GAIN: "sun"}, {LOAD: "sun"}, weak=True)
    found = join(weak, concluded({GAIN: "sun"}, verdict=Verdict.AMBIGUOUS, weak=True), FOUND)
    assert (found.verdict, found.sets, found.something_else) == (Verdict.AMBIGUOUS, ({GAIN: "sun"},), True)


def test_a_kind_that_differs_without_a_cause_is_counted() -> None:
    for silent in (Verdict.CONFOUNDED, Verdict.NOT_IN_LIBRARY):
        found = join(concluded({GAIN: "sun"}), concluded(verdict=silent), FOUND)
        assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, True)
    blind_and_quiet = join(concluded({GAIN: "sun"}), concluded(verdict=Verdict.CONFOUNDED), (0.002, 0.4))
    assert (blind_and_quiet.verdict, blind_and_quiet.something_else) == (Verdict.NAMED, False)


def test_both_bearings_are_not_one_of_them() -> None:
    found = join(concluded({VISCOSITY: "both"}), concluded({VISCOSITY: "sun"}), FOUND)
    assert (found.verdict, found.by) == (Verdict.AMBIGUOUS, APART)


def row(name: str, shaft: str, error: float | None) -> dict[str, Any]:
    """A mechanism of a document."""
    parameters = [{"name": "size", "value": 0.5, "standard_error": error, "unit": "1"}]
    sizes = {"rms_effect_Nm": 0.01, "peak_effect_Nm": 0.02}
    return {
        "id": name,
        "component": "sun_bearings",
        "shaft": shaft,
        "probability": 0.5,
        "parameters": parameters,
    } | sizes


VALID = Draft202012Validator(json.loads(files("pmg.pipeline.diagnosis").joinpath("diagnosis.schema.json").read_bytes()))


def documents(*moving_sets: dict[str, str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Documents of both kinds, whose steady one leaves a gain on either shaft, or load friction of the sun."""
    example = json.loads((ROOT / "reports" / "example" / "diagnosis.json").read_bytes())
    steady = example | {"mechanisms": [row(GAIN, "either", 0.1), row(LOAD, "sun", 0.1)]}
    rows = [row(name, shaft, 0.2) for each in moving_sets for name, shaft in each.items()]
    return steady, example | {"mechanisms": rows}


def test_a_consistent_document_holds_no_place_and_no_cause() -> None:
    joint = join(concluded({GAIN: "either"}, {LOAD: "sun"}), QUIET, (0.04, 0.6))
    document = joint_document(joint, *documents())
    VALID.validate(document)
    assert document["verdict"] == "consistent"
    assert [document[name] for name in ("mechanisms", "locations", "absorbed", "held_out")] == [[], [], [], None]


def test_numbers_are_those_of_the_kind_that_says_the_shaft() -> None:
    joint = join(concluded({GAIN: "either"}, {LOAD: "sun"}), concluded({GAIN: "ring"}), FOUND)
    (mechanism,) = joint_document(joint, *documents({GAIN: "ring"}))["mechanisms"]
    assert (mechanism["shaft"], mechanism["parameters"][0]["standard_error"]) == ("ring", 0.2)


@pytest.mark.parametrize("moving_sets", [({GAIN: "sun"},), ({GAIN: "sun"}, {LOAD: "sun"}), ({IRON: "both"},)])
def test_the_document_is_one_of_its_schema(moving_sets: tuple[dict[str, str], ...]) -> None:
    steady, moving = documents(*moving_sets)
    joint = join(concluded({GAIN: "either"}, {LOAD: "sun"}), concluded(*moving_sets), FOUND)
    document = joint_document(joint, steady, moving)
    VALID.validate(document)
    assert document["statement"].startswith("Steady points and runs in motion ")
    assert document["statement"].count(steady["statement"]) == 2
    assert sum(each["probability"] for each in document["mechanisms"]) <= 1.0 + 1e-9 or joint.by == APART

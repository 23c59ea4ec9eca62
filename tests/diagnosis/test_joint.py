"""Steady points and runs in motion together: what one leaves open the other settles, and what both contradict."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from importlib.resources import files
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from tests.conftest import ROOT

from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.joint.document import joint_document
from pmg.pipeline.diagnosis.joint.join import APART, BY_BOTH, BY_MOTION, BY_STEADY, CONTRADICTED, join
from pmg.pipeline.diagnosis.joint.kinds import SteadyEvidence
from pmg.pipeline.diagnosis.joint.weighing import KindOfEvidence, WeighedSet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.sim.signals import Array

GAIN, LOAD, IRON = "torque_gain_error", "load_dependent_bearing_friction", "load_dependent_iron_loss"
INERTIA, WINDAGE, VISCOSITY = "rotor_inertia", "windage", "lubricant_viscosity"
UNEVEN = "direction_dependent_friction"
CERTAIN, SILENT = 0.002, 0.6
ROWS = 100
FORM_MARGIN = 0.02


@dataclass(frozen=True)
class Told(KindOfEvidence[Any, Any]):
    """A kind of evidence that is told what each set of causes is worth in it; of a larger set, the best part of it."""

    worth: Mapping[frozenset[tuple[str, str]], WeighedSet] = field(default_factory=dict)

    def forms(self, identifier: str, shaft: str) -> Sequence[Any]:
        """Not asked for."""
        raise NotImplementedError

    def one_size(self, fit: Any) -> tuple[str, float] | None:  # noqa: ANN401 - any fit
        """Not asked for."""
        raise NotImplementedError

    def weigh(self, causes: dict[str, str]) -> WeighedSet:
        """As told."""
        parts = [found for known, found in self.worth.items() if known <= causes.items()]
        return max(parts, key=lambda each: each.score, default=WeighedSet(0.0))


def told(
    *sets: dict[str, str],
    worth: tuple[tuple[dict[str, str], float], ...] = (),
    verdict: Verdict | None = None,
    weak: bool = False,
    by_parts: int = 0,
    p_value: float = CERTAIN,
    sizes: Mapping[str, tuple[float, float]] | None = None,
    in_part: bool = False,
) -> Told:
    """A kind that leaves some sets of causes, of even evidence where none is given."""
    known = dict.fromkeys((tuple(one.items()) for one in sets), 100.0) | {tuple(c.items()): s for c, s in worth}
    definite: dict[frozenset[tuple[str, str]], WeighedSet] = {}
    for causes, score in known.items():
        shafts = ("sun", "ring") if "either" in dict(causes).values() else ("",)
        for side in shafts:
            items = frozenset((name, side if shaft == "either" else shaft) for name, shaft in causes)
            definite[items] = WeighedSet(score, dict(sizes or {}))
    each = [
        SimpleNamespace(
            fits=[SimpleNamespace(identifier=name, place=place) for name, place in one.items()],
            score=known[tuple(one.items())],
        )
        for one in sets
    ]
    naming: Any = None
    if sets:
        rest = {"by_parts": by_parts, "weak": (), "explained": not in_part}
        naming = SimpleNamespace(best=each[0], rivals=each[1:], shafts=sets[0], **rest)
    found = Verdict.NAMED if len(sets) == 1 else Verdict.AMBIGUOUS if sets else Verdict.CONSISTENT
    conclusion: Conclusion[Any, Any] = Conclusion(verdict=verdict or found, naming=naming, weak=weak)
    problem, catalogue = SimpleNamespace(left=np.zeros(ROWS)), SimpleNamespace(form_margin=FORM_MARGIN)
    return Told(conclusion, p_value, problem, catalogue, definite)  # type: ignore[arg-type]


QUIET = told(p_value=SILENT)


def test_what_one_leaves_open_the_other_settles() -> None:
    steady = told({LOAD: "sun"}, {IRON: "both"}, {GAIN: "either"})
    found = join(steady, told({GAIN: "ring"}))
    assert (found.verdict, found.sets, found.by) == (Verdict.NAMED, ({GAIN: "ring"},), BY_BOTH)
    assert {LOAD: "sun"} in found.ruled_out
    still = join(steady, told({GAIN: "ring"}, {LOAD: "sun"}))
    assert still.verdict is Verdict.AMBIGUOUS
    assert list(still.sets) == [{LOAD: "sun"}, {GAIN: "ring"}]
    assert sum(still.weights) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("steady", "moving", "named"),
    [
        ((100.0, 93.0), (50.0, 43.0), GAIN),  # odds of e^7 are no proof; those of e^14 and an error of form are
        ((100.0, 93.0), (50.0, 49.0), None),
        ((100.0, 93.0), (30.0, 50.0), LOAD),  # the clearer of both leads
        ((100.0, 93.0), (43.0, 50.0), None),
        ((100.0, 93.0), (950.0, 940.0), None),  # an error of form is worth as much
    ],
)
def test_evidence_of_both_kinds_adds_up(
    steady: tuple[float, float], moving: tuple[float, float], named: str | None
) -> None:
    sets = ({GAIN: "sun"}, {LOAD: "sun"})
    ours, theirs = (told(*sets, worth=tuple(zip(sets, each, strict=True))) for each in (steady, moving))
    found = join(ours, theirs)
    assert found.verdict is (Verdict.AMBIGUOUS if named is None else Verdict.NAMED)
    assert len(found.sets) == 2 if named is None else found.sets == ({named: "sun"},)
    assert found.weights[0] == max(found.weights)


def test_what_parts_name_stays_unless_the_other_kind_excludes_it() -> None:
    sets = ({GAIN: "sun"}, {LOAD: "sun"})
    by_parts = told(*sets, worth=((sets[0], 50.0), (sets[1], 3.0)), by_parts=1)
    assert join(told(*sets), by_parts).verdict is Verdict.AMBIGUOUS
    assert join(QUIET, by_parts).verdict is Verdict.AMBIGUOUS
    excluding = told(sets[0], worth=((sets[1], 20.0),))
    assert join(excluding, by_parts).sets == ({GAIN: "sun"},)


def test_a_kind_that_shows_nothing_speaks_by_the_size_that_it_excludes() -> None:
    """Runs in motion that would have shown a gain of 1 % at 0.1 % rule it out, and leave what they cannot see."""
    gain = {GAIN: (0.01, 1e-6)}
    steady = told({GAIN: "sun"}, {LOAD: "sun"}, sizes=gain)
    silent = replace(QUIET, worth={frozenset({(GAIN, "sun")}): WeighedSet(-4.0, {GAIN: (0.0, 1e-6)})})
    found = join(steady, silent)
    assert (found.verdict, found.sets, found.by) == (Verdict.NAMED, ({LOAD: "sun"},), BY_STEADY)
    assert found.ruled_out == ({GAIN: "sun"},)
    alike = replace(QUIET, worth={frozenset({(GAIN, "sun")}): WeighedSet(-4.0, {GAIN: (0.009, 1e-6)})})
    assert len(join(steady, alike).sets) == 2
    alone = join(told({GAIN: "sun"}, sizes=gain), silent)
    assert (alone.verdict, alone.by, alone.something_else) == (Verdict.AMBIGUOUS, CONTRADICTED, True)


def test_one_size_for_both_kinds_is_one_parameter() -> None:
    """Of two causes as good in either kind, that leads whose size both kinds know, and find alike."""
    moving = told({GAIN: "sun"}, {IRON: "both"})
    sized = told({GAIN: "sun"}, {IRON: "both"}, sizes={GAIN: (0.01, 1e-6)})
    found = join(
        sized,
        replace(moving, worth={**moving.worth, frozenset({(GAIN, "sun")}): WeighedSet(100.0, {GAIN: (0.01, 1e-6)})}),
    )
    assert found.sets[0] == {GAIN: "sun"}
    assert found.weights[0] > found.weights[1]


def test_a_cause_that_only_one_kind_knows_stands_beside_the_shared_one() -> None:
    ours, theirs = {GAIN: "sun", WINDAGE: "sun"}, {GAIN: "sun", INERTIA: "ring"}
    found = join(told(ours, worth=(({GAIN: "sun"}, 40.0),)), told(theirs, worth=(({GAIN: "sun"}, 40.0),)))
    assert found.verdict is Verdict.NAMED
    assert found.sets == ({GAIN: "sun", WINDAGE: "sun", INERTIA: "ring"},)
    assert not found.ruled_out, "what is a part of it is not"


def test_each_kind_may_show_a_cause_that_the_other_does_not_see() -> None:
    found = join(told({WINDAGE: "sun"}), told({INERTIA: "ring"}))
    assert (found.verdict, found.sets) == (Verdict.NAMED, ({WINDAGE: "sun", INERTIA: "ring"},))


def test_what_is_too_weak_to_be_named_excludes_nothing_and_may_stand_beside_it() -> None:
    weak = told({VISCOSITY: "ring"}, verdict=Verdict.AMBIGUOUS, weak=True)
    found = join(weak, told({INERTIA: "ring"}))
    assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, False)
    assert found.sets == ({INERTIA: "ring"}, {INERTIA: "ring", VISCOSITY: "ring"})
    assert found.weights == (0.5, 0.5)
    fainter = told({VISCOSITY: "ring"}, worth=(({VISCOSITY: "ring"}, 8.0),), verdict=Verdict.AMBIGUOUS, weak=True)
    found = join(fainter, told({INERTIA: "ring"}))
    assert (found.verdict, found.sets) == (Verdict.NAMED, ({INERTIA: "ring"},))


def test_what_is_borne_out_in_part_is_strong_and_leaves_room_for_something_else() -> None:
    strong = told({VISCOSITY: "ring"}, verdict=Verdict.AMBIGUOUS, weak=True, in_part=True)
    for kinds in ((strong, told({INERTIA: "ring"})), (told({INERTIA: "ring"}), strong)):
        found = join(*kinds)
        assert found.sets == ({INERTIA: "ring", VISCOSITY: "ring"},)
        assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, True)


def test_a_kind_without_a_law_for_a_cause_does_not_exclude_it() -> None:
    moving = told({UNEVEN: "sun"})
    assert join(told({GAIN: "sun"}), moving).sets == ({GAIN: "sun", UNEVEN: "sun"},)

    class Lacking(Told):
        def lacks(self, causes: dict[str, str]) -> bool:
            return UNEVEN in causes

    ours = told({GAIN: "sun"})
    lacking = Lacking(ours.conclusion, ours.p_value, ours.problem, ours.catalogue, ours.worth)
    found = join(lacking, moving)
    assert (found.verdict, found.sets, found.by) == (Verdict.NAMED, ({UNEVEN: "sun"},), BY_MOTION)


def test_causes_that_exclude_each_other_are_both_told() -> None:
    found = join(told({GAIN: "sun"}), told({GAIN: "ring"}))
    assert (found.verdict, found.by, len(found.sets)) == (Verdict.AMBIGUOUS, APART, 2)


def test_one_kind_may_see_what_the_other_cannot() -> None:
    for pair, by in (((told({GAIN: "sun"}), QUIET), BY_STEADY), ((QUIET, told({INERTIA: "ring"})), BY_MOTION)):
        found = join(*pair)
        assert (found.verdict, found.by, found.something_else) == (Verdict.NAMED, by, False)
    unknown = told(verdict=Verdict.NOT_IN_LIBRARY)
    found = join(told({GAIN: "sun"}), unknown)
    assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, True)
    assert join(unknown, QUIET).verdict is Verdict.NOT_IN_LIBRARY


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_two_looks_are_counted_as_two(one: float, other: float) -> None:
    found = join(told({GAIN: "sun"}, p_value=one), replace(QUIET, p_value=other))
    assert found.p_value == min(1.0, 2.0 * min(one, other))
    assert (found.verdict is Verdict.CONSISTENT) == (found.p_value > 0.05)


def test_a_blind_kind_stays_blind_where_nothing_is_found() -> None:
    blind = told(verdict=Verdict.CONFOUNDED, p_value=0.5)
    assert join(blind, QUIET).verdict is Verdict.CONFOUNDED
    assert join(QUIET, QUIET).verdict is Verdict.CONSISTENT


def test_two_weak_kinds_name_nothing_for_sure() -> None:
    weak = told({GAIN: "sun"}, {LOAD: "sun"}, weak=True)
    found = join(weak, told({GAIN: "sun"}, worth=(({LOAD: "sun"}, 0.0),), verdict=Verdict.AMBIGUOUS, weak=True))
    assert (found.verdict, found.sets, found.something_else) == (Verdict.AMBIGUOUS, ({GAIN: "sun"},), True)
    assert join(weak, told({GAIN: "sun"}, worth=(({LOAD: "sun"}, 0.0),))).verdict is Verdict.NAMED


@pytest.mark.parametrize(
    ("sizes", "named"),
    [((0.010, 0.011), True), ((0.004, 0.0015), False), ((0.010, 0.0145), False)],
    ids=["alike", "not shown by one", "another one"],
)
def test_a_size_that_one_kind_predicts_of_the_other_is_a_proof(sizes: tuple[float, float], named: bool) -> None:
    each = [told({GAIN: "sun"}, verdict=Verdict.AMBIGUOUS, weak=True, sizes={GAIN: (s, 1e-6)}) for s in sizes]
    found = join(*each)
    assert (found.verdict is Verdict.NAMED, found.something_else) == (named, not named)


def test_the_size_of_both_is_known_as_well_as_it_says() -> None:
    """Weighted by what each knows; 95 % of intervals hold the truth, and a few more, as a difference widens them."""
    rng, true, errors = np.random.default_rng(20), 0.01, (0.001, 0.0005)
    inside = []
    for _ in range(2000):
        sizes = [(float(true + u * rng.standard_normal()), u**2) for u in errors]
        found = join(*(told({GAIN: "sun"}, sizes={GAIN: size}) for size in sizes))
        if found.by != CONTRADICTED:
            size, u = found.sizes[GAIN]
            inside.append(abs(size - true) < 1.96 * u)
            assert min(sizes)[0] < size < max(sizes)[0]
    assert np.mean(inside) == pytest.approx(0.96, abs=0.012)


def test_one_cause_of_two_sizes_is_told_once() -> None:
    found = join(*(told({GAIN: "sun"}, sizes={GAIN: (size, 1e-6)}) for size in (0.010, 0.016)))
    assert (found.verdict, found.sets, found.by) == (Verdict.AMBIGUOUS, ({GAIN: "sun"},), CONTRADICTED)


def test_a_kind_that_differs_without_a_cause_is_counted() -> None:
    for silent in (Verdict.CONFOUNDED, Verdict.NOT_IN_LIBRARY):
        found = join(told({GAIN: "sun"}), told(verdict=silent))
        assert (found.verdict, found.something_else) == (Verdict.AMBIGUOUS, True)
    blind_and_quiet = join(told({GAIN: "sun"}), told(verdict=Verdict.CONFOUNDED, p_value=0.4))
    assert (blind_and_quiet.verdict, blind_and_quiet.something_else) == (Verdict.NAMED, False)


def test_both_bearings_are_not_one_of_them() -> None:
    found = join(told({VISCOSITY: "both"}), told({VISCOSITY: "sun"}))
    assert (found.verdict, found.by) == (Verdict.AMBIGUOUS, APART)


@dataclass(frozen=True)
class Column:
    """A candidate of one column, and the name of its size."""

    identifier: str
    values: tuple[float, ...]
    size: str = ""


@dataclass(frozen=True)
class Amount(Fit[Column]):
    """A candidate with its amount."""

    amount: float


class Columns(WhitenedProblem[Amount]):
    """Rows that columns may explain."""

    def slopes(self, fit: Amount) -> Array:
        """The column."""
        return np.array(fit.candidate.values)[:, None]


class Library:
    """Fits a column."""

    form_margin = 0.0

    def fit(self, problem: Columns, candidate: Column) -> Amount:
        """By least squares."""
        column = problem.project(np.array(candidate.values))
        amount = float(column @ problem.left / (column @ column))
        return Amount(candidate, amount**2 * float(column @ column), 1.0, amount * column, (), amount)


@dataclass(frozen=True)
class OfColumns(KindOfEvidence[Amount, Columns]):
    """Rows with a library of columns."""

    library: tuple[Column, ...]

    def forms(self, identifier: str, shaft: str) -> list[Column]:
        """On the sun only."""
        return [each for each in self.library if each.identifier == identifier and shaft == "sun"]

    def one_size(self, fit: Amount) -> tuple[str, float] | None:
        """The amount, where it has a name."""
        return (fit.candidate.size, fit.amount) if fit.candidate.size else None


def rows(seed: int, amount: float) -> OfColumns:
    """Noise of unit size with some of the first column, beside a baseline that is even."""
    rng = np.random.default_rng(seed)
    one, other, third = rng.standard_normal((3, ROWS))
    library = (
        Column(GAIN, tuple(one), "gain"),
        Column(GAIN, tuple(third)),
        Column(INERTIA, tuple(other)),
    )
    baseline = np.full((ROWS, 1), ROWS**-0.5)
    left = amount * one + rng.standard_normal(ROWS)
    left -= baseline @ (baseline.T @ left)
    quiet: Conclusion[Any, Any] = Conclusion(verdict=Verdict.CONSISTENT)
    return OfColumns(quiet, SILENT, Columns(baseline, left), Library(), library)  # type: ignore[arg-type]


def test_a_size_is_known_to_its_standard_error() -> None:
    off = []
    for seed in range(200):
        (value, variance) = rows(seed, 0.8).weigh({GAIN: "sun"}).sizes[GAIN]
        off.append((value - 0.8) / variance**0.5)
    assert 0.85 < float(np.std(off)) < 1.15  # four standard errors of it
    assert abs(float(np.mean(off))) < 4.0 / 200**0.5


def test_what_is_not_seen_costs_nothing_unless_its_size_is_known_elsewhere() -> None:
    kind = rows(3, 0.8)
    plain = kind.weigh({GAIN: "sun"})
    assert plain.score == pytest.approx(kind.weigh({GAIN: "sun", INERTIA: "sun", WINDAGE: "sun"}).score)
    assert kind.weigh({INERTIA: "sun"}).score == 0.0
    assert plain.score > 0.3 * ROWS
    unseen = rows(3, 0.0).weigh({GAIN: "sun"})
    assert unseen.score < 0.0
    assert GAIN in unseen.sizes
    assert kind.weigh({GAIN: "ring"}) == WeighedSet(0.0)


def test_a_silent_kind_excludes_nothing_by_what_its_parameters_cost() -> None:
    sizes = {GAIN: (0.01, 1e-6), LOAD: (0.01, 1e-6)}
    unseen = {GAIN: (0.0, 1.0), LOAD: (0.0, 1.0)}
    both = {GAIN: "sun", LOAD: "sun"}
    silent = replace(QUIET, worth={frozenset(both.items()): WeighedSet(-12.0, unseen)})
    found = join(told(both, sizes=sizes), silent)
    assert (found.verdict, found.sets, found.by) == (Verdict.NAMED, (both,), BY_STEADY)


def test_a_size_that_both_know_is_no_evidence_against_a_set_that_has_none() -> None:
    """Eight apart in one kind and as much the other way in the other one: one parameter less is odds of ten to one."""
    scores, sized = (100.0, 92.0), {GAIN: (0.01, 1e-6)}
    kinds = [
        replace(kind, worth={**kind.worth, frozenset({(IRON, "both")}): WeighedSet(of_iron)})
        for of_gain, of_iron in (scores, scores[::-1])
        for kind in (told({GAIN: "sun"}, {IRON: "both"}, worth=(({GAIN: "sun"}, of_gain),), sizes=sized),)
    ]
    found = join(*kinds)
    assert found.sets == ({GAIN: "sun"}, {IRON: "both"})
    assert 0.8 < found.weights[0] < 0.95


def test_a_shaft_is_open_only_where_nothing_else_differs() -> None:
    found = join(told({VISCOSITY: "both"}, {VISCOSITY: "sun"}), QUIET)
    assert found.sets == ({VISCOSITY: "both"}, {VISCOSITY: "sun"})
    crossed = {GAIN: "sun", LOAD: "ring"}, {GAIN: "ring", LOAD: "sun"}
    assert join(told(*crossed), QUIET).sets == crossed
    assert join(told({GAIN: "sun", LOAD: "ring"}, {GAIN: "ring", LOAD: "ring"}), QUIET).sets == (
        {GAIN: "either", LOAD: "ring"},
    )


def test_of_an_open_shaft_part_and_parameters_are_those_of_the_joint_one() -> None:
    steady, moving = documents()
    names = [{"name": f"gain_{side}", "value": 0.5, "standard_error": 0.1, "unit": "1"} for side in ("sun", "ring")]
    steady["mechanisms"] = [row(GAIN, "either", 0.1) | {"parameters": names, "component": "sun_torque_transducer"}]
    kind = told({GAIN: "sun"}, {GAIN: "ring"}, worth=(({GAIN: "sun"}, 20.0),))
    (mechanism,) = joint_document(join(kind, QUIET), steady, moving)["mechanisms"]
    assert (mechanism["shaft"], mechanism["component"]) == ("ring", "ring_torque_transducer")
    assert [each["name"] for each in mechanism["parameters"]] == ["gain_ring"]


def test_steady_points_have_no_law_for_friction_that_differs_by_direction() -> None:
    none: Any = None
    points = SteadyEvidence(none, 0.5, none, none)
    assert points.lacks({UNEVEN: "sun", GAIN: "ring"})
    assert not points.lacks({GAIN: "ring"})
    assert not points.forms(UNEVEN, "sun")


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
    found = [row(name, shaft, 0.2) for each in moving_sets for name, shaft in each.items()]
    return steady, example | {"mechanisms": found}


def test_a_consistent_document_holds_no_place_and_no_cause() -> None:
    joint = join(told({GAIN: "either"}, {LOAD: "sun"}, p_value=0.04), QUIET)
    document = joint_document(joint, *documents())
    VALID.validate(document)
    assert document["verdict"] == "consistent"
    assert [document[name] for name in ("mechanisms", "locations", "absorbed", "held_out")] == [[], [], [], None]


def test_numbers_are_those_of_the_kind_that_says_the_shaft() -> None:
    joint = join(told({GAIN: "either"}, {LOAD: "sun"}), told({GAIN: "ring"}))
    document = joint_document(joint, *documents({GAIN: "ring"}))
    (mechanism,) = document["mechanisms"]
    assert (mechanism["shaft"], mechanism["parameters"][0]["standard_error"]) == ("ring", 0.2)
    assert re.search("They rule out bearing friction [^.]+ sun shaft[.]", document["statement"])


@pytest.mark.parametrize("moving_sets", [({GAIN: "sun"},), ({GAIN: "sun"}, {LOAD: "sun"}), ({IRON: "both"},)])
def test_the_document_is_one_of_its_schema(moving_sets: tuple[dict[str, str], ...]) -> None:
    steady, moving = documents(*moving_sets)
    joint = join(told({GAIN: "either"}, {LOAD: "sun"}), told(*moving_sets))
    document = joint_document(joint, steady, moving)
    VALID.validate(document)
    assert document["statement"].startswith("Steady points and runs in motion ")
    assert document["statement"].count(steady["statement"]) == 2
    told_of = {(each["id"], each["shaft"]) for each in document["mechanisms"]}
    assert told_of == {pair for causes in joint.sets for pair in causes.items()}
    assert sum(each["probability"] for each in document["mechanisms"]) <= len(joint.sets[0]) + 1e-9


def test_the_size_of_both_stands_in_the_document_where_the_mechanism_has_no_other() -> None:
    joint = join(*(told({LOAD: "sun"}, sizes={LOAD: (size, 1e-8)}) for size in (0.0040, 0.0042)))
    steady, moving = documents({LOAD: "sun"})
    size = {"name": "mu", "value": 0.004, "standard_error": 1e-4, "unit": "1"}
    for parameters, expected in (([size], 0.0041), ([size, size | {"name": "power"}], 0.004)):
        each = [d | {"mechanisms": [row(LOAD, "sun", 0.1) | {"parameters": parameters}]} for d in (steady, moving)]
        document = joint_document(joint, each[0], each[1])
        VALID.validate(document)
        assert document["mechanisms"][0]["parameters"][0]["value"] == pytest.approx(expected)

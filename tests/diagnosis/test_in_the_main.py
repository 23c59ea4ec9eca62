"""A cause in the main: it leaves a small part that is more than noise, and every part of the rows names it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.conclusion import conclude, in_the_main_sentence
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.found_set import Naming
from pmg.pipeline.diagnosis.engine.held_out import HeldOut
from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.rivals import IN_PART, NOT_PROVED, TOO_WEAK, why_weak
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue, without_held
from pmg.pipeline.diagnosis.motion.places import where_to_look

if TYPE_CHECKING:
    from pmg.sim.signals import Array

SEEN, UNSEEN = Remainder(0.0025, 12.0, 9.0), Remainder(0.4, 12.0, 9.0)
"""What is left: with structure in it, and without any that is seen."""


class _Unmoved(WhitenedProblem[Fit[Any]]):
    """A problem in which nothing is fitted."""

    def slopes(self, fit: Fit[Any]) -> Array:
        return np.zeros((len(self.left), 1))


NOTHING: Any = _Unmoved(np.zeros((10, 0)), np.zeros(10))


def named(remainder: Remainder, *, explained: bool = False, in_the_main: bool = True) -> Naming[Any, Any]:
    fit: Fit[Any] = Fit(SimpleNamespace(identifier="windage", place="sun"), 100.0, 1.0, np.zeros(10), ())
    return Naming(Explanation((fit,), NOTHING), (), {"windage": "sun"}, remainder, explained, in_the_main, (), ())


def proof(after: float, kept: float) -> HeldOut:
    """Errors on withheld rows: 3 before, noise 1; half of the square beyond it is 5 times as much."""
    return HeldOut("a part", 3.0, after, 1.0, (1.0, 2.0), None, 1.0, 1.0, 4000, 1.0, kept)


@pytest.mark.parametrize(
    ("naming", "held", "verdict"),
    [
        (named(SEEN), proof(1.05, 1.0), Verdict.NAMED),
        (named(SEEN), proof(1.05, 0.75), Verdict.NOT_IN_LIBRARY),
        (named(SEEN), proof(1.6, 1.0), Verdict.NOT_IN_LIBRARY),
        (named(UNSEEN), proof(1.6, 1.0), Verdict.NAMED),
        (named(UNSEEN), proof(1.9, 1.0), Verdict.NOT_IN_LIBRARY),
        (named(SEEN, in_the_main=False), proof(1.05, 1.0), Verdict.NOT_IN_LIBRARY),
        (named(UNSEEN, explained=True), proof(1.05, 0.75), Verdict.NAMED),
        (named(UNSEEN, explained=True), proof(1.6, 1.0), Verdict.NAMED),
        (named(UNSEEN, explained=True, in_the_main=False), proof(1.6, 1.0), Verdict.NOT_IN_LIBRARY),
    ],
)
def test_what_leaves_a_small_part_is_named_where_every_part_of_the_rows_names_it(
    naming: Naming[Any, Any],
    held: HeldOut,
    verdict: Verdict,
) -> None:
    found = conclude(NOTHING, TermCatalogue(), naming, lambda _: held)
    assert found.verdict is verdict
    if not found.verdict.names:
        return
    told = in_the_main_sentence(found.naming, found.held_out)
    assert (told == "") is (naming.explained and held.predicts)
    assert naming.explained or "12.0% of its squares are left" in told
    assert held.predicts or not naming.explained or "are not predicted" in told


@pytest.mark.parametrize(
    ("before", "after", "explained", "verdict"),
    [
        (1.01, 1.04, True, Verdict.AMBIGUOUS),
        (1.01, 1.05, True, Verdict.NOT_IN_LIBRARY),
        (1.01, 3.0, True, Verdict.NOT_IN_LIBRARY),
        (1.01, 1.04, False, Verdict.NOT_IN_LIBRARY),
        (1.03, 1.04, True, Verdict.NOT_IN_LIBRARY),
    ],
)
def test_where_withheld_rows_do_not_show_the_mismatch_what_explains_it_is_what_may_be(
    before: float, after: float, explained: bool, verdict: Verdict
) -> None:
    """Two standard errors of the mean square of 4000 rows are 4.5 %: what lies below proves and refutes nothing."""
    held = replace(proof(after, 1.0), rmse_before=before, gain_interval=(before - after - 0.01, before - after + 0.01))
    assert held.tells is (before > 1.02)
    naming = named(UNSEEN, explained=explained, in_the_main=False)
    found = conclude(NOTHING, MotionCatalogue(), naming, lambda _: held)
    assert found.verdict is verdict
    assert conclude(NOTHING, TermCatalogue(), naming, lambda _: held).verdict is Verdict.NOT_IN_LIBRARY
    assert found.weak is (verdict is Verdict.AMBIGUOUS)


@pytest.mark.parametrize(("fall", "sure"), [(1.0, False), (24.0, False), (26.0, True), (90.0, True)])
def test_a_cause_is_named_where_withheld_rows_show_a_quarter_of_what_the_fit_saw(fall: float, sure: bool) -> None:
    """The mismatch is lost in the noise of the withheld rows, the fall of their squares is not; the gain is 100."""
    held = replace(proof(1.0, 1.0), rmse_before=1.01, fall=fall)
    assert held.predicts
    assert not held.tells
    for naming in (named(UNSEEN, explained=True, in_the_main=False), named(SEEN)):
        found = conclude(NOTHING, MotionCatalogue(), naming, lambda _: held)
        assert (found.verdict, found.weak) == ((Verdict.NAMED, False) if sure else (Verdict.AMBIGUOUS, True))
    alone = conclude(NOTHING, TermCatalogue(), named(UNSEEN, explained=True), lambda _: held)
    assert alone.verdict is Verdict.NAMED, "a machine's answer has no set of what may be"


@pytest.mark.parametrize(
    ("low", "left", "explained", "verdict"),
    [
        (0.4, UNSEEN, True, Verdict.AMBIGUOUS),
        (-0.1, UNSEEN, True, Verdict.NOT_IN_LIBRARY),
        (0.4, SEEN, True, Verdict.NOT_IN_LIBRARY),
        (0.4, UNSEEN, False, Verdict.NOT_IN_LIBRARY),
    ],
)
def test_what_explains_all_and_predicts_a_part_for_sure_is_what_may_be(
    low: float, left: Remainder, explained: bool, verdict: Verdict
) -> None:
    held = replace(proof(2.2, 1.0), gain_interval=(low, 1.0))
    assert held.tells
    assert not held.predicts
    found = conclude(NOTHING, MotionCatalogue(), named(left, explained=explained, in_the_main=False), lambda _: held)
    assert (found.verdict, found.weak) == (verdict, verdict is Verdict.AMBIGUOUS)
    assert found.naming is not None
    assert found.unproved is found.weak
    assert why_weak(found) == (NOT_PROVED if found.weak else TOO_WEAK)
    assert why_weak(replace(found, naming=replace(found.naming, weak=(found.naming.best,)))) == TOO_WEAK


@pytest.mark.parametrize(
    ("fall", "after", "explained", "verdict"),
    [
        (101.0, 2.2, True, Verdict.AMBIGUOUS),
        (99.0, 2.2, True, Verdict.NOT_IN_LIBRARY),
        (101.0, 3.1, True, Verdict.NOT_IN_LIBRARY),
        (101.0, 2.2, False, Verdict.NOT_IN_LIBRARY),
    ],
)
def test_what_is_worth_as_much_on_withheld_rows_as_on_those_of_the_fit_is_what_may_be(
    fall: float, after: float, explained: bool, verdict: Verdict
) -> None:
    """Though something is left, and the interval of the gain holds none; on the rows of the fit it is worth 100."""
    held = replace(proof(after, 1.0), gain_interval=(-0.1, 1.0), fall=fall)
    found = conclude(NOTHING, MotionCatalogue(), named(SEEN, explained=explained, in_the_main=False), lambda _: held)
    assert (found.verdict, found.weak) == (verdict, verdict is Verdict.AMBIGUOUS)


def test_mechanisms_in_motion_share_what_may_be_left() -> None:
    """Two together come near much that is neither."""
    assert MotionCatalogue().left_in_the_main(1) == 0.25
    assert MotionCatalogue().left_in_the_main(2) == pytest.approx(0.5 * MotionCatalogue().left_in_the_main(1))


def a_set(gain: float, *names: str, place: str = "sun") -> Explanation[Any, Any]:
    holds = {"torque_zero_drift": ("torque_zero_offset",)}
    terms = (SimpleNamespace(identifier=name, place=place, holds=holds.get(name, ())) for name in names)
    fits: list[Fit[Any]] = [Fit(term, gain / len(names), 1.0, np.zeros(10), ()) for term in terms]
    return Explanation(tuple(fits), NOTHING)


@pytest.mark.parametrize(
    ("rival", "gain", "stays"),
    [
        (("torque_zero_drift",), 103.0, False),
        (("torque_zero_drift",), 105.0, True),
        (("channel_delay",), 100.0, True),
        (("torque_zero_drift", "channel_delay"), 103.0, True),
        ((), 0.0, True),
    ],
)
def test_a_law_that_holds_the_leading_one_and_adds_nothing_is_no_rival(
    rival: tuple[str, ...], gain: float, stays: bool
) -> None:
    other = a_set(gain, *rival)
    naming = replace(named(UNSEEN), best=a_set(100.0, "torque_zero_offset"), rivals=(other,))
    assert without_held(naming).rivals == ((other,) if stays else ())
    beside = a_set(gain, *rival, "windage")
    naming = replace(naming, best=a_set(100.0, "torque_zero_offset", "windage"), rivals=(beside,))
    assert without_held(naming).rivals == ((beside,) if stays else ())
    elsewhere = replace(naming, best=a_set(100.0, "torque_zero_offset", place="ring"), rivals=(other,))
    assert without_held(elsewhere).rivals == (other,), "another transducer holds nothing of it"


@pytest.mark.parametrize(
    ("kept", "low", "of_a_kind", "after", "left", "verdict", "weak"),
    [
        (1.0, 0.4, False, 1.05, 14.0, Verdict.NAMED, False),
        (1.0, 0.4, False, 1.05, 16.0, Verdict.AMBIGUOUS, True),
        (1.0, 0.4, True, 1.05, 12.0, Verdict.AMBIGUOUS, True),
        (1.0, 0.4, False, 2.2, 12.0, Verdict.AMBIGUOUS, True),
        (1.0, -0.1, True, 2.2, 12.0, Verdict.NOT_IN_LIBRARY, False),
        (0.75, 0.4, True, 1.05, 12.0, Verdict.NOT_IN_LIBRARY, False),
    ],
)
def test_what_leaves_a_small_part_is_what_may_be_where_only_rows_of_its_kind_bear_it_out(
    kept: float, low: float, of_a_kind: bool, after: float, left: float, verdict: Verdict, weak: bool
) -> None:
    """Or where it predicts a part for sure, as a cause of another form does, and every part of the rows names it."""
    held = replace(proof(after, kept), gain_interval=(low, 1.0), of_a_kind=of_a_kind)
    naming = named(replace(SEEN, excess=left))
    found = conclude(NOTHING, MotionCatalogue(), naming, lambda _: held)
    assert (found.verdict, found.weak) == (verdict, weak)
    assert found.in_part is weak
    if weak:
        assert why_weak(found) == IN_PART
    unseen = replace(held, rmse_before=1.01, rmse_after=1.0, fall=101.0)
    assert conclude(NOTHING, MotionCatalogue(), naming, lambda _: replace(unseen, kept=0.75)).verdict is (
        Verdict.NOT_IN_LIBRARY
    )


def test_of_a_likely_cause_the_part_on_which_it_acts_is_to_be_inspected() -> None:
    fits = [SimpleNamespace(candidate=SimpleNamespace(component=part)) for part in ("magnetic_gear", "sun_coupling")]
    naming = SimpleNamespace(rivals=(), best=SimpleNamespace(fits=fits))
    likely: Any = SimpleNamespace(in_part=True, naming=naming, mismatch=SimpleNamespace(locations=()))
    assert where_to_look(likely) == "the magnetic gear and the sun coupling"
    naming.rivals = (naming.best,)
    assert where_to_look(likely) == "the bench"

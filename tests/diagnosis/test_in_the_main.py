"""A cause in the main: it leaves a small part that is more than noise, and every part of the rows names it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.conclusion import conclude, in_the_main_sentence
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.held_out import HeldOut
from pmg.pipeline.diagnosis.engine.naming import Naming
from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue

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


def test_mechanisms_in_motion_share_what_may_be_left() -> None:
    """Two together come near much that is neither."""
    assert MotionCatalogue().left_in_the_main(1) == TermCatalogue().left_in_the_main(1)
    assert MotionCatalogue().left_in_the_main(2) == pytest.approx(0.5 * MotionCatalogue().left_in_the_main(1))

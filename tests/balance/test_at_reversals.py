"""What no term explains is said to lie at reversals where it does, and only there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pmg.pipeline.diagnosis.balance.at_reversals import REACH, _near_reversals, reversal_sentence
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.sim.signals import Array

SPEED = 10.0 * np.sin(2.0 * np.pi * np.arange(4000) / 400.0 + 0.1)


def _diagnosis(left: Array, verdict: Verdict = Verdict.NOT_IN_LIBRARY) -> Any:  # noqa: ANN401 - stands for a diagnosis
    recorded = SimpleNamespace(
        at_rows=lambda values: values,
        motion=SimpleNamespace(speed=SPEED, sample_time=0.001),
        breaks=(0,),
        keep_every=10,
    )
    fitted = SimpleNamespace(left=lambda _: left)
    return SimpleNamespace(verdict=verdict, recorded=recorded, steps=[SimpleNamespace(fitted=fitted)])


def test_samples_near_a_change_of_sense_are_near_a_reversal() -> None:
    near = _near_reversals(np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0, 1.0]), (0, 8))
    assert np.flatnonzero(near).tolist() == [2, 3, 4, 5]  # the recording that begins with the ninth turns nothing
    assert near.sum() == 2 * REACH
    beside_the_end = _near_reversals(np.array([1.0, 1.0, -1.0, -1.0, -1.0]), (0, 3))
    assert np.flatnonzero(beside_the_end).tolist() == [0, 1, 2]


@pytest.mark.parametrize(("spike", "told"), [(0.0, False), (0.1, False), (3.0, True)])
def test_what_is_left_at_reversals_is_told_with_what_else_makes_it(spike: float, *, told: bool) -> None:
    left = np.random.default_rng(3).standard_normal(len(SPEED)) + spike * _near_reversals(SPEED, (0,))
    sentence = reversal_sentence(_diagnosis(left))
    assert bool(sentence) is told
    if told:
        assert "of what is left (in squares) lies within 20 ms of a reversal, in 2.0% of the samples" in sentence


def test_of_what_is_named_nothing_of_the_kind_is_said() -> None:
    left = 3.0 * _near_reversals(SPEED, (0,)).astype(np.float64)
    assert not reversal_sentence(_diagnosis(left, Verdict.NAMED))

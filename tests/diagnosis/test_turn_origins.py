"""Runs whose counters begin their turns anew, aligned by a wave of a turn that they show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from tests.diagnosis.test_motion import _campaign, _with_torque

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.noise.turn_origins import TurnOrigins
from pmg.pipeline.motion.run import MovingRun
from pmg.sim.bench import load_bench
from pmg.sim.shafts import PerShaft

SIZE = 0.02
"""Torque of the wave [N m]."""


def _waved(seed: int, order: int, phases: tuple[float, ...], size: float = SIZE) -> tuple[MovingRun, ...]:
    """A campaign with a wave of a turn of the sun that begins in another phase in each run."""
    runs = zip(_campaign(seed), phases, strict=True)
    return tuple(_with_torque(run, size * np.cos(order * run.angle.sun - phase) * run.turns.sun) for run, phase in runs)


def _origins(runs: tuple[MovingRun, ...]) -> tuple[TurnOrigins, ...]:
    before, *_ = fit_constants(runs, load_bench())
    return before.origins


@given(st.tuples(*[st.floats(0.0, 6.28)] * 6), st.sampled_from([1, 2, 9]))
@settings(max_examples=4, deadline=None, phases=(Phase.explicit, Phase.generate))
def test_phases_of_the_runs_are_found_but_for_one_of_all(phases: tuple[float, ...], order: int) -> None:
    """Unless they begin nearly alike, so that one phase for all explains the wave."""
    runs = _waved(41, order, phases)
    found = _origins(runs)
    turning = [(run, phase) for run, phase in zip(runs, phases, strict=True) if run.turns.sun]
    together = abs(np.mean(np.exp(1j * np.array([phase for _, phase in turning]))))
    if together > 0.9:
        return
    assert found
    assert (found[0].wave.side, found[0].wave.order) == ("sun", order)
    moved = [sum(origins.angles[run.name] for origins in found) for run, _ in turning]
    off = np.exp(1j * np.array([phase - order * by for (_, phase), by in zip(turning, moved, strict=True)]))
    assert abs(np.mean(off)) > 0.98


def test_a_wave_in_another_phase_in_each_run_is_named_once_the_runs_are_aligned() -> None:
    phases = (0.0, 0.4, 2.9, 5.0, 1.7, 0.0)
    found = diagnose_motion("waves", _waved(42, 1, phases), load_bench(), np.random.default_rng(0))
    assert found.verdict is Verdict.NAMED
    assert found.naming is not None
    assert [fit.identifier for fit in found.naming.best.fits] == ["shaft_unbalance"]
    assert found.fitted_sizes[0].value == pytest.approx(SIZE, rel=0.1)
    assert {(each.wave.side, each.wave.order) for each in found.before.origins} == {("sun", 1)}
    assert "The sun encoder does not keep its turn from run to run" in motion_document(found)["statement"]


@pytest.mark.parametrize("seed", [43, 44, 45])
def test_noise_aligns_no_runs(seed: int) -> None:
    assert not _origins(_campaign(seed))


def test_counters_that_go_on_are_left_as_they_are() -> None:
    """A wave that changes its phase is then another thing than a counter that begins anew."""
    runs, end = [], 0.0
    for run in _waved(46, 1, (0.0, 0.4, 2.9, 5.0, 1.7, 0.0)):
        angle = run.angle.sun + end
        runs.append(replace(run, angle=PerShaft(angle, run.angle.ring)))
        end = float(angle[-1])
    assert not _origins(tuple(runs))

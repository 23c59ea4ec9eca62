"""Fits to a part of the readings, by one step from those of all, against fits made anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.nature import campaign_points, measure
from tests.recovery.test_planted import NATURE, analysed

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.held_out import unpredicted, withheld_left
from pmg.pipeline.diagnosis.engine.withheld import _reach, withhold
from pmg.pipeline.diagnosis.grid.candidates import candidates, grid_problem
from pmg.pipeline.diagnosis.grid.catalogue import MECHANISMS
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate, settled_fit
from pmg.pipeline.diagnosis.grid.withheld import withheld_readings
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.bench import BenchParameters


def test_fits_to_a_part_of_the_readings_are_those_made_anew(bench: BenchParameters) -> None:
    """One step comes near, a few more to the same minimum; what leads is followed up."""
    rng = np.random.default_rng(3)
    analysis = analysed(measure(NATURE, campaign_points("random", rng), rng, sun_gain=0.005)[0], bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    white = whitener(readings, bench, analysis.floor)
    rows = withheld_readings(grid_problem(readings, bench, analysis.calibration.model, white))
    train = rows.fold != 1
    part = rows.part(train)
    anew = replace(part, whole=None)
    tried = 0
    for candidate in candidates():
        if candidate.identifier not in {"torque_gain_error", "stribeck_mixed_lubrication", "magnet_temperature"}:
            continue
        full = fit_candidate(anew, candidate)
        if full.gain > ENTRY:
            near = fit_candidate(part, candidate)
            assert near.gain > full.gain - max(1.0, 0.02 * full.gain)
            assert settled_fit(part, near).gain == pytest.approx(full.gain, abs=0.1, rel=1e-3)
            tried += 1
    assert tried >= 2
    assert MECHANISMS.choose(part).identifier == MECHANISMS.choose(anew).identifier


def test_parts_without_readings_are_no_choices(bench: BenchParameters) -> None:
    """Without an order few speeds deal to fewer parts than there may be; only those that withhold something count."""
    rng = np.random.default_rng(3)
    analysis = analysed(measure(NATURE, campaign_points("random", rng), rng, sun_gain=0.02)[0], bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    white = whitener(readings, bench, analysis.floor)
    problem = grid_problem(readings, bench, analysis.calibration.model, white)
    dealt = withheld_readings(problem)
    rows = replace(dealt, fold=np.where(dealt.fold < 3, dealt.fold, dealt.folds))
    (gain,) = (c for c in candidates() if (c.identifier, c.shaft) == ("torque_gain_error", "sun"))
    held = withhold(rows, MECHANISMS, (fit_candidate(problem, gain),), rng)
    assert held is not None
    assert "in 3 parts" in held.split
    assert "in 3 of 3" in held.split
    one_block = replace(rows, block=np.zeros_like(rows.block))
    assert withhold(one_block, MECHANISMS, (fit_candidate(problem, gain),), rng) is None
    named = tuple(fit_candidate(problem, c) for c in candidates() if c.shaft == "sun")[:2]
    chosen = tuple(replace(fit, values=1.1 * fit.values) for fit in named[::-1])
    assert rows.beside_each_other(chosen, named) is named
    assert rows.beside_each_other(chosen[:1], named[1:]) == chosen[:1]
    other = (replace(chosen[0], candidate=gain), chosen[1])
    assert rows.beside_each_other(other, named) is other


def test_what_training_rows_hold_a_trace_of_predicts_nothing() -> None:
    """A column that the other folds hold as good as none of is left out there, whatever its size and the noise of rows.

    As where friction rises over a way after reversals that lie in one fold only, and exponentials leave their tails.
    """
    rng = np.random.default_rng(5)
    scale = rng.uniform(0.5, 2.0, 400)
    y = 3.0 + scale * rng.standard_normal(400)
    fold = np.arange(400) // 100
    some = np.where(fold == 2, rng.uniform(0.0, 1.0, 400), 1e-13 * rng.uniform(0.0, 1.0, 400))
    for unit in (1.0, 1e-6, 1e6):
        columns = np.column_stack([np.ones(400), unit * some])
        left = withheld_left(y, columns, scale, fold, 4)
        assert left[fold == 2] == pytest.approx(unpredicted(y, columns[:, :1], scale, fold != 2)[fold == 2], rel=1e-3)
        assert np.abs(left).max() < 10.0


def test_rows_along_what_training_rows_do_not_show_are_out_of_reach() -> None:
    """Not those that have nothing of it, and none for columns that are the same everywhere."""
    rng = np.random.default_rng(6)
    scale, level = rng.uniform(0.5, 2.0, 400), rng.uniform(0.5, 1.5, 400)
    test = np.arange(400) >= 300
    some = np.where(test & (np.arange(400) % 2 == 0), 1e-6, 0.0)
    seen = _reach(np.column_stack([level, 2.0 * level]), scale, ~test, test)
    assert seen.max() < 1.0
    reach = _reach(np.column_stack([level, some]), scale, ~test, test)
    assert np.isinf(reach[::2]).all()
    assert reach[1::2] == pytest.approx(seen[1::2])

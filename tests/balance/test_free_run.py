"""Free run of a force balance: closed forms, standstill, and a record whose parameters are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.balance.test_known_terms import MACHINE, diagnosed, dragging, records, written
from tests.slow import slow

from pmg.pipeline.chapters.explained.free_run import _further_off, free_run_sections
from pmg.pipeline.diagnosis.balance.free_run import free_run
from pmg.pipeline.diagnosis.balance.known_terms import SetTerm
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE
from pmg.pipeline.diagnosis.balance.library.term import NOISY, Motion
from pmg.pipeline.diagnosis.balance.machine.simulated import with_free_runs
from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.axis import ROTARY

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis

RATE, MASS = 1000.0, 90.0
TERMS = {term.identifier: term for term in DRIVE}


def _record(force: np.ndarray, position: np.ndarray, speed: float = 0.0) -> Recorded:
    """A record of a force and where the machine was, which starts at a speed."""
    time, nothing = np.arange(len(force)) / RATE, np.zeros(len(force))
    motion = Motion(time, position, np.r_[speed, nothing[1:]], nothing, force, nothing)
    return Recorded(("record",), motion, 10, np.ones(-(-len(force) // 10), dtype=np.bool_), force, nothing)


def _set(**amounts: float) -> list[SetTerm]:
    return [SetTerm(TERMS[name], np.array([value])) for name, value in amounts.items()]


@given(st.floats(5.0, 400.0), st.floats(-80.0, 80.0), st.floats(-0.3, 0.3))
@settings(max_examples=20, deadline=None)
def test_viscous_friction_ends_at_its_speed(viscous: float, force: float, start: float) -> None:
    time = np.arange(2000) / RATE
    settles, final = MASS / viscous, force / viscous
    speed = final + (start - final) * np.exp(-time / settles)
    position = final * time + (start - final) * settles * (1.0 - np.exp(-time / settles))
    found = free_run("m", _record(np.full(2000, force), position, start), _set(inertia=MASS, viscous=viscous))
    assert found is not None
    assert found.largest < 2e-3 * (np.abs(speed).max() + 1e-9)


def test_dry_friction_holds_what_it_can_hold_and_stops_what_coasts() -> None:
    dry = _set(inertia=MASS, coulomb=20.0)
    held = free_run("m", _record(np.full(500, 19.9), np.linspace(0.0, 1.0, 500)), dry)
    moved = free_run("m", _record(np.full(500, 20.1), np.linspace(0.0, 1.0, 500)), dry)
    assert held is not None
    assert moved is not None
    assert np.ptp(held.simulated) == 0.0
    assert np.ptp(moved.simulated) == pytest.approx(0.5 * 0.1 / MASS * 0.499**2, rel=0.01)
    coasting = free_run("m", _record(np.zeros(1000), np.linspace(0.0, 1.0, 1000), speed=0.1), dry)
    assert coasting is not None
    assert coasting.simulated[-1] == pytest.approx(0.5 * 0.1**2 * MASS / 20.0, rel=0.02)  # v0^2 M/(2 Fc)
    assert coasting.simulated[-1] == coasting.simulated[-200]


def test_a_delay_and_a_gain_act_on_the_force() -> None:
    time = np.arange(3000) / RATE
    force = 40.0 * np.sin(2.0 * np.pi * time)
    plain = _set(inertia=MASS, viscous=100.0)
    first = free_run("m", _record(force, force), plain)
    assert first is not None
    late = free_run("m", _record(force, force), plain + _set(delay=0.005))
    weaker = free_run("m", _record(force, force), plain + _set(actuator_gain=0.25))
    assert late is not None
    assert weaker is not None
    assert np.abs(late.simulated[6:] - first.simulated[1:-5]).max() < 1e-4 * np.ptp(first.simulated)
    first_way, weaker_way = first.simulated - first.simulated[0], weaker.simulated - weaker.simulated[0]
    np.testing.assert_allclose(1.25 * weaker_way, first_way, atol=1e-9)


def test_what_a_dead_zone_takes_of_a_command_drives_nothing() -> None:
    force = 40.0 * np.sin(2.0 * np.pi * np.arange(3000) / RATE)
    plain = _set(inertia=MASS, viscous=100.0)
    first = free_run("m", _record(force, force), plain)
    with_it = free_run("m", _record(force + 8.0 * np.sign(force), force), plain + _set(dead_zone=8.0))
    assert first is not None
    assert with_it is not None
    np.testing.assert_allclose(with_it.simulated, first.simulated, atol=1e-9)


def test_noise_of_what_was_measured_drives_no_simulation(rng: np.random.Generator) -> None:
    """Where a term goes without the noise of the acceleration, the simulated one has none to begin with."""
    force = 40.0 * np.sin(2.0 * np.pi * np.arange(3000) / RATE)
    (gap,) = (term for term in DRIVE if term.key == "backlash")
    terms = [*_set(inertia=MASS, viscous=100.0), SetTerm(gap, np.array([8.0, 30.0]), 2e-3)]
    plain = _record(force, np.linspace(0.0, 0.01, 3000))
    noisy = replace(plain, motion=replace(plain.motion, besides={NOISY: rng.standard_normal(3000)}))
    first, second = (free_run("m", one, terms) for one in (plain, noisy))
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.simulated, second.simulated)


def test_without_a_mass_there_is_nothing_to_solve() -> None:
    assert free_run("m", _record(np.ones(10), np.ones(10)), _set(viscous=3.0)) is None


def test_where_the_speed_alone_is_recorded_it_is_compared() -> None:
    force, viscous = 40.0, 100.0
    time = np.arange(2000) / RATE
    speed = force / viscous * (1.0 - np.exp(-time * viscous / MASS))
    recorded = _record(np.full(2000, force), np.cumsum(speed) / RATE)
    recorded.motion.speed[:] = speed
    found = free_run("m", recorded, _set(inertia=MASS, viscous=viscous), of_speed=True)
    assert found is not None
    assert found.words == ("speed", "range")
    assert found.span == pytest.approx(speed[-1])
    assert found.largest < 2e-3 * speed[-1]
    assert found.error <= found.largest


@slow
def test_a_withheld_part_of_a_recording_has_a_curve_of_its_own(tmp_path: Path) -> None:
    """Fitted and withheld part are of other lengths; what no rule let through is tried, not named."""
    folder = records(tmp_path / "a", dragging, 4, names=("one.csv",))
    machine = written(tmp_path, MACHINE.replace('withheld = ["withheld.csv"]', "withheld_part = 0.3"))
    found = with_free_runs(replace(diagnosed(machine, folder), verdict=Verdict.NOT_IN_LIBRARY))
    assert {run.record for run in found.free_runs} == {"one.csv", "one.csv, withheld part"}
    assert {run.model for run in found.free_runs} >= {"baseline", "tried"}
    (section,) = free_run_sections(found)
    assert "one.csv, withheld part" in str(section)


def test_a_named_model_that_drifts_further_is_explained() -> None:
    """It is no refutation: an offset that nobody models outweighs all else over a long record."""

    def told(*errors: tuple[str, str, float]) -> str:
        runs = tuple(SimpleNamespace(model=model, record=record, error=error) for model, record, error in errors)
        return _further_off(cast("TermsDiagnosis", SimpleNamespace(free_runs=runs, case=SimpleNamespace(axis=ROTARY))))

    better = ("baseline", "a.csv", 3.0), ("named", "a.csv", 1.0)
    assert told(*better) == ""
    worse = told(*better, ("baseline", "b.csv", 3.0), ("named", "b.csv", 5.0))
    assert worse.startswith(" In 1 of 2 records the named model drifts further")
    assert told(("named", "a.csv", 3.0), ("refined", "a.csv", 2.0)) == ""

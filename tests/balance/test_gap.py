"""A load beyond a gap: its flight from stop to stop, and what may be taken for it or it for something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.balance.reading import read_one
from tests.balance.slide import RATE, Moving, make_case
from tests.balance.test_balance import diagnosed, named, value
from tests.balance.test_forms import DRY, dry
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.borne_out import HeldBack, held_back
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE
from pmg.pipeline.diagnosis.balance.library.elastic import flights
from pmg.pipeline.diagnosis.balance.library.flight import fly
from pmg.pipeline.diagnosis.balance.library.term import DELAY, LAG, NOISY, Motion
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.reversals import reversals
from pmg.pipeline.diagnosis.balance.titles import left_out_sentence
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.trials.machines.campaign import draw_machine_campaign
from pmg.pipeline.trials.machines.files import write_campaign
from pmg.pipeline.trials.machines.trial import _machine_lots

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.estimate import FittedTerms
    from pmg.pipeline.diagnosis.balance.search_record import Searched
    from pmg.sim.signals import Array

GAP, LOAD = 1.5e-3, 25.0
"""Way between the stops [m], and mass of the load [kg]."""

STEP = 1e-3
"""Time from sample to sample [s]."""


def loaded(m: Moving) -> Array:
    """A load without friction beyond a gap: contact by a stiff spring and a damper, integrated in small steps [N]."""
    steps, stiff, loss = 40, 4e6, 3000.0
    fine = np.arange(len(m.t) * steps) / (RATE * steps)
    x, v, found = m.q[0] + 0.5 * GAP, m.v[0], np.zeros(len(fine))
    near = np.stack([np.interp(fine, m.t, m.q), np.interp(fine, m.t, m.v)], 1).tolist()
    for i, (foot, speed) in enumerate(near):
        apart = foot - x
        pressed = apart - min(max(apart, -0.5 * GAP), 0.5 * GAP)
        push = stiff * pressed + loss * (speed - v) if pressed else 0.0
        push = push if push * pressed > 0.0 else 0.0
        v += fine[1] * push / LOAD
        x += fine[1] * v
        found[i] = push
    return np.asarray(dry(m) - LOAD * m.a + found.reshape(-1, steps).mean(axis=1))


@given(
    speed=st.floats(0.05, 2.0),
    gap=st.floats(0.01, 0.2),
    rebound=st.floats(0.2, 0.9),
    sense=st.sampled_from([-1.0, 1.0]),
)
def test_behind_a_machine_that_halts_a_load_goes_to_and_fro_slower_at_every_stop(
    speed: float, gap: float, rebound: float, sense: float
) -> None:
    """It crosses the gap in the time that its speed takes, again with the part it rebounds with."""
    machine = np.r_[np.full(50, sense * speed), np.zeros(4000)]
    load = fly(machine, STEP, gap, rebound, sense)[50:]
    turns = np.flatnonzero(np.diff(np.sign(load)) != 0)
    speeds = np.abs(load[np.r_[0, turns + 1]])
    assert load[0] == pytest.approx(sense * speed)
    np.testing.assert_allclose(speeds[1:], speeds[:-1] * rebound, rtol=1e-9)
    if len(turns):
        assert turns[0] * STEP == pytest.approx(gap / speed, abs=3.0 * STEP)
    if len(turns) > 1:
        assert (turns[1] - turns[0]) * STEP == pytest.approx(gap / (rebound * speed), abs=3.0 * STEP)


@given(seed=st.integers(0, 10**6), gap=st.floats(1e-3, 0.3), rebound=st.floats(0.0, 0.9))
def test_a_load_stays_between_the_stops_and_no_faster_than_rebounds_make_it(
    seed: int, gap: float, rebound: float
) -> None:
    rng = np.random.default_rng(seed)
    machine = np.convolve(rng.standard_normal(2000), np.hanning(101) / 50.0, "same")
    load = fly(machine, STEP, gap, rebound, 0.0)
    apart = np.cumsum(load - machine) * STEP
    assert np.ptp(apart) <= gap + 4.0 * STEP * np.abs(machine).max()
    assert np.abs(load).max() <= (1.0 + rebound) / (1.0 - rebound) * np.abs(machine).max() + 1e-12


def test_a_load_that_is_driven_steadily_moves_along() -> None:
    """Where nothing brakes, nothing is missing; nor is anything by what is noise of the acceleration."""
    t: Array = np.arange(3000.0) * STEP
    noise: Array = 0.5 * np.random.default_rng(4).standard_normal(len(t))
    nothing = np.zeros_like(t)
    motion = Motion(t, 0.1 * t**2, 0.2 * t, 0.2 + noise, nothing, nothing, besides={NOISY: noise})
    assert np.abs(flights(motion, 1e-3)[1:]).max() < 1e-9


def test_a_load_that_flies_across_a_gap_is_backlash(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, loaded, terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"backlash"})
    (fit,) = found.steps[-1].fitted.fits
    assert fit.candidate.variant == "hard"
    assert fit.shape == pytest.approx(GAP, rel=0.1)
    assert float(fit.amplitudes[0]) == pytest.approx(LOAD, rel=0.1)


def test_a_flight_by_itself_need_not_foretell_all_that_withheld_rows_show() -> None:
    def of(*keys: str) -> tuple[TermFit, ...]:
        found = [next(term for term in DRIVE if term.key == key) for key in keys]
        return cast("tuple[TermFit, ...]", tuple(SimpleNamespace(identifier=t.identifier, candidate=t) for t in found))

    assert not TermCatalogue().foretells(of("backlash/flying"))
    assert TermCatalogue().foretells(of("backlash"))
    assert TermCatalogue().foretells(of("backlash/flying", DELAY))
    assert TermCatalogue().foretells(of(DELAY))


@slow
@pytest.mark.parametrize("number", [48, 102])
def test_play_of_slides_and_joints_is_told_by_the_mean_of_what_a_load_may_do(tmp_path: Path, number: int) -> None:
    """On the slide a delay leads; it is told that the library was asked without it."""
    lot = _machine_lots(160, 20261129601)[number]
    campaign = draw_machine_campaign(lot.number, lot.stratum, lot.turn, lot.seed)
    assert [part.name for part in campaign.parts] == ["play"]
    machine = write_campaign(campaign, tmp_path / "campaign")
    case = case_of(read_machine(machine), machine.parent / "records")
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(number))
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"backlash"})
    (fit,) = found.steps[-1].fitted.fits
    assert fit.candidate.variant == "flying"
    assert fit.shape == pytest.approx(2.0 * campaign.parts[0].amplitude * campaign.constants["short_way"], rel=0.05)
    assert [each.identifier for each in found.left_out] == ([DELAY] if number == 48 else [])
    assert left_out_sentence(found).startswith("Asked again without delay") is (number == 48)


def test_reversals_are_free_at_a_delay_too(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, lambda m: np.interp(m.t + 0.012, m.t, dry(m)), 3, DRY, ""))
    late = read_one(case.fit[0], case)
    assert late.motion.references[LAG] == pytest.approx(0.012, rel=0.1)
    plain = replace(late, motion=replace(late.motion, references={}))
    both, once = (reversals(each, case.axis.rises) for each in (late, plain))
    assert both.shape[1] == 2 * once.shape[1]
    np.testing.assert_array_equal(both[:, : once.shape[1]], once)


def test_a_delay_of_a_drive_with_dry_friction_has_its_size(tmp_path: Path) -> None:
    """Its friction turns in a moment, of which the low-pass keeps little."""
    found = diagnosed(tmp_path, lambda m: np.interp(m.t + 0.012, m.t, dry(m)), terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {DELAY})
    assert value(found, DELAY)[0] == pytest.approx(0.012, rel=0.05)


@pytest.mark.parametrize(
    ("others", "held"), [(1.0, None), (0.6, HeldBack.UNEVEN_DELAY), (1.5, None), (-1.0, HeldBack.UNEVEN_DELAY)]
)
def test_a_delay_that_is_longer_in_few_moments_is_not_named(others: float, held: HeldBack | None) -> None:
    """Most of what it moves is moved in one sample of fifty, as by a load that crosses a gap."""
    rng = np.random.default_rng(8)
    column = np.where(np.arange(3000) % 50 == 0, 20.0, 1.0) * rng.standard_normal(3000)
    fast = np.abs(column) > np.quantile(np.abs(column), 0.95)
    left = 0.01 * column * np.where(fast, 1.0, others) + 0.001 * rng.standard_normal(3000)
    (term,) = (t for t in DRIVE if t.identifier == DELAY)
    problem = TermProblem(np.zeros((3000, 0)), left, lambda _term, _shape: column[:, None], {})
    fit = TermFit(term, 1.0, 0.0, left, (), np.array([0.01]), float("nan"))
    mismatch = SimpleNamespace(false_alarm_rate=0.05)
    searched = cast("Searched", SimpleNamespace(named=(fit,), problem=problem, mismatch=mismatch))
    fitted = cast("FittedTerms", SimpleNamespace(fits=(), estimates=()))
    assert held_back(searched, cast("Case", None), (), fitted, worse=False) is held

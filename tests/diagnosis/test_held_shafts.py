"""What the reading of a shaft that is held tells while the other one turns."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np
from tests.diagnosis.test_motion import _campaign
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.fitting import fit_term
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.design.foresight import Foresight
from pmg.pipeline.diagnosis.motion.design.proposals import proposals
from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence, motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.noise.row_noise import PASSED_ON
from pmg.pipeline.motion.run import MovingRun
from pmg.sim.bench import load_bench
from pmg.sim.shafts import PerShaft

PART = 0.012
"""Part of the torque of the sun that the transducer of the ring shows."""


def _heard(seed: int, parts: tuple[float, ...]) -> tuple[MovingRun, ...]:
    """A campaign whose ring transducer shows a part of the sun's torque, another one in each run, and stands off."""
    rng, runs = np.random.default_rng(seed + 1000), []
    for run, part in zip(_campaign(seed), parts, strict=True):
        rest = 0.02 * rng.standard_normal() * run.manoeuvre.moves
        ring = run.torque.ring + part * run.torque.sun + rest
        runs.append(replace(run, torque=PerShaft(run.torque.sun, ring)))
    return tuple(runs)


def _evidence(runs: tuple[MovingRun, ...]) -> MotionEvidence:
    before, _, noise = fit_constants(runs, load_bench())
    return motion_evidence(before, noise, library(), np.random.default_rng(0))


def _crosstalk(found: MotionEvidence) -> tuple[float, float]:
    """Part of the sun's torque in the reading of the ring as the evidence has it, and its standard error."""
    term = cast("MotionTerm", found.problem.tables["torque_crosstalk/ring/"].term)
    fit = fit_term(found.problem, term)
    column = found.problem.columns_of(term, math.nan)[:, 0]
    return float(fit.amplitudes[0]), 1.0 / float(np.linalg.norm(column))


def test_a_held_shaft_shows_crosstalk_and_that_is_no_difference_to_search_for() -> None:
    """It is known to a thousandth without a run under load, and nothing is found in a campaign that is sound."""
    found = diagnose_motion("heard", _heard(31, (PART,) * 6), load_bench(), np.random.default_rng(0))
    assert not found.mismatch.found
    value, error = _crosstalk(found.evidence)
    assert error < 0.2 * PART
    assert abs(value - PART) < 4.0 * error
    assert len(found.evidence.stretches) == len(found.before.stretches) + 4


SEEDS = 60


@slow
def test_crosstalk_of_a_held_shaft_is_as_uncertain_as_is_said() -> None:
    """None there, or one that the frame passes on otherwise in each run: in units of the error, of unit size."""
    for size in (0.0, PASSED_ON):
        far = []
        for seed in range(SEEDS):
            parts = size * np.random.default_rng(seed).standard_normal(6)
            value, error = _crosstalk(_evidence(_heard(100 + seed, tuple(parts))))
            far.append(value / error)
        assert float(np.mean(np.square(far))) < 1.0 + 4.0 * math.sqrt(2.0 / SEEDS), size


def test_only_what_reaches_a_shaft_that_is_held_moves_its_reading() -> None:
    """Crosstalk, and what drags at both rotors: no law of the other rotor alone, and no constant."""
    found = _evidence(_heard(33, (0.0,) * 6))
    held = (found.block >= len(found.baseline.stretches)) & ~found.of_sheet
    moving = {t.term.identifier for t in found.problem.tables.values() if t.columns[held].any()}
    assert moving == {"torque_crosstalk", "residual_magnetic_coupling", "relative_bearing_drag"}
    families = np.hstack([each[held] for each in found.evidence.families])
    assert not families.any()


def test_a_run_in_neutral_is_foreseen_to_tell_crosstalk_by_the_shaft_that_is_held() -> None:
    """Its rows hold the part of the sun's torque that the ring would show, although no rotor of the ring turns."""
    found = _evidence(_heard(32, (0.0,) * 6))
    tabled = {key: cast("MotionTerm", each.term) for key, each in found.problem.tables.items()}
    slow_noise = found.noise[0].slow_noise
    shown = {
        proposal.title: Foresight(found, proposal, slow_noise).rows_of(tabled["torque_crosstalk/ring/"], math.nan)
        for proposal in proposals(found.baseline, ("sun",))
    }
    length = {title: float(np.linalg.norm(rows)) for title, rows in shown.items()}
    assert length["Dither of the sun in neutral"] > length["Slow ramp of the sun in neutral"] > 10.0

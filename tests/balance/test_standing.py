"""A machine that stands between its moves, held by any force that its friction bears."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance.slide import RATE, Moving, make_case, plain
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.library.term import Motion
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.standing import DWELL, moves
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array, Mask

TERMS = '["inertia", "viscous", "coulomb"]'
DRY, LEAST_REST = 15.0, 0.4
"""Dry friction [N], and shortest rest between two moves [s]."""


def from_place_to_place(rng: np.random.Generator, seconds: float) -> Moving:
    """Moves whose speed is a raised cosine, with rests of 0.4 to 0.8 s."""
    t = np.arange(0.0, seconds, 1.0 / RATE)
    q, v, a = np.full_like(t, 0.12), np.zeros_like(t), np.zeros_like(t)
    begin, place = 0.5, 0.12
    while begin < seconds - 2.5:
        lasts, goal = rng.uniform(0.6, 1.4), float(rng.choice([0.02, 0.07, 0.12, 0.17, 0.22])) + rng.uniform(0.0, 0.02)
        goal += 0.05 if abs(goal - place) < 0.03 else 0.0
        s, w = np.clip((t - begin) / lasts, 0.0, 1.0), 2.0 * np.pi
        on = (s > 0.0) & (s < 1.0)
        q[t > begin] = place + (goal - place) * (s - np.sin(w * s) / w)[t > begin]
        v[on] = (goal - place) / lasts * (1.0 - np.cos(w * s[on]))
        a[on] = (goal - place) / lasts**2 * w * np.sin(w * s[on])
        begin, place = begin + lasts + rng.uniform(LEAST_REST, 2.0 * LEAST_REST), goal
    return Moving(t, q, v, a)


def held(m: Moving) -> Array:
    """Inertia, viscous and dry friction; each rest is held by another force that the dry friction bears [N]."""
    rest = m.v == 0.0
    which = np.cumsum(np.diff(rest.astype(np.int8), prepend=0) == 1)
    forces = np.random.default_rng(7).uniform(-0.9 * DRY, 0.9 * DRY, which.max() + 1)
    return plain(m) + np.where(rest, forces[which], DRY * np.tanh(m.v / 2e-4))


def bell(m: Moving) -> Array:
    """The same with a friction that is larger at low speed."""
    return held(m) + 9.0 * np.tanh(m.v / 2e-4) / (1.0 + (m.v / 0.04) ** 4)


def diagnosed(folder: Path, force: object, seed: int) -> TermsDiagnosis:
    case = read_case(make_case(folder, force, seed, TERMS, seconds=60.0, moves=from_place_to_place))  # type: ignore[arg-type]
    return diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))


def test_what_holds_a_machine_at_rest_is_no_friction(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, held, 3)
    assert found.verdict is Verdict.CONSISTENT
    told = {e.term: e for e in found.steps[0].fitted.estimates}
    for term, true in (("inertia", 80.0), ("viscous", 150.0), ("coulomb", DRY)):
        assert abs(told[term].value - true) < 3.0 * told[term].standard_error
    assert any("stands for" in f.message for f in found.recorded.findings)


@slow
def test_friction_that_is_larger_at_low_speed_is_named_between_rests(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, bell, 4)
    assert found.verdict is Verdict.NAMED
    assert {step.added for step in found.steps[1:]} == {"stribeck"}
    assert not found.impossible


def _used(*parts: Array, starts: tuple[int, ...] = (0,)) -> Mask:
    speed = np.concatenate(parts)
    time, zero = np.arange(len(speed)) / RATE, np.zeros_like(speed)
    return moves(Motion(time, np.cumsum(speed) / RATE, speed, zero, zero, zero, 1e-3, starts), 5)


def test_a_reversal_and_a_creep_are_no_rest_and_a_dwell_is() -> None:
    n, dwell = round(2.0 * RATE), round(2.0 * DWELL * RATE)
    waves = 0.1 * np.sin(2.0 * np.pi * 0.5 * np.arange(n) / RATE)
    assert _used(waves).all()
    assert _used(waves + 0.2, np.full(n, 6e-4), waves + 0.2).all()
    used = _used(waves + 0.2, np.zeros(dwell), waves - 0.2)
    assert np.flatnonzero(~used).tolist() == list(range(n - 5, n + dwell + 5))
    assert _used(np.zeros(dwell)).all()
    other = _used(waves + 0.2, np.zeros(dwell), waves - 0.2, starts=(0, n + dwell))
    assert np.flatnonzero(~other).tolist() == list(range(n - 5, n + dwell))


def test_noise_is_followed_from_rest_to_rest_and_a_recording_is_one(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, held, 3, TERMS, seconds=60.0, moves=from_place_to_place))
    recorded, withheld = read_recordings(case)
    assert withheld is not None
    assert recorded.starts == (0,)
    assert len(recorded.breaks) > 20
    apart = np.diff(recorded.time) > 1.5 * np.median(np.diff(recorded.time))
    assert recorded.breaks[1:] == tuple(np.flatnonzero(apart) + 1)
    (one,) = recorded.each()
    np.testing.assert_array_equal(one.force, recorded.force)
    speed = np.abs(recorded.thin(recorded.motion.speed[:, None]))
    assert len(speed) == len(recorded.force) == len(recorded.elapsed)
    assert np.mean(speed < 1e-4) < 0.01


@pytest.mark.parametrize("part", [0.2, 0.4])
def test_the_last_part_of_a_recording_that_rests_is_withheld_as_one(tmp_path: Path, part: float) -> None:
    path = make_case(tmp_path, held, 3, TERMS, seconds=60.0, moves=from_place_to_place)
    case = read_case(path)
    recorded, withheld = read_recordings(replace(case, withheld=(), withheld_part=part))
    assert withheld is not None
    assert recorded.motion.besides["elapsed"].max() < withheld.motion.besides["elapsed"].min()
    whole = len(recorded.force) + len(withheld.force)
    assert len(withheld.force) / whole == pytest.approx(part, abs=0.05)

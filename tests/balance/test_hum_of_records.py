"""A hum in the force of a machine: chance shows none, what the machine does shows none, a planted one is told."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.balance.reading import read_one
from tests.balance.slide import make_case, plain
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.records import hum
from pmg.pipeline.diagnosis.balance.records.hum import _hum_in, hum_beside
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.pipeline.diagnosis.engine.spectral_line import swept
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tests.balance.slide import Moving

    from pmg.sim.signals import Array

ROWS, INTERVAL = 1500, 0.02
TIME = INTERVAL * np.arange(ROWS)
SPEED = np.cumsum(np.random.default_rng(0).standard_normal(ROWS))
"""A speed that changes all the time and never comes again."""


def _wave(frequency: float, phase: float) -> Array:
    return np.asarray(np.sin(2.0 * math.pi * frequency * TIME + phase))


def _noise(rng: np.random.Generator, count: int) -> Array:
    """Noise that is correlated from row to row."""
    return np.asarray(lfilter([1.0], [1.0, -0.64], rng.standard_normal((count, ROWS)), axis=1))


def _found(parts: Sequence[Array], speed: Array = SPEED, given: Array = SPEED, highest: float = 17.5) -> float | None:
    speeds, modelled = ([of[: len(part)] for part in parts] for of in (speed, given))
    place = _hum_in(parts, speeds, modelled, INTERVAL, highest)
    return None if place is None else place[0]


def test_chance_shows_a_hum_no_more_often_than_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a limit of 5 %, of 100 campaigns of one to three stretches at most 12 (99.9 % of the binomial law)."""
    monkeypatch.setattr(hum, "NO_CHANCE", 0.05)
    rng = np.random.default_rng(1)
    assert sum(_found(list(_noise(rng, 1 + k % 3))) is not None for k in range(100)) <= 12


@pytest.mark.parametrize("size", [1.0, 5.0, 30.0, 300.0])
@pytest.mark.parametrize(("frequency", "count"), [(0.9, 2), (7.31, 1), (12.0, 5)])
def test_a_hum_of_any_size_is_found_at_its_frequency_whatever_its_phase(
    frequency: float, count: int, size: float
) -> None:
    rng = np.random.default_rng(2)
    parts = [each + size * _wave(frequency, rng.uniform(0.0, 6.3)) for each in _noise(rng, count)]
    assert _found(parts) == pytest.approx(frequency, abs=0.25 / (ROWS * INTERVAL))


@pytest.mark.parametrize(("cycles", "size"), [(5.5, 10.0), (7.5, 5.0), (9.4, 2.0)])
def test_a_slow_wave_or_a_drift_shows_none(cycles: float, size: float) -> None:
    rng = np.random.default_rng(3)
    noise = _noise(rng, 1)[0]
    assert _found([noise + size * _wave(cycles / (ROWS * INTERVAL), 0.3)]) is None
    assert _found([noise + 20.0 * (TIME / TIME[-1] - 0.5)]) is None


def test_a_short_stretch_silence_and_what_lies_beyond_the_low_pass_show_none() -> None:
    rng = np.random.default_rng(4)
    assert _found([5.0 * _wave(9.0, 0.0)[:100]]) is None
    assert _found([np.zeros(ROWS)]) is None
    assert _found(list(_noise(rng, 2) + _wave(9.0, 0.7)), highest=8.0) is None


def test_a_line_of_a_kept_speed_and_one_of_what_the_machine_was_made_to_do_are_none() -> None:
    rng, wave, late = np.random.default_rng(5), 2.0 * _wave(9.0, 0.7), np.arange(ROWS) >= 0.5 * ROWS
    noise = _noise(rng, 2)
    begun = np.where(late, SPEED[ROWS // 2], SPEED)
    assert _found(list(noise + wave), begun) == pytest.approx(9.0, abs=0.01)
    assert _found(list(noise + wave * late), begun) is None
    assert _found(list(noise + wave), given=2.0 * wave) == pytest.approx(9.0, abs=0.01)
    assert _found(list(noise + wave), given=6.0 * wave) is None


def test_rows_of_a_kept_speed_are_told_from_others() -> None:
    speed = np.concatenate([np.linspace(0.0, 9.0, 500), np.full(500, 9.0)])
    moving = swept(speed, 50.0)
    assert moving[:500].all()
    assert not moving[530:].any()


def test_the_waves_of_a_hum_hold_it(tmp_path: Path) -> None:
    def shaken(m: Moving) -> Array:
        return plain(m) + 6.0 * np.sin(2.0 * math.pi * 5.3 * m.t)

    case = read_case(make_case(tmp_path, shaken, 3, seconds=30.0))
    recorded = read_one(case.fit[0], case)
    m = recorded.motion
    moved = recorded.thin(np.stack([m.position, m.speed, m.acceleration, np.ones_like(m.speed)], 1))
    (found,) = hum_beside(recorded, moved, case.prepare.low_pass_hz)
    assert found.covariates == ("a hum of 5.3 Hz",)
    beside = np.hstack([moved, found.columns])
    size = np.linalg.lstsq(beside, recorded.force, rcond=None)[0][-2:]
    assert np.hypot(*size) == pytest.approx(6.0, rel=0.1)
    assert hum_beside(recorded, beside, case.prepare.low_pass_hz) == ()


@slow
def test_a_hum_is_where_the_force_of_a_slide_differs_and_no_term_explains_it(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, lambda m: plain(m) + 6.0 * np.sin(2.0 * math.pi * 5.3 * m.t), 3, seconds=30.0))
    recorded = read_one(case.fit[0], case)
    searched = search_record(case, recorded, np.random.default_rng(1))
    (place, *_) = searched.mismatch.locations
    assert place.name == "a hum of 5.3 Hz"
    assert searched.found is not None
    assert not searched.found.may_be_named
    (family,) = (each for each in searched.looked if each.covariates[0] == place.name)
    assert family.columns.shape[1] == 2


def test_a_slide_without_one_has_no_such_place(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, plain, 3))
    looked = search_record(case, read_one(case.fit[0], case), np.random.default_rng(1)).looked
    assert not [family for family in looked if family.covariates[0].startswith("a hum")]


def test_a_cause_is_named_beside_a_hum_which_is_told_as_what_is_left(tmp_path: Path) -> None:
    def shaken(m: Moving) -> Array:
        return plain(m) + 15.0 * np.sign(m.v) + 6.0 * np.sin(2.0 * math.pi * 5.3 * m.t)

    case = read_case(make_case(tmp_path, shaken, 3, seconds=30.0))
    found = diagnose_terms(case, read_one(case.fit[0], case), None, np.random.default_rng(1))
    assert found.verdict is Verdict.NAMED
    assert [fit.identifier for fit in found.steps[-1].fitted.fits] == ["coulomb"]
    assert [place.name for place in found.left_over.locations] == ["a hum of 5.3 Hz"]

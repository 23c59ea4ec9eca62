"""A hum in the force of a machine: chance shows none, a steady speed shows none, a planted one is told."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance.reading import read_one
from tests.balance.slide import make_case, plain

from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.records import hum
from pmg.pipeline.diagnosis.balance.records.hum import CYCLES, _hum_in
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.pipeline.diagnosis.engine.spectral_line import swept

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.sim.signals import Array

ROWS, INTERVAL = 1500, 0.02


def _found(parts: Sequence[Array], moving: float = 1.0, highest: float = 24.0) -> float | None:
    """The hum of recordings of which the speed changes in the first part of the rows."""
    return _hum_in(parts, [np.arange(len(part)) < moving * len(part) for part in parts], INTERVAL, highest)


def _wave(frequency: float, phase: float) -> Array:
    return np.asarray(np.sin(2.0 * math.pi * frequency * INTERVAL * np.arange(ROWS) + phase))


def test_chance_shows_a_hum_no_more_often_than_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a limit of 5 %, of 400 campaigns of one to three recordings at most 33 (99.9 % of the binomial law)."""
    monkeypatch.setattr(hum, "CERTAIN", 0.05)
    rng = np.random.default_rng(1)
    alarms = sum(_found(list(rng.standard_normal((1 + k % 3, ROWS)))) is not None for k in range(400))
    assert alarms <= 33


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("frequency", [0.9, 7.31, 20.0])
def test_a_hum_is_found_at_its_frequency_whatever_its_phase(count: int, frequency: float) -> None:
    rng = np.random.default_rng(2)
    parts = [each + 0.4 * _wave(frequency, rng.uniform(0.0, 6.3)) for each in rng.standard_normal((count, ROWS))]
    assert _found(parts) == pytest.approx(frequency, abs=0.25 / (ROWS * INTERVAL))


def test_a_slow_wave_a_short_recording_and_silence_show_none() -> None:
    rng = np.random.default_rng(3)
    slow = 0.5 * CYCLES / (ROWS * INTERVAL)
    assert _found([rng.standard_normal(ROWS) + 5.0 * _wave(slow, 0.3)]) is None
    assert _found([5.0 * _wave(9.0, 0.0)[:100]]) is None
    assert _found([np.zeros(ROWS)]) is None


def test_a_line_that_rows_of_a_changing_speed_do_not_show_and_one_beyond_the_low_pass_are_none() -> None:
    rng, wave, late = np.random.default_rng(4), _wave(9.0, 0.7), np.arange(ROWS) >= 0.5 * ROWS
    noise = rng.standard_normal((2, ROWS))
    assert _found(list(noise + wave), 0.5) == pytest.approx(9.0, abs=0.01)
    assert _found(list(noise + wave), highest=8.0) is None
    assert _found(list(noise + wave * late)) == pytest.approx(9.0, abs=0.01)
    assert _found(list(noise + wave * late), 0.5) is None


def test_rows_of_a_kept_speed_are_told_from_others() -> None:
    speed = np.concatenate([np.linspace(0.0, 9.0, 500), np.full(500, 9.0)])
    moving = swept(speed, 50.0)
    assert moving[:500].all()
    assert not moving[530:].any()


def test_a_hum_is_where_the_force_of_a_slide_differs_and_no_term_explains_it(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, lambda m: plain(m) + 1.5 * np.sin(2.0 * math.pi * 3.3 * m.t), 3, seconds=30.0))
    searched = search_record(case, read_one(case.fit[0], case), np.random.default_rng(1))
    (place, *_) = searched.mismatch.locations
    assert place.name == "frequency of 3.3 Hz"
    assert searched.found is not None
    assert not searched.found.may_be_named


def test_a_slide_without_one_has_no_such_place(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, plain, 3))
    looked = search_record(case, read_one(case.fit[0], case), np.random.default_rng(1)).looked
    assert not [family for family in looked if family.covariates[0].startswith("frequency")]

"""A hum in runs in motion: found where most runs have it, at its frequency; chance, one run, a steady speed do not."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.signal import lfilter

from pmg.pipeline.diagnosis.motion.compressed import _run_by_run
from pmg.pipeline.diagnosis.motion.evidence import OF_SHEET
from pmg.pipeline.diagnosis.motion.noise import hum
from pmg.pipeline.diagnosis.motion.noise.hum import hums_of
from pmg.pipeline.diagnosis.motion.rows import RotorRows
from pmg.sim.signals import Array

RATE, ROWS = 100.0, 2400


@dataclass(frozen=True)
class _Stretch:
    """What is asked of a stretch, its speed given."""

    side: str
    speed: Array
    at_rest: bool = False

    def __len__(self) -> int:
        return len(self.speed)

    @property
    def run(self) -> SimpleNamespace:
        return SimpleNamespace(row_rate=RATE)

    @property
    def rows(self) -> Array:
        return np.ones(len(self.speed), dtype=np.bool_)

    @property
    def shaft(self) -> SimpleNamespace:
        return SimpleNamespace(speed=self.speed)

    def of_rows(self, fine: Array) -> Array:
        return fine


RAMP = np.linspace(0.0, 100.0, ROWS)


def _stretches(count: int, speed: Array = RAMP, side: str = "sun") -> list[RotorRows]:
    return [cast("RotorRows", _Stretch(side, speed)) for _ in range(count)]


def _waves(frequency: float, size: float, count: int, rng: np.random.Generator) -> list[Array]:
    """Waves of a frequency, each with a phase of its own."""
    time = np.arange(ROWS) / RATE
    return [size * np.cos(2.0 * np.pi * frequency * time + rng.uniform(0.0, 6.3)) for _ in range(count)]


def test_chance_shows_a_hum_no_more_often_than_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a limit of 5 %, of 300 campaigns of noise that is not even over frequency, at most 26 (99.9 % of binomial)."""
    monkeypatch.setattr(hum, "CERTAIN", 0.05)
    rng = np.random.default_rng(1)
    stretches, alarms = _stretches(12), 0
    for _ in range(300):
        white = list(lfilter([1.0], [1.0, -0.4], rng.standard_normal((12, ROWS)), axis=1))
        alarms += bool(hums_of(stretches, white))
    assert alarms <= 26


@pytest.mark.parametrize(("count", "size"), [(4, 0.3), (12, 0.15), (24, 0.12)])
def test_a_hum_that_most_stretches_have_is_found_at_its_frequency(count: int, size: float) -> None:
    rng = np.random.default_rng(2)
    for frequency in (3.2, 12.5, 23.47):
        white = [
            noise + wave
            for noise, wave in zip(rng.standard_normal((count, ROWS)), _waves(frequency, size, count, rng), strict=True)
        ]
        found = hums_of(_stretches(count, side="ring"), white)
        assert list(found) == ["ring"]
        assert found["ring"] == pytest.approx(frequency, abs=0.05)


def test_a_line_of_few_runs_and_one_at_a_steady_speed_are_no_hum() -> None:
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((10, ROWS))
    few = [n + w * (k < 3) for k, (n, w) in enumerate(zip(noise, _waves(9.0, 2.0, 10, rng), strict=True))]
    assert hums_of(_stretches(10), few) == {}
    all_of_them = [n + w for n, w in zip(noise, _waves(9.0, 2.0, 10, rng), strict=True)]
    assert hums_of(_stretches(10), all_of_them) == {"sun": pytest.approx(9.0, abs=0.05)}
    assert hums_of(_stretches(10, np.full(ROWS, 50.0)), all_of_them) == {}


def test_an_order_of_a_turn_at_the_top_of_every_ramp_is_no_hum() -> None:
    """A ramp that stays at its highest speed for a third of the time, with a wave of each turn."""
    rng = np.random.default_rng(4)
    speed = np.minimum(1.5 * RAMP, 100.0)
    angle = np.cumsum(speed) / RATE
    white = [n + 0.5 * np.cos(angle + rng.uniform(0.0, 6.3)) for n in rng.standard_normal((12, ROWS))]
    assert hums_of(_stretches(12, speed), white) == {}
    kept = [n * (speed == 100.0) for n in white]
    assert hums_of(_stretches(12), kept), "at the highest speed alone, it would pass for one"
    assert hums_of([], []) == {}


def test_each_run_has_a_phase_of_its_own() -> None:
    first, last = np.ones((2, 2)), 2.0 * np.ones((3, 2))
    one, none, other = _run_by_run([first, None, last])
    assert none is None
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one, np.hstack([first, np.zeros((2, 2))]))
    np.testing.assert_array_equal(other, np.hstack([np.zeros((3, 2)), last]))


def test_friction_through_standstill_that_is_far_from_its_form_is_looked_at() -> None:
    assert all(name.startswith("drag_sun_passing") for name in OF_SHEET["passage_sun"])

"""Channels that are updated more rarely than they are recorded, against those that stand still for another reason."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.recording.checks.renewal import tell_renewals
from pmg.pipeline.recording.findings import Findings

SEED = st.integers(0, 999)


def renewal_of(values: np.ndarray) -> float:
    """Samples from one renewal to the next by the warning; 1 where there is none."""
    findings = Findings("log.csv")
    tell_renewals("M", values, 2e-3, findings)
    told = [re.search(r"every ([\d.]+) samples", each.message) for each in findings.listed()]
    return float(told[0][1]) if told and told[0] else 1.0


def swinging(seed: int, count: int = 4000) -> np.ndarray:
    """A torque that swings, with noise (n,) [N m]."""
    rng, k = np.random.default_rng(seed), np.arange(count)
    return np.sin(k / rng.uniform(20.0, 400.0)) + 0.01 * rng.standard_normal(count)


@given(seed=SEED, period=st.floats(2.0, 40.0), phase=st.floats(0.0, 1.0))
def test_the_period_of_a_held_channel_is_found(seed: int, period: float, phase: float) -> None:
    k = np.arange(4000)
    taken = np.clip(np.floor(np.floor(k / period + phase) * period - phase * period), 0, None).astype(int)
    assert renewal_of(swinging(seed)[taken]) == pytest.approx(period, rel=0.025)


@given(seed=SEED, period=st.integers(2, 20))
def test_values_that_come_twice_leave_the_period(seed: int, period: int) -> None:
    coarse = np.round(swinging(seed) * 400.0)
    assert renewal_of(coarse[np.arange(4000) // period * period]) == pytest.approx(period, rel=0.025)


@given(seed=SEED, steps=st.floats(1.0, 200.0))
def test_a_channel_that_is_renewed_with_every_sample_is_not_held(seed: int, steps: float) -> None:
    assert renewal_of(np.round(swinging(seed) * steps) / steps) == 1.0


@given(slope=st.floats(0.01, 0.9), start=st.floats(0.0, 1.0))
def test_a_straight_command_of_whole_steps_is_not_held(slope: float, start: float) -> None:
    assert renewal_of(np.floor(start + slope * np.arange(4000))) == 1.0


@given(seed=SEED, start=st.integers(100, 3800))
def test_a_gap_does_not_hide_that_a_channel_is_held_nor_make_a_straight_line_one(seed: int, start: int) -> None:
    held = swinging(seed)[np.arange(4000) // 8 * 8]
    line = np.floor(0.3 * np.arange(4000))
    for values, period in ((held, 8.0), (line, 1.0)):
        values[start : start + 80] = np.nan
        assert renewal_of(values) == pytest.approx(period, rel=0.025)


def test_it_is_told_with_its_delay() -> None:
    k, findings = np.arange(4000), Findings("log.csv")
    held = swinging(1)[k // 5 * 5]
    for name, values in {"M_motor": held, "M_brake": swinging(2)}.items():
        tell_renewals(name, values, 2e-3, findings)
    (told,) = findings.listed()
    assert told.where == "M_motor"
    assert "every 5 samples (10 ms)" in told.message
    assert "4 ms late" in told.do

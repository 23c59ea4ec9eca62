"""Steps of an encoder where its counts a sample are nearly a whole number, and the shaft swings by a few of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.test_motion import RATE, _run
from tests.slow import slow

from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.noise.steps_anew import _errors, widened
from pmg.pipeline.motion.smooth import smooth
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench


def _amplitude_off(counts_a_sample: float) -> float:
    """What counts make of the amplitude of a swing of 1.5 counts at 7 Hz, over that of white noise as large."""
    seconds = np.arange(8000) / RATE
    probe: Any = _run(1, Manoeuvre.DITHER, np.full(8000, 20.0), np.random.default_rng(1))
    count = probe.count.sun
    swing = 1.5 * count * 2.0 * np.pi * 7.0 * np.cos(2.0 * np.pi * 7.0 * seconds)
    run = smooth(_run(1, Manoeuvre.DITHER, counts_a_sample * count * RATE + swing, np.random.default_rng(1)))
    off, _ = _errors(run, "sun", np.random.default_rng(2), np.zeros((1, 1)))
    wave = np.exp(-2j * np.pi * 7.0 * run.row_time)
    amplitudes = 2.0 * np.abs(wave @ off) / len(off)
    white = count / np.sqrt(12.0) * np.sqrt(2.0 / (RATE * 8.0)) * np.sqrt(2.0)
    return float(np.sqrt(np.mean(amplitudes**2)) / white)


def test_counts_a_sample_that_are_nearly_whole_leave_an_amplitude_off_in_every_period() -> None:
    assert _amplitude_off(16.37) < 3.0
    assert _amplitude_off(16.003) > 4.0


@given(st.lists(st.floats(0.01, 100.0), min_size=2, max_size=5), st.integers(0, 100))
def test_no_constant_is_surer_than_steps_leave_it_and_none_becomes_surer(ratios: list[float], seed: int) -> None:
    rng, k = np.random.default_rng(seed), len(ratios)
    root = rng.standard_normal((k, k))
    covariance = root @ root.T + 0.1 * np.eye(k)
    sizes = np.sqrt(np.diag(covariance))
    found = widened(covariance, (np.array(ratios) * sizes) ** 2)
    assert np.sqrt(np.diag(found)) == pytest.approx(sizes * np.maximum(ratios, 1.0))
    one, other = (each / np.sqrt(np.outer(np.diag(each), np.diag(each))) for each in (covariance, found))
    assert one == pytest.approx(other)


@slow
@pytest.mark.parametrize("number", [2, 9, 27, 55])
def test_compliances_are_not_surer_than_they_are_where_counts_a_sample_are_whole(number: int) -> None:
    """The worst of 60: they lay 4.5, -2.8, -3.7 and -2.9 standard uncertainties off before."""
    lot = draw_motion_lots(number + 1, 20261130241, ("clean",))[number]
    case = lot.draw()
    fitted, covariance, _ = fit_constants(tuple(measure_motion_case(case, lot.rng("measure"))), load_bench())
    at = fitted.sheet.at("compliance_ring")
    off = float(fitted.values[at]) - 1.0 / case.scene.bench.shafts["ring"].stiffness
    assert abs(off) < 2.5 * np.sqrt(covariance[at, at])

"""A mass that hangs on a spring is told from one that is fixed to its rotor: how often by chance, and in which words.

The rows are drawn here: columns of an inertia, of what a spring adds to it, and of constants that take up a part of
both, with white noise; of what a spring adds, smoothing leaves a part.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.catalogue import TermNaming, TermSet
from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.mass_on_spring import FIXED_FROM, on_spring
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
from pmg.pipeline.diagnosis.motion.families import swinging
from pmg.pipeline.motion.smooth import BAND, FINE_RATE
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench

ROWS, DRAWS, MASS, SMOOTHED, TORQUE_NOISE = 200, 1000, 2e-3, 0.4, 3e-3
TERMS = {term.key: term for term in library()}


def _naming(key: str, mass: float, p_value: float = 0.2) -> TermNaming:
    fit = TermFit(TERMS[key], 100.0, 1.0, np.zeros(ROWS), (), np.array([mass]), math.nan)
    best = TermSet((fit,), SimpleNamespace())  # type: ignore[arg-type]
    return TermNaming(best, (), {fit.identifier: fit.place}, Remainder(p_value, 12.0, 9.0), True, True, (), ())


def _evidence(mass: float, resonance: float, rng: np.random.Generator) -> MotionEvidence:
    """Rows of a rotor that carries a mass on a spring of a resonance [Hz]."""
    inertia, swinging, constant = rng.standard_normal((3, ROWS))
    inertia, swinging = (
        20.0 * (inertia + constant) / MASS,
        20.0 * (swinging + constant) / MASS * (2.0 * np.pi * 30.0) ** 2,
    )
    y = mass * (inertia - swinging / (2.0 * np.pi * resonance) ** 2) + 5.0 * constant + rng.standard_normal(ROWS)
    return cast(
        "MotionEvidence",
        SimpleNamespace(
            swinging={"sun": np.stack([SMOOTHED * swinging, swinging], 1)},
            problem=SimpleNamespace(slopes=lambda _: inertia[:, None]),
            columns=constant[:, None],
            of_sheet=np.zeros(ROWS, dtype=np.bool_),
            y=y,
            covariance_of=lambda weights: weights @ weights.T,
        ),
    )


@pytest.mark.parametrize(("mass", "left"), [(MASS, 0.01), (-MASS, 0.01), (MASS, 0.5)])
def test_a_soft_mass_is_not_named_but_told_to_swing_whatever_is_left(mass: float, left: float) -> None:
    told = on_spring(_naming("rotor_inertia/sun/", mass, left), _evidence(mass, 35.0, np.random.default_rng(1)))
    assert not told.may_be_named
    assert (
        told.against == "its torque grows with frequency like that of a mass on a spring, with a resonance below 76 Hz"
    )


def test_a_stiff_mass_at_the_limit_is_taken_for_a_soft_one_one_time_in_a_hundred() -> None:
    rng = np.random.default_rng(2)
    naming = _naming("rotor_inertia/sun/", MASS)
    soft = sum(not on_spring(naming, _evidence(MASS, FIXED_FROM, rng)).may_be_named for _ in range(DRAWS))
    assert 0.002 < soft / DRAWS < 0.025
    assert all(on_spring(naming, _evidence(MASS, 300.0, rng)) is naming for _ in range(100))


@pytest.mark.parametrize(("frequency", "soft"), [(50.0, True), (62.0, True), (92.0, False), (130.0, False)])
@pytest.mark.parametrize("red", [0.0, 1.0])
def test_a_resonance_is_told_from_a_mass_that_is_fixed_whatever_the_motion(
    frequency: float,
    red: float,
    soft: bool,
) -> None:
    """Accelerations whose band is full or falls, in an angle whose noise is most of their second derivative."""
    rng, count = np.random.default_rng(5), 4096
    at = np.fft.rfftfreq(count, 1.0 / FINE_RATE)
    inside = (at > 1.0) & (at < BAND)
    size = np.where(inside, np.maximum(at, 1.0) ** -red, 0.0)
    wave = size * (rng.standard_normal(len(at)) + 1j * rng.standard_normal(len(at)))
    wave *= 100.0 / np.std(np.fft.irfft(wave, count))
    noise = np.where(inside, at**2, 0.0) * (rng.standard_normal(len(at)) + 1j * rng.standard_normal(len(at)))
    seen = np.fft.irfft(wave + noise, count)
    torque = MASS * np.fft.irfft(wave / (1.0 - (at / frequency) ** 2), count)
    run = SimpleNamespace(fine_rate=FINE_RATE)
    view: Any = SimpleNamespace(state=SimpleNamespace(stretch=SimpleNamespace(run=run), acceleration=seen))
    unit = 1.0 / TORQUE_NOISE
    found = SimpleNamespace(
        swinging={"sun": unit * np.hstack([swinging(view), swinging(view, smoothed=False)])},
        problem=SimpleNamespace(slopes=lambda _: unit * seen[:, None]),
        columns=np.zeros((count, 0)),
        of_sheet=np.zeros(count, dtype=np.bool_),
        y=unit * torque + rng.standard_normal(count),
        covariance_of=lambda weights: weights @ weights.T,
    )
    told = on_spring(_naming("rotor_inertia/sun/", MASS), cast("MotionEvidence", found))
    assert told.may_be_named is not soft


def test_where_no_mass_is_named_nothing_changes() -> None:
    naming = _naming("torque_gain_error/sun/", MASS)
    assert on_spring(naming, _evidence(MASS, 35.0, np.random.default_rng(3))) is naming


@slow
@pytest.mark.parametrize(
    ("kind", "number", "verdict"), [("outside", 19, Verdict.NOT_IN_LIBRARY), ("one", 46, Verdict.NAMED)]
)
def test_campaigns_of_the_trial_tell_a_loose_mass_from_a_fixed_one(kind: str, number: int, verdict: Verdict) -> None:
    lot = draw_motion_lots(number + 1, 20261127101, (kind,))[number]
    runs = tuple(measure_motion_case(lot.draw(), lot.rng("measure")))
    found = diagnose_motion("mass", runs, load_bench(), np.random.default_rng(0))
    assert found.verdict is verdict
    assert found.naming is not None
    assert "rotor_inertia" in found.naming.best.ids
    assert ("that of a mass on a spring" in motion_document(found)["statement"]) is (verdict is not Verdict.NAMED)

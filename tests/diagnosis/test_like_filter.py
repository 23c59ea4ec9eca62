"""Nothing is named beside what is like a filter of the torque: rows drawn here, with torques that come late."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.catalogue import TermNaming, TermSet
from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.like_filter import LOUDEST, scatter_beside, unless_like_filter
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import MotionLot, draw_motion_lots
from pmg.sim.bench import load_bench

ROWS, HELD = 2000, 100
TERM = next(term for term in library() if term.key == "rotor_inertia/sun/")
COLUMNS = np.random.default_rng(1).standard_normal((ROWS, 3))
"""Of a constant, a family and the cause."""


def _found(y: np.ndarray, off: float = 0.0) -> MotionEvidence:
    """Rows of a campaign whose inertia is off the data sheet by so much that its column moves."""
    block = np.zeros(ROWS, dtype=int)
    block[-HELD:] = 1
    return cast(
        "MotionEvidence",
        SimpleNamespace(
            columns=COLUMNS[:, :1],
            granted=np.zeros((ROWS, 0)),
            evidence=SimpleNamespace(families=[COLUMNS[:, 1:2]]),
            problem=SimpleNamespace(slopes=lambda _: COLUMNS[:, 2:]),
            of_held=block == 1,
            baseline=SimpleNamespace(
                stretches=(None,), sheet=SimpleNamespace(at=lambda _: 0, expected=np.zeros(1)), values=np.array([off])
            ),
            of_sheet=np.zeros(ROWS, dtype=np.bool_),
            y=y,
        ),
    )


def _naming() -> TermNaming:
    best = TermSet((TermFit(TERM, 50.0, 1.0, np.zeros(ROWS), (), np.array([2e-3]), math.nan),), SimpleNamespace())  # type: ignore[arg-type]
    naming = TermNaming(best, (), {"rotor_inertia": "sun"}, Remainder(0.2, 0.0, 9.0), True, True, (), ())
    return replace(naming, weak=(best,))


def _noise() -> np.ndarray:
    noise = np.random.default_rng(2).standard_normal(ROWS)
    noise[-HELD:] *= 50.0  # of a shaft that is held, which is not looked at
    return noise


def _late_torque(size: float) -> np.ndarray:
    """A torque less the same torque through a resonance."""
    at = np.fft.rfftfreq(ROWS)
    torque = np.fft.rfft(np.random.default_rng(3).standard_normal(ROWS))
    resonance = np.fft.irfft(torque * ((1.0 - (at / 0.2) ** 2 + 0.1j * at / 0.2) ** -1 - 1.0), ROWS)
    return np.asarray(size * resonance / np.std(resonance))


def test_what_is_looked_for_and_what_is_named_is_no_scatter() -> None:
    best = _naming().best
    alone = scatter_beside(_found(_noise()), best)
    assert alone == pytest.approx(1.0, abs=0.03)
    assert scatter_beside(_found(_noise() + COLUMNS @ [5.0, 20.0, 80.0]), best) == pytest.approx(alone, rel=1e-6)
    assert scatter_beside(_found(_noise() + _late_torque(1.0)), best) == pytest.approx(math.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize(
    ("size", "off", "named"), [(0.0, 10.0, True), (0.5, 10.0, True), (2.0, 10.0, False), (2.0, 100.0, True)]
)
def test_nothing_is_named_beside_a_resonance_but_what_moves_far_more(size: float, off: float, named: bool) -> None:
    naming = _naming()
    told = unless_like_filter(naming, _found(_noise() + _late_torque(size), off))
    assert (told is naming) is named
    if not named:
        assert not told.may_be_named
        assert not told.weak
        assert "times the noise" in told.against
        assert math.hypot(1.0, size) > LOUDEST


@slow
@pytest.mark.parametrize(
    ("lot", "verdict"),
    [
        (draw_motion_lots(240, 20261130301)[122], Verdict.NOT_IN_LIBRARY),
        (draw_motion_lots(240, 20261130301)[59], Verdict.NAMED),
    ],
)
def test_a_mass_that_swings_at_19_hertz_is_no_soft_coupling_and_a_heavy_one_is_named(
    lot: MotionLot, verdict: Verdict
) -> None:
    runs = tuple(measure_motion_case(lot.draw(), lot.rng("measure")))
    found = diagnose_motion("mass", runs, load_bench(), np.random.default_rng(3))
    assert found.verdict is verdict

"""The search over the courses of mechanisms in motion: it sees small effects, and false alarms keep their rate."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.diagnosis.test_motion import _campaign

from pmg.pipeline.diagnosis.balance.fitting import Tabled
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, search
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.compressed import Family
from pmg.pipeline.diagnosis.motion.evidence import motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.mismatch import find_mismatch
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch
    from pmg.pipeline.diagnosis.motion.mismatch import MotionPlace
    from pmg.sim.signals import Array

ROWS, HELD, DRAWS = 300, 20, 400
RNG = np.random.default_rng(5)
BASELINE = np.linalg.qr(RNG.standard_normal((ROWS, 6)))[0]
CURVES = [RNG.standard_normal((ROWS, 7)) for _ in range(8)]
COURSES = RNG.standard_normal((ROWS, 3, 1))
"""Of a mechanism at three values of its shape."""
NULL = RNG.standard_normal((ROWS, DRAWS))
OF_HELD = np.arange(ROWS) >= ROWS - HELD


def looked(y: Array, bounds: tuple[float, float] = (0.0, 1.0), **of_term: Any) -> Mismatch[MotionPlace]:  # noqa: ANN401
    """The mismatch of some rows; those of held shafts are the last."""
    amplitude = SimpleNamespace(bounds=bounds)
    term: Any = SimpleNamespace(**({"constants": (), "comes_late": False, "amplitudes": (amplitude,)} | of_term))
    families = [Family("sun", "engaged", f"curve {k}") for k in range(len(CURVES))]
    found: Any = SimpleNamespace(
        evidence=Evidence(y, BASELINE, CURVES, (np.ones(ROWS, dtype=np.bool_),), NULL),
        problem=SimpleNamespace(tables={"one": Tabled(term, np.arange(3.0), COURSES)}),
        of_held=OF_HELD,
        of_sheet=np.zeros(ROWS, dtype=np.bool_),
        baseline=SimpleNamespace(stretches=(None,)),
        families=tuple(families),
        torque_of=lambda _, effect: float(np.linalg.norm(effect)),
    )
    return find_mismatch(found)


def planted(size: float, seed: int = 1) -> Array:
    """Noise, and an effect whose course is between two that are looked for, of that size in units of the noise."""
    course = COURSES[:, 0, 0] + 0.3 * COURSES[:, 1, 0]
    course = np.where(OF_HELD, 0.0, course)
    return np.asarray(np.random.default_rng(seed).standard_normal(ROWS) + size * course / np.linalg.norm(course))


def test_a_small_effect_is_seen_by_its_course_and_placed_where_a_curve_carries_it() -> None:
    found = looked(planted(8.0))
    assert found.found
    (place,) = found.locations
    assert place.p_value == found.p_value == pytest.approx(10.0 / (DRAWS + 1))
    assert found.tested == len(CURVES) + 3
    (step,) = search(Evidence(planted(8.0), BASELINE, CURVES, (np.ones(ROWS, dtype=np.bool_),), NULL), steps=1)
    assert step.p_value > FALSE_ALARM_RATE, "no curve shows it"


def test_a_size_that_cannot_be_negative_is_not_looked_for_below_zero() -> None:
    assert not looked(planted(-8.0)).found
    assert looked(planted(-8.0), (-1.0, 1.0)).found
    assert looked(planted(8.0), (-1.0, 1.0)).found


@pytest.mark.parametrize("of_term", [{"constants": ("inertia_sun",)}, {"comes_late": True}])
def test_what_the_constants_take_up_has_no_course(of_term: dict[str, Any]) -> None:
    assert not looked(planted(8.0), **of_term).found


def test_readings_of_held_shafts_are_not_searched() -> None:
    assert not looked(np.where(OF_HELD, 30.0 * COURSES[:, 0, 0], planted(0.0))).found


def test_false_alarms_keep_their_rate_over_both_searches() -> None:
    """400 campaigns of noise: a share of 5 % has a standard error of 1.1 %, and the limit of the null draws as much."""
    p = np.array([looked(planted(0.0, seed)).p_value for seed in range(100, 500)])
    assert float(np.mean(p <= FALSE_ALARM_RATE)) < FALSE_ALARM_RATE + 0.05
    assert float(np.mean(p <= 0.5)) > 0.3


def test_a_rise_over_a_milliradian_after_a_reversal_is_friction_of_any_bearing() -> None:
    """It is no finding, and a rise over an angle that the library names stays visible."""
    before, _, noise = fit_constants(_campaign(31), load_bench())
    problem = motion_evidence(before, noise, library(), np.random.default_rng(0)).problem
    for variant in ("", "one stop"):
        term = problem.tables[f"presliding_friction/sun/{variant}"].term
        for angle, least, most in ((7e-4, 0.0, 0.3), (1.3e-3, 0.0, 0.3), (0.05, 0.6, 1.0)):
            columns = problem.columns_of(term, angle)
            left = float(np.linalg.norm(problem.project(columns)) / np.linalg.norm(columns))
            assert least <= left <= most, (variant, angle)

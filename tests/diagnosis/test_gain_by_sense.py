"""A transducer whose sensitivity differs between clockwise and anticlockwise torque, as calibrations give both."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.slow import slow

from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench

TERMS = {term.key: term for term in library()}
ERROR = st.floats(-0.1, 0.1)


@pytest.mark.parametrize(("identifier", "of"), [("torque_gain_error", "shaft"), ("torque_crosstalk", "other")])
@given(clockwise=ERROR, anticlockwise=ERROR, torque=st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=9))
def test_its_sizes_are_the_mean_error_and_the_difference_of_the_senses(
    identifier: str, of: str, clockwise: float, anticlockwise: float, torque: list[float]
) -> None:
    values = np.array(torque)
    view: Any = SimpleNamespace(**{of: SimpleNamespace(torque=values)})
    sizes = 0.5 * (clockwise + anticlockwise), clockwise - anticlockwise
    shown = TERMS[f"{identifier}/sun/by sense"].columns(view, 0.0) @ sizes
    expected = np.where(values > 0.0, clockwise, anticlockwise) * values
    np.testing.assert_allclose(shown, expected, rtol=0.0, atol=1e-14)


@slow
def test_it_is_named_beside_a_softer_coupling_with_its_difference() -> None:
    """A trial campaign in which a gain of either sense alone, or a curved one, leaves more than noise."""
    lot = draw_motion_lots(140, 20261130620)[95]
    case = lot.draw()
    gain = next(effect for effect in case.truth["effects"] if effect["id"] == "torque_gain_error")
    assert gain["knobs"]["law"] == "sense"
    found = diagnose_motion(
        case.campaign, tuple(measure_motion_case(case, lot.rng("measure"))), load_bench(), np.random.default_rng(0)
    )
    assert found.verdict.names
    assert found.naming is not None
    keys = [cast("MotionTerm", fit.candidate).key for fit in found.naming.best.fits]
    assert set(keys) == {"torque_gain_error/ring/by sense", "coupling_compliance/sun/"}
    place = keys.index("torque_gain_error/ring/by sense")
    true = gain["knobs"]["sign"] * gain["size"] * np.array([1.0, 2.0 * gain["knobs"]["difference"]])
    assert np.all(np.abs(found.sizes[place] - true) < 3.0 * found.size_errors[place])

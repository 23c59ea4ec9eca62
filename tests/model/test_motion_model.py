"""Models of runs in motion: kept and read bit for bit, faults told with their key, causes predicted on other runs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.diagnosis.test_late_torque import lagged_runs
from tests.diagnosis.test_motion import _campaign, _run, _with_torque

from pmg.pipeline.commands.config import check_choices
from pmg.pipeline.commands.doctor import run_doctor
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.model.apply_motion_model import apply_motion_model
from pmg.pipeline.model.motion_model import (
    NO_MODEL,
    OWN,
    TERMS,
    MotionCause,
    MotionModel,
    leave_motion_model,
    motion_model_of,
)
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.model.read_motion_model import read_any_model, read_motion_model
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.settings.chosen import choose
from pmg.sim.bench import load_bench
from pmg.sim.errors import BenchError, FitError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.motion.run import MovingRun

LAG, SHORT = 0.02, 0.004
CARRIED = tuple(name for name in sheet_of(load_bench(), 1, ()).names if not name.startswith(OWN))


@st.composite
def models(draw: st.DrawFn) -> MotionModel:
    """Any model: some constants, some causes inside their bounds."""
    number = st.floats(-1e3, 1e3)
    constants = {
        name: (draw(number), draw(st.floats(1e-12, 1e3)))
        for name in draw(st.lists(st.sampled_from(CARRIED), min_size=1, unique=True))
    }
    causes = []
    for key in draw(st.lists(st.sampled_from(sorted(TERMS)), max_size=2)):
        term = TERMS[key]
        amplitudes = tuple(draw(st.floats(*q.bounds)) for q in term.amplitudes)
        shape = () if term.shape is None else (draw(st.floats(*term.shape.bounds)),)
        causes.append(MotionCause(term, amplitudes, *shape))
    return MotionModel(draw(st.text('aé"\\ -', min_size=1)), draw(st.sampled_from((1, 2))), constants, tuple(causes))


@given(models())
@settings(max_examples=40)
def test_a_model_reads_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, model: MotionModel) -> None:
    (path,) = leave_motion_model(model, tmp_path_factory.mktemp("model"), None)
    first, again = path.read_bytes(), read_motion_model(path, load_bench())
    assert leave_motion_model(again, path.parent, None) == (path,)
    assert path.read_bytes() == first
    assert again.constants == model.constants
    assert [c.amplitudes for c in again.causes] == [c.amplitudes for c in model.causes]
    assert leave_motion_model(model, path.parent, path) == ()


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ('"pmg.motion-model/1"', '"pmg.model/1"', "schema"),
        ('"inertia_sun"', '"inertia_moon"', "inertia_moon"),
        ("gear = 1", "gear = 3", "gear"),
        ("transducer_bandwidth/sun/", "transducer_bandwidth/moon/", "key"),
        ("amplitudes = [0.02]", "amplitudes = [0.02, 0.03]", "amplitudes"),
        ("amplitudes = [0.02]", "amplitudes = [-1.0]", "amplitudes"),
        ("amplitudes = [0.02]", "amplitudes = [0.02]\nshape = 1.0", "shape"),
        ("transducer_bandwidth/sun/", "pull_out_torque/both/", "key"),
        ("transducer_bandwidth/sun/", "torque_zero_drift/sun/", "key"),
        ('"pmg.motion-model/1"', '"pmg.model/1"', "steady points"),
    ],
)
def test_a_fault_in_a_model_is_told_with_its_key(tmp_path: Path, old: str, new: str, where: str) -> None:
    lag = MotionCause(TERMS["transducer_bandwidth/sun/"], (0.02,))
    (path,) = leave_motion_model(MotionModel("a", 1, {"inertia_sun": (1e-3, 1e-6)}, (lag,)), tmp_path, None)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(BenchError) as told:
        read_motion_model(path, load_bench())
    assert "model.toml" in str(told.value)
    assert where in str(told.value)


def test_a_model_predicts_runs_that_it_has_not_seen() -> None:
    """A lag is taken out of other runs of the same bench, which are consistent then, and the model is handed on."""
    bench = load_bench()
    first = diagnose_motion("first", _campaign(41, LAG), bench, np.random.default_rng(0))
    assert first.verdict is Verdict.NAMED
    model = motion_model_of(first, _campaign(41, LAG))
    assert [cause.term.identifier for cause in model.causes] == ["transducer_bandwidth"]
    assert model.causes[0].shape == pytest.approx(LAG, rel=0.03)
    assert not any(name.startswith(OWN) for name in model.constants)
    cleared, acting, told = apply_motion_model(model, _campaign(43, LAG), bench)
    assert told is not None
    assert told.unseen
    assert "predicts these runs with" in told.sentence
    assert told.left_out == ()
    assert acting.causes == model.causes
    assert told.predicted < 0.6 * told.without
    assert told.predicted < 1.05 * told.fitted
    second = diagnose_motion("second", cleared, bench, np.random.default_rng(0), known=model.constants)
    assert second.verdict is Verdict.CONSISTENT
    assert motion_model_of(second, cleared, model).causes == model.causes
    with pytest.raises(FitError, match="gear 2"):
        apply_motion_model(replace(model, gear=2), _campaign(42), bench)
    gain = MotionCause(TERMS["torque_gain_error/sun/"], (0.3,))
    _, acting, told = apply_motion_model(replace(model, causes=(gain, *model.causes)), _campaign(43, LAG), bench)
    assert told is not None
    assert acting.causes == model.causes, "of two causes the one that was mended is left out"
    assert told.left_out == (gain.term.title,)
    sound = _campaign(44)
    kept, acting, absent = apply_motion_model(model, sound, bench)
    assert absent is not None
    assert kept == sound, "a cause that does not act in them is not put into them"
    assert acting.causes == ()
    assert absent.left_out == (model.causes[0].term.title,)
    assert "judged without" in absent.sentence


def test_a_model_of_either_kind_is_read_where_any_is_asked_for(tmp_path: Path) -> None:
    model = MotionModel("a", 1, {"inertia_sun": (1e-3, 1e-6)})
    (path,) = leave_motion_model(model, tmp_path, None)
    check_choices(choose(None, model=path))
    assert run_doctor(path, None, None, None, None).lines[0].endswith("no mechanism beyond the baseline")
    assert read_any_model(path, load_bench()) == read_motion_model(path, load_bench())
    with pytest.raises(BenchError, match="use it on a campaign of such runs alone"):
        read_model(path)


def test_a_lag_is_taken_out_of_a_reading_that_comes_late_besides() -> None:
    """The reading is then what a transducer without the lag shows, half a sample after its angles as before."""
    bench, over = load_bench(), np.ones(40) / 40.0
    lag = MotionCause(TERMS["transducer_bandwidth/sun/first order"], (1.0,), LAG)
    meant, shown = _campaign(100), lagged_runs(LAG, 100)
    cleared, _, _ = apply_motion_model(MotionModel("a", 1, {}, (lag,)), shown, bench)
    known = [np.flatnonzero(np.isfinite(run.torque.sun)) for run in cleared]
    assert all(len(k) > 0.98 * len(run.torque.sun) for k, run in zip(known, shown, strict=True))

    def off(runs: tuple[MovingRun, ...]) -> float:
        apart = [a.torque.sun[k] - b.torque.sun[k] for a, b, k in zip(runs, meant, known, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate([np.convolve(each, over, "valid") for each in apart]) ** 2)))

    noise = math.sqrt(2.0 / 40.0) * 0.012
    assert off(shown) > 20.0 * noise
    assert off(cleared) < 1.2 * noise


def test_a_model_holds_what_its_runs_show_and_no_more() -> None:
    """Runs of the sun alone say nothing of the ring's drag, of the gear, or of what is of this campaign only."""
    runs = _campaign(22)
    drifted = tuple(_with_torque(run, np.full(len(run.torque.sun), 0.03 * (k > 2))) for k, run in enumerate(runs))
    found = diagnose_motion("drifted", drifted, load_bench(), np.random.default_rng(0))
    assert found.naming is not None
    model = motion_model_of(found, drifted)
    assert {"inertia_sun", "drag_sun_0"} <= set(model.constants)
    assert not [name for name in model.constants if "ring" in name or name in ("slip_damping", "pull_out")]
    assert not model.causes
    assert model.provenance["not_carried"] == "torque_zero_drift"
    _, _, told = apply_motion_model(model, drifted, load_bench())
    assert told is not None
    assert not told.unseen
    assert "no prediction" in told.sentence


def test_a_part_that_the_last_fit_put_below_nothing_is_none(tmp_path: Path) -> None:
    """Sizes are fitted once more without bounds, beside the constants; the model holds those inside them."""
    first = diagnose_motion("first", _campaign(41, SHORT), load_bench(), np.random.default_rng(0))
    model = motion_model_of(replace(first, sizes=(np.array([-1e-7]),)), ())
    (path,) = leave_motion_model(model, tmp_path, None)
    assert read_motion_model(path, load_bench()).causes[0].amplitudes == (0.0,)


def test_runs_that_only_creep_are_refused() -> None:
    rng = np.random.default_rng(1)
    creeps = tuple(_run(k, Manoeuvre.RAMP, np.full(6000, 0.15), rng) for k in range(3))
    with pytest.raises(FitError, match="no shaft that turns"):
        diagnose_motion("creeps", creeps, load_bench(), rng)


def test_without_a_model_runs_stay_what_they_are() -> None:
    runs = _campaign(43)
    assert apply_motion_model(NO_MODEL, runs, load_bench()) == (runs, NO_MODEL, None)

"""A torque or an angle that counts backwards is told, with what to change."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.conftest import ROOT

from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.senses import check_senses
from pmg.pipeline.motion.smooth import derivative, smooth
from pmg.pipeline.motion.stored import moving_runs
from pmg.pipeline.store.store import Store
from pmg.sim.bench import load_bench
from pmg.sim.errors import FitError
from pmg.sim.shafts import SIDES, PerShaft, on_side
from pmg.sim.signals import Array

Runs = tuple[MovingRun, ...]
NOMINAL = PerShaft(5.0, 10.0)
"""Torque of the transducers [N m]."""
USED = {"0000": "a zero check", "0002": "the ring in neutral", "0003": "load steps", "0004": "the sun in neutral"}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    """Some of the runs that ship."""
    folder: Path = tmp_path_factory.mktemp("senses") / "in"
    folder.mkdir()
    for name in USED:
        shutil.copy(ROOT / "raw" / "moving" / f"{name}.mcap", folder)
    run_ingest(folder, store := folder.with_name("store"), ALONE)
    (campaign,) = {manifest.campaign for manifest in Store(store).manifests()}
    return tuple(moving_runs(Store(store), campaign))


def _turned(runs: Runs, torque: PerShaft[float], angle: PerShaft[float]) -> Runs:
    """Runs whose signals count the other way where the factor is -1."""

    def times(values: PerShaft[float], signals: PerShaft[Array]) -> PerShaft[Array]:
        return PerShaft(*(value * signal for value, signal in zip(values, signals, strict=True)))

    return tuple(replace(run, torque=times(torque, run.torque), angle=times(angle, run.angle)) for run in runs)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("signal", ["torque", "angle"])
def test_a_signal_that_counts_backwards_is_told_by_its_shaft_and_kind(runs: Runs, side: str, signal: str) -> None:
    straight, backwards = PerShaft(1.0, 1.0), on_side(side, -1.0, 1.0)
    torque, angle = (backwards, straight) if signal == "torque" else (straight, backwards)
    with pytest.raises(
        FitError, match=rf"torque of the {side}: .*Turn the sign of the {signal} \([^)]*\) of that shaft"
    ):
        fit_constants(_turned(runs, torque, angle), load_bench())


def test_two_torques_that_count_backwards_are_told_together(runs: Runs) -> None:
    with pytest.raises(FitError, match=r"torque of the sun and of the ring: .*sign of the torque .*, or the angle"):
        fit_constants(_turned(runs, PerShaft(-1.0, -1.0), PerShaft(1.0, 1.0)), load_bench())


def test_without_runs_in_neutral_one_of_the_torques_is_told(runs: Runs) -> None:
    engaged = tuple(run for run in runs if run.coupled)
    with pytest.raises(FitError, match="torques of the sun and of the ring: engaged, one falls where the other rises"):
        fit_constants(_turned(engaged, PerShaft(1.0, -1.0), PerShaft(1.0, 1.0)), load_bench())


@pytest.mark.parametrize("zero", [0.5, -0.5])
def test_a_zero_error_is_no_sense_of_rotation(runs: Runs, zero: float) -> None:
    """One shaft that turns one way in neutral: its drag is as constant as a zero."""
    (up,) = (run for run in runs if "N_sun_up" in run.name)
    shifted = replace(up, torque=PerShaft(up.torque.sun + zero, up.torque.ring))
    check_senses([smooth(shifted)], NOMINAL)
    backwards = replace(shifted, torque=PerShaft(zero - up.torque.sun, up.torque.ring))
    with pytest.raises(FitError, match="torque of the sun"):
        check_senses([smooth(backwards)], NOMINAL)


def test_engaged_without_load_nothing_is_said(runs: Runs) -> None:
    """Inertia and drag of rotors that turn against each other move their torques against each other."""
    (steps,) = (run for run in runs if run.coupled)
    time, noise = np.arange(len(steps.torque.sun)) / steps.rate, np.random.default_rng(3)
    speed = PerShaft(*(size * np.sin(0.4 * time) for size in (50.0, -50.0 / 2.6)))
    angle = speed.map(lambda w: np.cumsum(w) / steps.rate)
    asked = speed.map(lambda w: 0.02 * derivative(w, steps.rate) + 0.2 * np.tanh(w / 5.0) + 1e-2 * w)
    idle = replace(steps, angle=angle, torque=asked.map(lambda t: t + 0.02 * noise.standard_normal(len(t))))
    assert np.corrcoef(idle.torque.sun, idle.torque.ring)[0, 1] < -0.9
    check_senses([smooth(idle)], NOMINAL)

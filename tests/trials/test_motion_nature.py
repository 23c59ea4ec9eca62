"""The proving bench in motion: its integration, its effects, its readings, and that the recordings hold the same."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.motion.stored import moving_runs
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.store.store import Store
from pmg.pipeline.trials.motion import nature
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import POLE_PAIRS, draw_bench
from pmg.pipeline.trials.motion.effect import MotionEffect
from pmg.pipeline.trials.motion.kernel import integrate
from pmg.pipeline.trials.motion.machine import SUBSTEPS, SyntheticMachine
from pmg.pipeline.trials.motion.nature import (
    MotionCase,
    _draw_effect,
    draw_motion_case,
    measure_motion_case,
    with_further_runs,
    write_motion_case,
)
from pmg.pipeline.trials.motion.programme import DESIGNS, RATE, MotionCampaign, PlannedRun, draw_campaign, run_as_asked
from pmg.pipeline.trials.motion.sensors import COUNT
from pmg.pipeline.trials.motion.size import POINT, EffectSize, MotionYardstick, Scene, SizedEffect, scale_to
from pmg.pipeline.trials.motion.strata import FORMS, motion_strata
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.grid import Configuration
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import Array

PLACED = [
    (form.identifier, shaft, law) for form in FORMS.values() for shaft in form.components for law in form.laws.every
]
BEGUN = PerShaft(1.0, 2.0)


def short_runs() -> tuple[PlannedRun, ...]:
    """The gear started, loaded in a step and swung by its load; each shaft alone through standstill and to a stop."""
    t = np.arange(2000) / RATE
    speed, load = 150.0 * np.minimum(t, 1.0), 1.5 * (t > 1.3) + 0.3 * np.sin(50.0 * t)
    asked = {"sun": (at.SPEED, speed), "ring": (at.TORQUE, load)}
    engaged = PlannedRun("E", Configuration.ENGAGED, Manoeuvre.STEPS, asked, phases=((0, "STEPS"),))
    swing = {"sun": (at.SPEED, 25.0 * np.sin(9.0 * t)), "ring": (at.SPEED, 40.0 * np.sin(8.0 * t))}
    neutral = PlannedRun("N", Configuration.NEUTRAL, Manoeuvre.COAST, swing, phases=((0, "COAST"),), free_from=1700)
    return engaged, neutral


@pytest.fixture(scope="module")
def scene() -> Scene:
    runs = short_runs()
    return Scene(draw_bench(np.random.default_rng(1)), MotionCampaign("short", runs), (BEGUN,) * len(runs))


@pytest.fixture(scope="module")
def yardstick(scene: Scene) -> MotionYardstick:
    return MotionYardstick(scene)


def test_half_the_step_gives_the_same_torque(scene: Scene) -> None:
    machine = scene.machine()
    for run in scene.campaign.runs:
        coarse, usual, fine = (machine.states(run, BEGUN, SUBSTEPS * k)[:, :, at.COUPLING] for k in (1, 2, 4))
        assert np.abs(usual - coarse).max() < 1.5e-3  # a tenth of the noise, where a reference jumps
        assert np.abs(fine - usual).max() < 0.2 * np.abs(usual - coarse).max()


def lossless(machine: SyntheticMachine) -> None:
    for place in (at.DAMPING, at.MOTOR_DRY, at.MOTOR_VISCOUS, at.EDDY):
        machine.shafts[:, place] = 0.0
    machine.gear[at.SLIP_DAMPING] = 0.0
    machine.tables[:] = 0.0


def energy(machine: SyntheticMachine, found: Array) -> Array:
    """Energy of both shafts and of the gear's spring [J]."""
    total = np.zeros(len(found))
    for row in range(2):
        shaft, out = machine.shafts[row], found[:, row]
        total += 0.5 * shaft[at.MOTOR_INERTIA] * out[:, at.TURNING] ** 2
        total += 0.5 * shaft[at.ROTOR_INERTIA] * out[:, at.ROTOR_TURNING] ** 2
        total += 0.5 * shaft[at.STIFFNESS] * (out[:, at.ANGLE] - out[:, at.ROTOR]) ** 2
    angle = sum(POLE_PAIRS[side] * found[:, row, at.ROTOR] for row, side in enumerate(("sun", "ring")))
    return np.asarray(total - machine.gear[at.PULL_OUT] * np.cos(angle))


def test_without_loss_and_drive_the_energy_stays(scene: Scene) -> None:
    machine = scene.machine()
    lossless(machine)
    given = np.zeros((3000, 2, at.INPUTS))
    given[:, :, at.MODE], given[:, :, at.DRAG_SCALE] = at.FREE, 1.0
    y = np.zeros((2, at.STATES))
    y[0, [at.MOTOR_SPEED, at.ROTOR_SPEED]] = 3.0
    found = integrate(y, given, (machine.shafts, machine.gear, machine.tables), 1.0 / RATE, 8)
    held = energy(machine, found)
    assert np.ptp(found[:, 0, at.TURNING]) > 1.0  # it swings on its springs
    assert np.ptp(held) < 1e-4 * (held[0] - held.min() + 0.5 * machine.shafts[0, at.ROTOR_INERTIA] * 9.0)


def test_work_of_the_motors_is_energy_and_heat(scene: Scene) -> None:
    machine, run = scene.machine(), scene.campaign.runs[0]
    machine.shafts[:, at.DAMPING] = 0.0  # its heat is in no output
    found = machine.states(run, BEGUN, 8)
    heat = np.zeros(len(found))
    for row in range(2):
        shaft, out = machine.shafts[row], found[:, row]
        motor, rotor, width = out[:, at.TURNING], out[:, at.ROTOR_TURNING], shaft[at.TURNING_WIDTH]
        heat += (shaft[at.MOTOR_DRY] / np.hypot(motor, width) + shaft[at.MOTOR_VISCOUS]) * motor**2
        drag = scene.bench.shafts[("sun", "ring")[row]].drag.drag(np.abs(rotor))
        heat += (drag / np.hypot(rotor, width) + shaft[at.EDDY]) * rotor**2
    slip = POLE_PAIRS.sun * found[:, 0, at.ROTOR_TURNING] + POLE_PAIRS.ring * found[:, 1, at.ROTOR_TURNING]
    heat += machine.gear[at.SLIP_DAMPING] * slip**2
    given = (found[:, :, at.MOTOR_TORQUE] * found[:, :, at.TURNING]).sum(axis=1)
    work = np.trapezoid(given - heat, dx=1.0 / RATE)
    gained = np.diff(energy(machine, found)[[0, -1]])[0]
    assert abs(gained) > 3.0
    assert work == pytest.approx(gained, rel=3e-3)


@pytest.mark.parametrize(("identifier", "shaft", "law"), PLACED)
def test_an_effect_is_nothing_at_size_0_and_something_at_its_usual_size(
    yardstick: MotionYardstick, identifier: str, shaft: str, law: str
) -> None:
    rng = np.random.default_rng(2)
    drawn = _draw_effect(identifier, shaft, rng)
    knobs = {name: rng.uniform(*ends) for name, ends in drawn.form.laws.every[law].ranges.items()}
    effect = replace(drawn, knobs={**drawn.knobs, **knobs, "law": law})
    scene = yardstick.scene
    machine = scene.machine()
    nothing = replace(effect, size=0.0)
    nothing.form.act(machine, nothing)
    for run, before in zip(scene.campaign.runs, yardstick.bare, strict=True):
        after = machine.follow(run, BEGUN)
        for side in ("sun", "ring"):
            np.testing.assert_allclose(after.torque[side], before.torque[side], rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(after.angle[side], before.angle[side], rtol=0.0, atol=1e-9)
    usual = replace(effect, size=min(2.0 * effect.form.first, effect.form.most))
    size = yardstick.measure(scene.courses([usual]))
    assert 0.0 <= size.absorbed <= size.raw < 1e5
    assert size.raw > 0.02 or not usual.form.seen
    assert max(size.rms) > 1e-5 or identifier == "encoder_eccentricity"


def test_an_effect_is_scaled_to_the_size_asked_for(yardstick: MotionYardstick) -> None:
    scaled = scale_to(yardstick, _draw_effect("gear_hysteresis", "both", np.random.default_rng(3)), 2.0)
    assert scaled.reached.absorbed == pytest.approx(2.0, rel=0.05)


def test_a_baseline_takes_up_what_every_bench_has(yardstick: MotionYardstick) -> None:
    """Ripple of a turn and half a sample between channels are within tolerance; ten times as much is ten of them."""
    for identifier, size, law in (("shaft_unbalance", 6e-3, "gravity"), ("transducer_bandwidth", 5e-3, "first")):
        effect = replace(_draw_effect(identifier, "sun", np.random.default_rng(5)), size=size)
        effect = replace(effect, knobs={**effect.knobs, "law": law, "growth": 0.0})
        found = yardstick.measure(yardstick.scene.courses([effect]))
        points = sum(run.samples for run in yardstick.scene.campaign.runs) / RATE / POINT
        assert found.absorbed < 0.9 * found.raw
        assert found.absorbed * np.sqrt(points) < 15.0


def test_a_baseline_takes_up_what_it_may_move(yardstick: MotionYardstick) -> None:
    """Ten per cent of inertia are two standard uncertainties, a drag curve is free, hysteresis is none of it."""
    left = {}
    for identifier, shaft, size in (("rotor_inertia", "ring", 0.1), ("gear_hysteresis", "both", 2e-3)):
        effect = replace(_draw_effect(identifier, shaft, np.random.default_rng(4)), size=size)
        effect = replace(effect, knobs={**effect.knobs, "law": next(iter(effect.form.laws.every))})
        found = yardstick.measure(yardstick.scene.courses([effect]))
        points = sum(run.samples for run in yardstick.scene.campaign.runs) / RATE / POINT
        left[identifier] = found.absorbed * np.sqrt(points), found.absorbed / found.raw
    assert left["rotor_inertia"][0] == pytest.approx(2.0, rel=0.2)
    assert left["rotor_inertia"][1] < 0.1
    assert left["gear_hysteresis"][1] > 0.3


@pytest.mark.parametrize("design", DESIGNS)
def test_a_design_holds_the_runs_that_it_may(design: str) -> None:
    runs = draw_campaign(np.random.default_rng(4), design).runs
    does = {run.manoeuvre for run in runs}
    assert [run.point for run in (runs[0], runs[-1])] == ["Z_0", "Z_2"]
    assert (Manoeuvre.DITHER in does) == (Manoeuvre.SWEEP in does) == (design == "full") or design == "one direction"
    assert all(b.started_at > a.started_at for a, b in pairwise(runs))
    if design == "full":
        assert 22 <= len(runs) <= 26


def short_case(scene: Scene) -> MotionCase:
    zero = PlannedRun(
        "Z_0", Configuration.ZERO, Manoeuvre.ZERO, {"none": (at.HELD, np.zeros(3000))}, phases=((0, "ZERO"),)
    )
    runs = draw_campaign(np.random.default_rng(5)).runs[:3]
    planned = [
        replace(one, started_at=run.started_at) for one, run in zip((zero, *scene.campaign.runs), runs, strict=True)
    ]
    whole = replace(scene, campaign=MotionCampaign("short", tuple(planned)), begun=(PerShaft(9000.0, 9001.0),) * 3)
    effect = _draw_effect("shaft_unbalance", "sun", np.random.default_rng(6))
    sized = SizedEffect(effect, 0.0, EffectSize(0.0, 0.0, PerShaft(0.0, 0.0)))
    return MotionCase("short", motion_strata()[0], whole, (sized,), "")


def test_a_poor_design_may_name_what_its_own_runs_show(scene: Scene) -> None:
    case = short_case(scene)
    poor = next(each for each in motion_strata() if each.kind == "confounded")
    for size, right in ((0.1, {"consistent"}), (0.7, set()), (0.8, {"named"})):
        (effect,) = case.effects
        sized = replace(effect, reached=EffectSize(size, size, effect.reached.rms))
        found = replace(case, stratum=poor, effects=(sized,))
        assert set(found.expected) == {"confounded", "ambiguous"} | right
        assert found.truth["expected"] == list(found.expected)


def test_the_recordings_hold_what_is_measured_in_memory(scene: Scene, tmp_path: Path) -> None:
    case = short_case(scene)
    runs = measure_motion_case(case, np.random.default_rng(7))
    write_motion_case(case, tmp_path, np.random.default_rng(7))
    store = Store(tmp_path / "store")
    assert sorted(path.name for path in tmp_path.glob("*.mcap")) == [run.file for run in runs]
    ingest(tmp_path, store, workers=1)
    for there, here in zip(moving_runs(store), runs, strict=True):
        for side in ("sun", "ring"):
            np.testing.assert_allclose(there.torque[side], here.torque[side], rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(there.angle[side], here.angle[side], rtol=0.0, atol=0.01 * COUNT)
        nothing = PerShaft(np.zeros(0), np.zeros(0))
        assert replace(there, torque=nothing, angle=nothing) == replace(here, torque=nothing, angle=nothing)


def test_the_same_state_draws_the_same() -> None:
    stratum = next(each for each in motion_strata() if each.kind == "two")
    first, second = (draw_motion_case(np.random.default_rng(8), stratum, size=0.0) for _ in range(2))
    assert [sized.effect.form.identifier for sized in first.effects] == [name for name, _ in stratum.effects]
    assert (first.campaign, first.nonce, first.scene.begun) == (second.campaign, second.nonce, second.scene.begun)
    assert (first.scene.bench, first.effects) == (second.scene.bench, second.effects)
    for one, other in zip(first.scene.campaign.runs, second.scene.campaign.runs, strict=True):
        assert (one.point, one.started_at) == (other.point, other.started_at)
        np.testing.assert_array_equal(one.inputs, other.inputs)


@pytest.mark.parametrize("kind", ["two", "confounded"])
def test_a_campaign_whose_effects_were_sized_once_is_the_same_when_drawn_again(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    nothing = EffectSize(0.0, 0.0, PerShaft(0.0, 0.0))
    sizings = []

    def counted(_: object, effect: MotionEffect, asked: float) -> SizedEffect:
        sizings.append(effect)
        return SizedEffect(replace(effect, size=3.0 * effect.size), asked, nothing)

    monkeypatch.setattr(nature, "scale_to", counted)
    monkeypatch.setattr(MotionYardstick, "measure", lambda *_: nothing)
    monkeypatch.setattr(Scene, "courses", lambda *_: [])
    lot = draw_motion_lots(20, 15, (kind,))[0]
    case, again = lot.draw_sized()
    drawn = pickle.loads(pickle.dumps(again)).draw()  # as a worker gets it
    assert len(sizings) == len(case.effects) == len(lot.stratum.effects)
    assert drawn.truth == case.truth
    assert (again, hash(again)) == (lot, hash(lot)), "the sizes are no part of which campaign it is"


def test_runs_that_are_asked_for_are_made_on_the_same_bench_after_the_others() -> None:
    def rising(time: np.ndarray) -> np.ndarray:
        return 10.0 * time

    def steady(time: np.ndarray) -> np.ndarray:
        return 0.5 + 0.0 * time

    asked = (
        run_as_asked("zero", Manoeuvre.ZERO, {}, 6.0),
        run_as_asked("alone", Manoeuvre.RAMP, {"ring": ("speed", rising)}, 5.0),
        run_as_asked("loaded", Manoeuvre.RAMP, {"sun": ("speed", rising), "ring": ("torque", steady)}, 5.0),
    )
    assert [run.configuration for run in asked] == [Configuration.ZERO, Configuration.NEUTRAL, Configuration.ENGAGED]
    assert [run.samples for run in asked] == [6000, 5000, 5000]
    assert asked[2].drive == "sun"
    assert asked[2].asked["sun"][0] != asked[2].asked["ring"][0]
    case = draw_motion_case(np.random.default_rng(3), next(s for s in motion_strata() if s.kind == "clean"))
    longer = with_further_runs(case, asked, np.random.default_rng(4))
    before, runs = case.scene.campaign.runs, longer.scene.campaign.runs
    assert runs[: len(before)] == before
    assert [run.point for run in runs[len(before) :]] == ["zero", "alone", "loaded"]
    starts = [run.started_at for run in runs[len(before) - 1 :]]
    assert all(later > earlier for earlier, later in pairwise(starts))
    assert longer.scene.bench == case.scene.bench
    course = longer.scene.machine().follow(runs[-1], longer.scene.begun[-1])
    assert course.run.point == "loaded"


def test_an_effect_with_which_a_drive_cannot_hold_its_shaft_is_as_large_as_it_can() -> None:
    """Where the runs end nowhere with it, it is halved, so that what is sealed can be recorded."""
    effect = _draw_effect("rotor_inertia", "sun", np.random.default_rng(3))

    def courses(effects: list[Any]) -> list[Any]:
        held = effects[0].size <= 1.0
        return [
            SimpleNamespace(size=effects[0].size, torque=PerShaft(np.array([1.0, 1.0 if held else np.nan]), np.ones(2)))
        ]

    def measure(found: list[Any]) -> EffectSize:
        assert np.isfinite(found[0].torque.sun).all()
        return EffectSize(found[0].size, found[0].size, PerShaft(0.0, 0.0))

    yardstick: Any = SimpleNamespace(scene=SimpleNamespace(courses=courses), measure=measure)
    scaled = scale_to(yardstick, effect, 4.0)
    assert 0.5 < scaled.effect.size <= 1.0
    assert scaled.reached.absorbed == scaled.effect.size
    assert scale_to(yardstick, effect, 0.7).reached.absorbed == pytest.approx(0.7, rel=0.1)

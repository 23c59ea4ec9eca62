"""A drivetrain and states of it, for tests."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from hypothesis import strategies as st

from pmg.sim.bench import BenchParameters, SourcedQuantity, load_bench
from pmg.sim.dynamics.assumptions import Assumptions, RotorInertia
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.state import State
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import Array
from pmg.sim.steady.power_chain import MotorConvention

BENCH = load_bench()
CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 1e-3)

SIZES = np.array(
    State(1e-3, 1e-3, 3.0, 1e-2, 2.0, 200.0, 200.0, 80.0, 80.0, 3.0, 0.1, 3.0, 1.0, 3.0, 0.1, 3.0, 1.0, 1.0, 1.0, 100.0)
)

states = st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=20).map(lambda unit: np.array(unit) * SIZES)

choices = st.builds(
    Assumptions,
    sensor_lag=st.floats(1e-3, 1.0),
    derivative_filter=st.none() | st.floats(10.0, 1e5),
    motor_signs=st.sampled_from(MotorConvention),
    rotor_inertia_sun=st.sampled_from(RotorInertia),
    rotor_inertia_ring=st.sampled_from(RotorInertia),
    friction_signed=st.booleans(),
    motor_limits=st.booleans(),
    map_scale=st.floats(0.7, 2.0),
    friction_rest_width=st.floats(0.1, 2.0),
    carrier_in_map=st.booleans(),
)


def drivetrain(assumptions: Assumptions | None = None, gear: int = 1) -> Drivetrain:
    return Drivetrain.calibrated(BENCH, MODEL, assumptions, gear)


def without(section: object, *names: str) -> dict[str, SourcedQuantity]:
    known = {f.name for f in fields(section)}  # type: ignore[arg-type]
    assert set(names) <= known
    return {name: SourcedQuantity(0.0, getattr(section, name).unit) for name in names}


def lossless_bench() -> BenchParameters:
    """No friction, no resistance, no damping, and an amplifier that is off."""
    return replace(
        BENCH,
        motor=replace(BENCH.motor, **without(BENCH.motor, "resistance", "damping")),
        shafts=replace(BENCH.shafts, **without(BENCH.shafts, "joint_damping")),
        control=replace(BENCH.control, **without(BENCH.control, "amplifier")),
    )


def total(parts: dict[str, Array]) -> Array:
    return np.asarray(sum(parts.values()))

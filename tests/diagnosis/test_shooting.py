"""Speeds simulated from torques, against closed forms and a solver that knows nothing of them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.diagnosis.motion.shooting import LENGTHS, shoot
from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.sim.signals import Array, Mask

RATE = 84.0
INERTIA, PULL_OUT, VISCOUS = 2e-3, 1.5, 4e-3
"""Of the rotors written down here [kg m2, N m, N m at 100 rad/s]."""


class _Run(SimpleNamespace):
    def __len__(self) -> int:
        return int(self.rows_in)


def _sheet() -> DataSheet:
    return sheet_of(load_bench(), 1, ("run",))


def _trace(side: str, motion: dict[str, Array], missing: tuple[Array, Array], known: Mask, *, coupled: bool) -> Any:  # noqa: ANN401 - stands for a trace
    """A trace whose rows are its fine samples, without noise."""
    sheet = _sheet()
    constants = {"inertia_sun": INERTIA, "inertia_ring": 3.0 * INERTIA, "pull_out": PULL_OUT, "drag_sun_1": VISCOUS}
    turns = [coupled or side == "sun", coupled or side == "ring"]
    run = _Run(rows_in=len(known), run=SimpleNamespace(name="run", turns=turns), row_rate=RATE, rows=lambda fine: fine)
    stretch: Any = SimpleNamespace(
        run=run, side=side, rows=known, coupled=coupled, at_rest=False, torque=np.zeros(int(known.sum()))
    )
    state: Any = SimpleNamespace(stretch=stretch, sheet=sheet, value=lambda name: constants.get(name, 0.0), **motion)
    before, after = (-each[known] for each in missing)
    nothing = np.zeros((int(known.sum()), 1))
    return TorqueTrace(stretch, state, before, after, after, nothing[:, 0], nothing[:, 0], (nothing.T, nothing))


@given(st.floats(-5e-3, 5e-3), st.floats(20.0, 200.0))
@settings(max_examples=20)
def test_a_torque_that_is_missing_speeds_a_free_rotor_up_until_its_drag_balances_it(
    torque: float, speed: float
) -> None:
    rows = int(20.0 * RATE)
    motion = {"speed": np.full(rows, speed), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    missing = np.full(rows, torque), np.zeros(rows)
    found = shoot((_trace("sun", motion, missing, np.ones(rows, dtype=np.bool_), coupled=False),))
    slope = VISCOUS / 100.0
    for shot in found.shots:
        time = np.arange(rows if math.isinf(shot.length) else round(shot.length * RATE)) / RATE
        expected = torque / slope * (1.0 - np.exp(-slope * time / INERTIA))
        assert shot.before == pytest.approx(float(np.sqrt(np.mean(expected**2))), rel=1e-3, abs=1e-9)
        assert shot.after == 0.0
    assert [shot.length for shot in found.shots] == list(LENGTHS)
    assert np.array_equal(found.speeds["run", "sun"], motion["speed"])


def test_coupled_rotors_move_as_their_equations_say() -> None:
    """What was recorded is a solution for some torques; simulated from others, it must be the solution for those."""
    sheet, time = _sheet(), np.arange(int(4.0 * RATE)) / RATE
    poles = np.array([sheet.poles["sun"], sheet.poles["ring"]])
    inertia = np.array([INERTIA, 3.0 * INERTIA])

    def extra(t: float | Array) -> Array:
        return np.array([8e-3 * np.sin(5.0 * t), 0.04 * np.cos(2.0 * t) - 0.04])

    def solved(part: float) -> Array:
        def slopes(t: float, state: Array) -> Array:
            drag = np.array([VISCOUS / 100.0 * state[0], 0.0])
            torque = part * extra(t) - drag - poles * PULL_OUT * np.sin(state[2])
            return np.asarray(np.r_[torque / inertia, poles @ state[:2]])

        start = np.array([30.0, -30.0 * poles[0] / poles[1], 0.0])
        return np.asarray(solve_ivp(slopes, (0.0, time[-1]), start, t_eval=time, rtol=1e-10, atol=1e-12).y)

    recorded, truth = solved(0.0), solved(1.0)
    motion = {"pole_angle": recorded[2], "slip": poles @ recorded[:2]}
    known = np.ones(len(time), dtype=np.bool_)
    traces = tuple(
        _trace(side, motion | {"speed": recorded[at]}, (0.0 * time, extra(time)[at]), known, coupled=True)
        for at, side in enumerate(("sun", "ring"))
    )
    found = shoot(cast("tuple[TorqueTrace, ...]", traces), (math.inf,))
    for at, side in enumerate(("sun", "ring")):
        size = float(np.abs(truth[at] - recorded[at]).max())
        assert size > 1.0
        assert np.abs(found.speeds["run", side] - truth[at]).max() < 0.01 * size


def test_a_simulation_begins_anew_where_a_shaft_stood() -> None:
    rows = int(10.0 * RATE)
    known = np.ones(rows, dtype=np.bool_)
    known[200:260] = False
    motion = {"speed": np.full(rows, 80.0), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    missing = np.full(rows, 1e-3)
    trace = _trace("sun", motion, (missing, missing), known, coupled=False)
    off = shoot((trace,)).speeds["run", "sun"] - 80.0
    assert np.array_equal(np.isnan(off), ~known)
    assert off[0] == off[260] == 0.0
    assert np.all(np.diff(off[:200]) > 0.0)
    assert off[260:459] == pytest.approx(off[:199])


def test_courses_of_noise_have_the_covariance_that_is_stated(rng: np.random.Generator) -> None:
    band, slow = np.array([[2.0, 1.0, 1.5, 1.0], [0.5, -0.4, 0.3, 0.0]]), np.array([[1.0], [1.0], [0.0], [2.0]])
    factor = np.diag(band[0]) + np.diag(band[1, :3], -1)
    rows = np.zeros(4)
    trace: Any = TorqueTrace(cast("Any", None), cast("Any", None), rows, rows, rows, rows, rows, (band, slow))
    drawn = trace.drawn(rng, 40_000)
    expected = factor @ factor.T + slow @ slow.T
    assert np.cov(drawn) == pytest.approx(expected, abs=0.15)

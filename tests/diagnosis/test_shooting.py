"""Speeds simulated from torques, against closed forms and a solver that knows nothing of them."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.diagnosis.motion.shooting import LENGTHS, shoot
from pmg.pipeline.diagnosis.motion.traces import TorqueTrace, _spread
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array, Mask

RATE = 84.0
INERTIA, PULL_OUT, VISCOUS, DAMPING = 2e-3, 1.5, 4e-3, 1e-3
"""Of the rotors written down here [kg m2, N m, N m at 100 rad/s, N m s/rad]."""


class _Run(SimpleNamespace):
    def __len__(self) -> int:
        return int(self.rows_in)


def _sheet() -> DataSheet:
    return sheet_of(load_bench(), 1, ("run",))


def _trace(
    side: str,
    motion: dict[str, Array],
    missing: tuple[Array, Array],
    known: Mask,
    *,
    coupled: bool,
    turns: tuple[bool, bool] | None = None,
    lighter: float = 1.0,
    damping: float = DAMPING,
) -> TorqueTrace:
    """A trace whose rows are its fine samples, without noise; part of its inertia and damping before a cause."""
    turns = turns or (coupled or side == "sun", coupled or side == "ring")
    run = _Run(rows_in=len(known), run=SimpleNamespace(name="run", turns=turns), row_rate=RATE, rows=lambda fine: fine)
    torque = np.zeros(int(known.sum()))
    stretch = SimpleNamespace(run=run, side=side, rows=known, coupled=coupled, at_rest=False, torque=torque)

    def state(part: float, damping: float) -> Any:  # noqa: ANN401 - stands for the state of a rotor
        constants = {"inertia_sun": part * INERTIA, "inertia_ring": 3.0 * part * INERTIA, "pull_out": PULL_OUT}
        constants |= {"drag_sun_1": VISCOUS, "slip_damping": damping}
        return SimpleNamespace(stretch=stretch, sheet=_sheet(), value=lambda name: constants.get(name, 0.0), **motion)

    before, after = (-each[known] for each in missing)
    nothing = np.zeros((len(torque), 1))
    of_noise = (torque, torque, np.zeros((1, len(torque))), nothing)
    return TorqueTrace(
        cast("RotorRows", stretch), state(1.0, DAMPING), state(lighter, damping), before, after, after, *of_noise
    )


@given(st.floats(-5e-3, 5e-3), st.floats(20.0, 200.0))
@settings(max_examples=3)
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
        near = 0.1 * np.sin(95.0 * t)  # of the magnetic spring's mode, near which it is
        return np.array([8e-3 * np.sin(5.0 * t) + near, 0.04 * np.cos(2.0 * t) - 0.04])

    def solved(part: float) -> Array:
        def slopes(t: float, state: Array) -> Array:
            drag = np.array([VISCOUS / 100.0 * state[0], 0.0])
            gear = PULL_OUT * np.sin(state[2]) + DAMPING * (poles @ state[:2])
            torque = part * extra(t) - drag - poles * gear
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
    found = shoot(traces, (math.inf,))
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


def test_before_a_cause_the_inertia_is_the_one_of_the_baseline() -> None:
    rows = int(2.0 * RATE)
    motion = {"speed": np.full(rows, 80.0), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    missing = np.full(rows, 1e-4)
    trace = _trace("sun", motion, (missing, missing), np.ones(rows, dtype=np.bool_), coupled=False, lighter=0.5)
    (shot,) = shoot((trace,), (math.inf,)).shots
    assert shot.before == pytest.approx(2.0 * shot.after, rel=0.05)  # but for the drag, which is small in two seconds


def test_rotors_that_nothing_couples_are_simulated_each_by_itself() -> None:
    rows = int(6.0 * RATE)
    motion = {"speed": np.full(rows, 80.0), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    early = np.arange(rows) < rows // 2
    traces = [
        _trace(side, motion, (np.full(rows, 1e-3),) * 2, known, coupled=False, turns=(True, True))
        for side, known in (("sun", early), ("ring", ~early))
    ]
    found = shoot(tuple(traces), (1.0,))
    assert {shot.side for shot in found.shots} == {"sun", "ring"}


@pytest.mark.parametrize("rows", [0, 3, 20])
def test_a_run_too_short_for_a_length_is_left_out_of_it(rows: int) -> None:
    motion = {"speed": np.full(60, 80.0), "pole_angle": np.zeros(60), "slip": np.zeros(60)}
    trace = _trace("sun", motion, (np.full(60, 1e-3),) * 2, np.arange(60) < rows, coupled=False)
    assert [shot.length for shot in shoot((trace,)).shots] == ([math.inf] if rows == 20 else [])


def test_a_model_that_is_unstable_runs_away_and_is_told() -> None:
    """A gear that is pushed on by its own slip, as a model without a lag of a transducer may have it."""
    rows = int(30.0 * RATE)
    motion = {"speed": np.zeros(rows), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    known = np.ones(rows, dtype=np.bool_)
    missing = np.full(rows, 1e-3), np.zeros(rows)
    traces = [_trace(side, motion, missing, known, coupled=True, damping=-0.01) for side in ("sun", "ring")]
    found = shoot(tuple(traces))
    assert [math.isinf(shot.before) for shot in found.shots if math.isinf(shot.length)] == [True, True]
    assert all(shot.after == 0.0 for shot in found.shots)


def test_of_a_coupled_run_both_rotors_must_be_known() -> None:
    motion = {"speed": np.full(200, 80.0), "pole_angle": np.zeros(200), "slip": np.zeros(200)}
    trace = _trace("sun", motion, (np.full(200, 1e-3),) * 2, np.ones(200, dtype=np.bool_), coupled=True)
    assert shoot((trace,)).shots == shoot(()).shots == ()


def test_realisations_of_noise_have_the_covariance_that_is_stated(rng: np.random.Generator) -> None:
    slow, nothing = np.array([[1.0], [1.0], [0.0], [2.0]]), np.zeros(4)
    factor = np.array([[1.4, 0.0, 0.0, 0.0], [0.7, 1.2, 0.0, 0.0], [0.3, 0.6, 2.0, 0.0], [0.0, 0.0, 0.9, 1.1]])
    band = np.array([np.pad(np.diag(factor, -lag), (0, lag)) for lag in range(3)])
    nobody: Any = None
    trace = TorqueTrace(nobody, nobody, nobody, *(nothing,) * 5, band, slow)
    expected = factor @ factor.T + slow @ slow.T
    assert np.cov(trace.draw_noise(rng, 40_000)) == pytest.approx(expected, abs=0.15)


def test_the_band_of_a_smoothed_torque_is_that_of_its_noise_at_any_instant() -> None:
    """A noise that grows in the run, with correlated rows: of each row, and of the mean over five."""
    n = 30
    band = np.array([1.0, 0.8, 0.3])[:, None] * np.linspace(0.5, 2.0, n)
    for lag in (1, 2):
        band[lag, n - lag :] = 0.0
    factor = np.sum([np.diag(band[lag, : n - lag], -lag) for lag in range(3)], axis=0)
    averaged = np.array([np.mean(factor[max(k - 2, 0) : k + 3], axis=0) for k in range(n)])
    of_no_run = cast("RotorRows", SimpleNamespace(run=_Run(rows_in=n, row_rate=RATE), rows=np.ones(n, dtype=np.bool_)))
    for width, expected in ((1, factor), (5, averaged)):
        found = _spread(of_no_run, band, np.zeros((n, 0)), width)
        np.testing.assert_allclose(found, np.linalg.norm(expected, axis=1))


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 20])
def test_a_stretch_of_fewer_rows_than_its_noise_goes_on_has_a_band_too(rows: int, rng: np.random.Generator) -> None:
    band, nothing = np.zeros((26, rows)), np.zeros(rows)
    band[0], band[1, : rows - 1] = 2.0, 1.0
    nobody: Any = None
    alone = np.r_[2.0, np.full(rows - 1, np.sqrt(5.0))]
    np.testing.assert_allclose(_spread(nobody, band, np.zeros((rows, 0)), 1), alone)
    of_few = cast(
        "RotorRows", SimpleNamespace(run=_Run(rows_in=rows, row_rate=RATE), rows=np.ones(rows, dtype=np.bool_))
    )
    assert np.all(_spread(of_few, band, np.zeros((rows, 0)), 21) <= 3.0)
    trace = TorqueTrace(nobody, nobody, nobody, *(nothing,) * 5, band, np.zeros((rows, 0)))
    assert np.std(trace.draw_noise(rng, 4000), axis=1) == pytest.approx(alone, rel=0.1)


def test_the_noise_of_a_simulation_is_what_its_torque_makes_of_it() -> None:
    """A torque that is off by one amount for a whole run speeds a free rotor up by that over its inertia."""
    rows, size = int(1.0 * RATE), 1e-3
    motion = {"speed": np.full(rows, 80.0), "pole_angle": np.zeros(rows), "slip": np.zeros(rows)}
    nothing = np.zeros(rows)
    trace = _trace("sun", motion, (nothing, nothing), np.ones(rows, dtype=np.bool_), coupled=False)
    (shot,) = shoot((replace(trace, slow=np.full((rows, 1), size)),), (math.inf,)).shots
    time = np.arange(rows) / RATE
    assert shot.after == 0.0
    assert shot.noise == pytest.approx(size / INERTIA * float(np.sqrt(np.mean(time**2))), rel=0.5)  # of few draws

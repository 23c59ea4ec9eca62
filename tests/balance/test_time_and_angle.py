"""What a search takes for a delay, a moment of reversal, a fading drive, and a wave whose angle nobody recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.balance import wheel
from tests.balance.reading import read_one
from tests.balance.test_any_machine import diagnosed, dry, named
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.catalogue import IN_THE_MAIN
from pmg.pipeline.diagnosis.balance.causes import named_causes
from pmg.pipeline.diagnosis.balance.document import headline
from pmg.pipeline.diagnosis.balance.library.drive import ROTARY_DRIVE
from pmg.pipeline.diagnosis.balance.library.term import HOW_MANY, LAG, OF_NONE, RECORDING, TURNED_BEFORE, Motion
from pmg.pipeline.diagnosis.balance.records.reading import _turned_before
from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
from pmg.pipeline.diagnosis.balance.records.reversals import reversals
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.wheel import Turning

    from pmg.sim.signals import Array

CLEAN = '["inertia", "viscous", "coulomb"]'
WAVY = next(term for term in ROTARY_DRIVE if term.identifier == "position_ripple")


def moving(position: Array, besides: dict[str, Array], starts: tuple[int, ...] = (0,)) -> Motion:
    t: Array = np.arange(len(position), dtype=np.float64) * 1e-3
    nothing = np.zeros_like(t)
    references = {HOW_MANY: 2.0}
    speed: Array = np.asarray(np.gradient(position, t), dtype=np.float64)
    return Motion(t, position, speed, nothing, nothing, nothing, 0.0, starts, besides, 0.0, references)


# --- delays ------------------------------------------------------------------------------------------------


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.sampled_from([-0.02, -0.003, 0.004, 0.05]))
def test_the_change_of_a_straight_line_is_its_slope_over_any_time(slope: float, start: float, time: float) -> None:
    motion = moving(np.zeros(1000), {})
    values = start + slope * motion.time
    inner = slice(100, -100)
    assert motion.ahead(values, time)[inner] == pytest.approx(np.full(800, slope), abs=1e-9)
    assert motion.ahead(values, 0.0)[inner] == pytest.approx(np.full(800, slope), abs=1e-9)


def behind(m: Turning, time: float = 0.015) -> Array:
    """What the machine needs when its motion is shown late by a pure delay."""
    return np.interp(m.t + time, m.t, dry(m))


def lagging(m: Turning, time: float = 0.015) -> Array:
    """The same for a lag of the first order."""
    return dry(m) + time * np.gradient(dry(m), m.t)


def test_a_delay_is_told_from_a_lag_and_named_by_one_term(tmp_path: Path) -> None:
    found = {}
    for make in (behind, lagging):
        folder = tmp_path / make.__name__
        folder.mkdir()
        path = wheel.make_case(folder, make, terms=CLEAN)
        case = read_case(path)
        found[make] = read_one(case.fit[0], case).motion.references.get(LAG)
    assert found[lagging] is None
    assert found[behind] == pytest.approx(0.015, rel=0.15)
    diagnosis = diagnosed(tmp_path / "behind" / "case.toml")
    assert diagnosis.verdict.names
    assert named(diagnosis) == {"delay"}
    delay = next(e for e in diagnosis.steps[-1].fitted.estimates if e.term == "delay")
    assert delay.value == pytest.approx(0.015, rel=0.1)


# --- reversals ---------------------------------------------------------------------------------------------


def test_the_moment_of_a_reversal_is_not_taken_for_a_cause(tmp_path: Path) -> None:
    """Dry friction that turns 2 ms after what the low-pass shows of the speed."""

    def turning_late(m: Turning) -> Array:
        return wheel.plain(m) + 0.05 * np.sign(np.interp(m.t - 0.002, m.t, m.speed))

    found = diagnosed(wheel.make_case(tmp_path, turning_late, terms=CLEAN))
    assert found.verdict is Verdict.CONSISTENT


def test_a_machine_that_turns_one_way_has_no_reversals() -> None:
    t = np.arange(4000) * 1e-3
    for position, columns in ((3.0 * t + 0.1 * np.sin(t), 0), (np.sin(3.0 * t), 3)):
        motion = moving(position, {})
        recorded = Recorded(("made",), motion, 4, np.ones(1000, dtype=np.bool_), motion.force, motion.force)
        assert reversals(recorded, ()).shape == (1000, columns)
        # 13 ms after a turn, at 9 rad/s2, it has passed 0.1 mrad
        assert reversals(recorded, (1e-5, 1e-3)).shape == (1000, columns + (columns > 0))


# --- drives that fade, waves without an angle --------------------------------------------------------------


def test_a_drive_that_fades_is_named_by_its_part(tmp_path: Path) -> None:
    def fading(m: Turning) -> Array:
        return np.asarray(dry(m) * (1.0 + 0.2 * m.t / m.t[-1]))

    found = diagnosed(wheel.make_case(tmp_path, fading, terms=CLEAN))
    assert found.verdict is Verdict.NAMED
    assert named(found) == {"drive_fade"}
    assert found.steps[-1].fitted.estimates[-1].value == pytest.approx(0.2, rel=0.1)


@given(st.floats(0.0, 6.0), st.floats(0.0, 6.0))
def test_waves_of_recordings_without_an_angle_have_phases_of_their_own(first: float, second: float) -> None:
    """Each recording begins at zero, the machine does not; what was not fitted is given none."""
    n, period = 600, 0.7
    way = np.tile(np.linspace(0.0, 5.0, n), 2)
    force = np.sin(2.0 * np.pi / period * (way + np.repeat([first, second], n)))
    motion = moving(way, {RECORDING: np.repeat([0.0, 1.0], n)}, (0, n))
    term = WAVY.in_each(2)
    columns = term.columns(motion, period)
    assert columns.shape == (2 * n, len(term.amplitudes)) == (2 * n, 4)
    left = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    assert np.abs(left).max() < 1e-9
    assert not term.columns(moving(way, {RECORDING: np.full(2 * n, OF_NONE)}), period).any()
    assert len({q.name for q in term.amplitudes}) == 4


def test_a_wave_is_named_where_only_speed_was_recorded(tmp_path: Path) -> None:
    def wavy(m: Turning) -> Array:
        return dry(m) + 0.02 * np.sin(5.0 * m.angle)

    found = diagnosed(wheel.make_case(tmp_path, wavy, terms=CLEAN))
    assert found.verdict.names
    assert named(found) == {"position_ripple"}
    assert found.steps[-1].fitted.estimates[-1].value == pytest.approx(2.0 * np.pi / 5.0, rel=0.01)


@pytest.mark.parametrize("weight", [pytest.param(0.08, marks=slow), pytest.param(0.3, marks=slow)])
def test_two_waves_over_the_angle_are_told_each_with_its_period(tmp_path: Path, weight: float) -> None:
    """The weight of an arm, and cogging in a form of its own, which beside a heavy arm refines."""

    def hanging(m: Turning) -> Array:
        return (
            dry(m) + weight * np.sin(m.angle + 0.4) + 0.05 * np.sin(5.0 * m.angle) / (1.2 + np.cos(5.0 * m.angle) / 4)
        )

    channels = f"{wheel.ANGLE}\n{wheel.TORQUE}"
    found = diagnosed(wheel.make_case(tmp_path, hanging, channels=channels, terms=CLEAN))
    assert found.verdict.names
    (second, *_) = (step for step in (*found.steps, *found.refinements) if step.added == "second_ripple")
    assert named(found) == {"position_ripple", "second_ripple"} or second in found.refinements
    periods = {e.term: e.value for e in second.fitted.estimates if e.name == "p"}
    assert periods["position_ripple"] == pytest.approx(2.0 * np.pi, rel=0.01)
    assert periods["second_ripple"] == pytest.approx(2.0 * np.pi / 5.0, rel=0.01)
    assert "once a turn" in named_causes(found)[0].remark


# --- a form that is a little off ---------------------------------------------------------------------------


def test_a_cause_whose_form_differs_is_named_in_the_main_and_what_is_left_is_told(tmp_path: Path) -> None:
    """A ripple that is no sine: most of it is one, and the rest is beyond the noise."""

    def pointed(m: Turning) -> Array:
        wave = np.arcsin(np.sin(5.0 * m.angle)) * 2.0 / np.pi
        return dry(m) + 0.1 * wave

    channels = f"{wheel.ANGLE}\n{wheel.TORQUE}"
    found = diagnosed(wheel.make_case(tmp_path, pointed, channels=channels, terms=CLEAN))
    assert found.naming is not None
    assert found.left_over.found
    part = found.naming.remainder.excess / found.naming.best.gain
    assert 0.0 < part <= IN_THE_MAIN
    assert found.verdict.names
    assert "position_ripple" in named(found)
    assert found.naming.explained or "In the main: " in headline(found)


@pytest.mark.parametrize("turned_at", [0.05, 0.15, None])
def test_a_reversal_before_the_first_sample_that_is_used_is_remembered(turned_at: float | None) -> None:
    """Friction that rises over a way has not risen yet, though the reversal itself lies where filters settle."""
    t = np.arange(0.0, 0.2, 1e-3)
    speed = np.ones_like(t) if turned_at is None else 4.0 * (t - turned_at)
    position = np.cumsum(speed) * 1e-3
    way = _turned_before(position, speed, rest_speed=0.01)
    expected = 1.0 if turned_at is None else 2.0 * (t[-1] - turned_at) ** 2
    assert way == pytest.approx(expected, abs=2e-3)
    motion = Motion(
        t, position, np.abs(speed) + 1.0, speed, speed, speed, besides={TURNED_BEFORE: np.full_like(t, way)}
    )
    assert motion.travel[0] == pytest.approx(way)
    later = motion.part(slice(120, None))
    np.testing.assert_allclose(later.travel, motion.travel[120:])

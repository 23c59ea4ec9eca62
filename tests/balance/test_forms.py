"""Forms of the library on a slide made here: a bell, what settles, a mass on a spring, a gap, a drive at its limit.

What is concealed has other forms than the library, or comes from an integration of its own.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from tests.balance.slide import RATE, Moving, plain
from tests.balance.test_balance import diagnosed, named, value
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.causes import named_causes
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE
from pmg.pipeline.diagnosis.balance.library.term import EXCEEDED, Motion
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.sim.signals import Array

DRY = '["inertia", "viscous", "coulomb"]'
FAR, HERTZ, DAMPING = 60.0, 4.0, 0.03

DRY_FRICTION = 15.0
"""[N]."""


def dry(m: Moving) -> Array:
    """Inertia, viscous and dry friction [N]."""
    return plain(m) + DRY_FRICTION * np.tanh(m.v / 2e-4)


def carried(m: Moving) -> Array:
    """Acceleration of a mass on a spring whose foot moves: exact over each step, in which the foot's is a line."""
    natural = 2.0 * np.pi * HERTZ
    apart = np.array([[0.0, 1.0], [-(natural**2), -2.0 * DAMPING * natural]])  # of x_far - q, driven by -a
    full = np.zeros((4, 4))
    full[:2, :2], full[1, 2], full[2, 3] = apart, -1.0, 1.0
    step = expm(full / RATE)
    found, state = np.zeros_like(m.a), -np.array([m.a[0], (m.a[1] - m.a[0]) * RATE]) / natural**2
    for i, slope in enumerate(np.diff(m.a, append=m.a[-1]) * RATE):
        found[i] = (apart @ state)[1]
        state = (step @ np.r_[state, m.a[i], slope])[:2]
    return found


GAP, LOAD, LOAD_FRICTION = 2e-3, 2.0, 20.0
"""Width of a gap [m], mass [kg] and dry friction [N] of the load behind it."""


def behind_gap(m: Moving) -> Array:
    """A load with dry friction behind a gap: contact by a stiff spring and a damper, integrated in small steps [N]."""
    steps = 40
    fine = np.arange(len(m.t) * steps) / (RATE * steps)
    stiff, loss, h = 4e6, 1700.0, fine[1]
    x, v, found = m.q[0], m.v[0], np.zeros(len(fine))
    near = np.stack([np.interp(fine, m.t, m.q), np.interp(fine, m.t, m.v)], 1).tolist()
    for i, (foot, speed) in enumerate(near):
        apart = foot - x
        pressed = apart - min(max(apart, -0.5 * GAP), 0.5 * GAP)
        push = stiff * pressed + loss * (speed - v) if pressed else 0.0
        push = push if push * pressed > 0.0 else 0.0  # it does not pull
        moved = v + h * push / LOAD
        v = max(abs(moved) - h * LOAD_FRICTION / LOAD, 0.0) * (1.0 if moved > 0.0 else -1.0)
        x += h * v
        found[i] = push
    return np.asarray(dry(m) + found.reshape(-1, steps).mean(axis=1))


def thinned(m: Moving) -> Array:
    """Viscous friction that falls by a hyperbola of time."""
    return dry(m) - 150.0 * m.v * 0.5 * m.t / (m.t + 2.0)


def wound_up(m: Moving) -> Array:
    """A command that runs away from a drive which gives next to nothing beyond its limit."""
    push = dry(m)
    limit = 0.75 * np.abs(push).max()
    return np.where(np.abs(push) > limit, np.sign(push) * (limit + 15.0 * (np.abs(push) - limit)), push)


def test_a_friction_that_is_a_bell_over_speed_is_a_stribeck_friction(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, lambda m: dry(m) + 9.0 * np.tanh(m.v / 2e-4) / (1.0 + (m.v / 0.04) ** 4), terms=DRY)
    assert found.verdict.names
    assert "stribeck" in named(found)
    (fit,) = [step.fitted.fits[-1] for step in found.steps[1:] if step.added == "stribeck"]
    assert fit.candidate.variant == "bell"


@pytest.mark.parametrize("over", [6e-3, pytest.param(0.02, marks=slow)])
def test_a_friction_that_does_not_jump_at_standstill_rises_over_a_speed(tmp_path: Path, over: float) -> None:
    """By a root in place of the library's form, and of a size that is in the balance already."""

    def rising(m: Moving) -> Array:
        return dry(m) + DRY_FRICTION * (m.v / np.hypot(m.v, over) - np.tanh(m.v / 2e-4))

    found = diagnosed(tmp_path, rising, terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"rounded_friction"})
    got, _ = value(found, "rounded_friction")
    assert got == pytest.approx(DRY_FRICTION, rel=0.2)


def test_a_viscous_friction_that_falls_and_settles_warms(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, thinned, terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"warming"})
    got, error = value(found, "warming")
    assert got == pytest.approx(150.0 * 0.5 * 12.0 / 14.0, abs=max(4.0 * error, 4.0))


def test_a_mass_on_a_spring_is_found_with_its_frequency(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, lambda m: dry(m) - FAR * m.a + FAR * carried(m), terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"two_masses"})
    (fit,) = found.steps[-1].fitted.fits
    assert fit.shape == pytest.approx(HERTZ, rel=0.04)
    assert float(fit.amplitudes[0]) == pytest.approx(FAR, rel=0.15)


def test_a_load_behind_a_gap_is_backlash(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, behind_gap, terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"backlash"})
    (fit,) = found.steps[-1].fitted.fits
    assert float(fit.amplitudes[0]) == pytest.approx(LOAD_FRICTION, rel=0.15)
    assert fit.shape == pytest.approx(GAP, rel=0.3)


def test_a_drive_at_its_limit_is_found(tmp_path: Path) -> None:
    limits: list[float] = []

    def limited(m: Moving) -> Array:
        limits.append(0.75 * float(np.abs(dry(m)).max()))
        return wound_up(m)

    found = diagnosed(tmp_path, limited, terms=DRY)
    assert (found.verdict, named(found)) == (Verdict.NAMED, {"drive_limit"})
    got, _ = value(found, "drive_limit")
    assert got == pytest.approx(1.0 - 1.0 / 15.0, abs=0.05)
    (cause,) = named_causes(found)
    (limit,) = re.findall(r"^the limit is ([\d.]+) N$", cause.remark)
    assert float(limit) == pytest.approx(limits[0], rel=0.03)


@pytest.mark.parametrize("hertz", [3.0, 30.0])
def test_a_mass_on_a_spring_follows_slow_motion_and_stays_behind_fast_one(hertz: float) -> None:
    """Below its frequency it is a mass like the rest, above it none: nothing is missing, or the mass itself."""
    (term,) = [t for t in DRIVE if t.key == "two_masses/damped"]
    t = np.arange(4000) / 1000.0
    wave = np.sin(2.0 * np.pi * hertz * t)
    missing = term.columns(Motion(t, wave, wave, wave, wave, wave), 1.0 if hertz > 20.0 else 90.0)[2000:, 0]
    assert np.std(missing + (wave[2000:] if hertz > 20.0 else 0.0)) < 0.02 * np.std(wave)


def test_a_mass_on_a_spring_resonates_where_its_number_says() -> None:
    """Also where the samples are few for a period."""
    (term,) = [t for t in DRIVE if t.key == "two_masses"]
    t = np.arange(4000) / 200.0
    hertz, sizes = np.linspace(30.0, 50.0, 81), []
    for each in hertz:
        wave = np.sin(2.0 * np.pi * each * t)
        sizes.append(np.std(term.columns(Motion(t, wave, wave, wave, wave, wave), 40.0)[2000:, 0]))
    assert hertz[np.argmax(sizes)] == pytest.approx(40.0, abs=0.3)


def test_a_command_that_is_mostly_zero_has_no_limit_in_its_noise() -> None:
    (term,) = [t for t in DRIVE if t.key == "drive_limit"]
    t = np.arange(1000) / 200.0
    moving, still = (t > 4.5).astype(float), np.zeros_like(t)
    pulse = Motion(t, still, moving, still, 5.0 * moving, still, rest_speed=0.1).referred()
    assert pulse.references[EXCEEDED] == 5.0
    assert not term.columns(pulse, 1.0).any()
    at_rest = Motion(t, still, still, still, 5.0 * moving, still, rest_speed=0.1).referred()
    assert not term.columns(at_rest, 1.0).any()


@pytest.mark.parametrize("term", ["warming", "zero_drift"])
def test_a_baseline_means_the_plain_form_of_a_term(tmp_path: Path, term: str) -> None:
    found = diagnosed(tmp_path, dry, terms=f'["inertia", "viscous", "coulomb", "{term}"]')
    assert found.verdict is Verdict.CONSISTENT
    assert [t.key for t in found.steps[0].fitted.baseline] == ["inertia", "viscous", "coulomb", term]

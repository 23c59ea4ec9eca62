"""Laws of concealed effects: finite, with the limits that their formulas have, usual and reserved ones kept apart."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.special import jv
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.trials.effect import Effect, EffectForm, torques
from pmg.pipeline.trials.forms_drag import LOAD_RING
from pmg.pipeline.trials.laws import CHOICES, Law
from pmg.pipeline.trials.laws_thermal import REFERENCE
from pmg.pipeline.trials.nature import draw_case, measure_case, seal_truth
from pmg.pipeline.trials.score.case_list import draw_lots
from pmg.pipeline.trials.score.sealed import draw_truths, seal
from pmg.pipeline.trials.strata import LIBRARY_FORMS, form_of
from pmg.pipeline.trials.world import FASTEST_SUN
from pmg.sim.errors import StoreError
from pmg.sim.signals import Array

UP, ZERO = np.linspace(0.0, 1.2, 200), np.zeros(200)
ONE = np.ones(200)
NAMED = [(form.identifier, name) for form in LIBRARY_FORMS for name in form.laws.every]


def constants(law: Law, rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.uniform(*ends)) for name, ends in law.ranges.items()}


def covariates(identifier: str) -> tuple[Array, ...]:
    """What a law of that effect is a function of, the leading one rising from 0."""
    if identifier in ("load_dependent_bearing_friction", "engaged_dry_friction", "load_dependent_iron_loss"):
        return UP, 0.7 * ONE
    if identifier == "relative_bearing_drag":
        return UP, ZERO
    if identifier == "torque_crosstalk":
        return UP / 3.0, np.r_[0.0, UP[:-1]] / 3.0
    if identifier == "eddy_skin_effect":
        return (196.0 * UP,)
    if identifier == "lubricant_viscosity":
        return (REFERENCE + 40.0 * (UP - 0.5),)
    if identifier == "magnet_temperature":
        return (0.3 * UP,)
    return (UP / 3.0,) if identifier == "torque_gain_error" else (UP,)


def nothing_at_first(y: Array) -> bool:
    return bool(abs(y[0]) < 1e-12)


def rises(y: Array) -> bool:
    return nothing_at_first(y) and bool(np.all(np.diff(y) > 0.0))


def falls_from_one(y: Array) -> bool:
    return bool(abs(y[0] - 1.0) < 1e-4 and np.all(np.diff(y) < 0.0))


def stays_near_one(y: Array) -> bool:
    return bool(np.all(np.abs(y - 1.0) < 0.5))


def passes_zero_falling(y: Array) -> bool:
    at_reference = float(np.interp(REFERENCE, covariates("lubricant_viscosity")[0], y))
    return bool(np.all(np.diff(y) < 0.0)) and abs(at_reference) < 1e-3


LIMITS: dict[str, Callable[[Array], bool]] = {
    "load_dependent_bearing_friction": rises,
    "stribeck_mixed_lubrication": falls_from_one,
    "windage": rises,
    "relative_bearing_drag": rises,
    "engaged_dry_friction": stays_near_one,
    "residual_magnetic_coupling": nothing_at_first,
    "eddy_skin_effect": falls_from_one,
    "load_dependent_iron_loss": rises,
    "lubricant_viscosity": passes_zero_falling,
    "magnet_temperature": falls_from_one,
    "torque_zero_offset": lambda y: bool(np.all(y == 1.0)),
    "torque_zero_drift": nothing_at_first,
    "torque_gain_error": stays_near_one,
    "torque_crosstalk": nothing_at_first,
}
OTHERWISE: dict[tuple[str, str], Callable[[Array], bool]] = {
    ("relative_bearing_drag", "stribeck"): lambda y: bool(y[0] >= 0.3 and np.all(y > 0.0)),
    ("torque_zero_drift", "late"): rises,
    ("torque_zero_drift", "creep"): rises,
    ("torque_zero_drift", "diffusing"): rises,
    ("torque_gain_error", "dead_band"): lambda y: bool(y[0] == 0.0 and np.all(np.diff(y) > 0.0) and y[-1] > 0.99),
    ("torque_gain_error", "levelling"): falls_from_one,
    ("torque_crosstalk", "magnitude"): rises,
    ("torque_crosstalk", "seated"): rises,
    ("torque_crosstalk", "stiffening"): rises,
}
"""Laws with limits of their own within their effect."""


@pytest.mark.parametrize(("identifier", "name"), NAMED)
def test_a_law_is_finite_and_has_the_limits_of_its_formula(
    identifier: str, name: str, rng: np.random.Generator
) -> None:
    law = form_of(identifier).laws.every[name]
    holds = OTHERWISE.get((identifier, name), LIMITS[identifier])
    for _ in range(20):
        drawn = constants(law, rng)
        y = law.shape(*covariates(identifier), **drawn)
        assert y.shape == UP.shape
        assert np.all(np.isfinite(y)), drawn
        assert holds(y), drawn


def at(identifier: str, name: str, *arguments: float, **drawn: float) -> float:
    law = form_of(identifier).laws.every[name]
    return float(law.shape(*(np.array([value]) for value in arguments), **drawn)[0])


def test_laws_have_the_values_of_their_sources() -> None:
    friction, iron, oil, slip = (
        "load_dependent_bearing_friction",
        "load_dependent_iron_loss",
        "lubricant_viscosity",
        "residual_magnetic_coupling",
    )
    assert at(friction, "palmgren", 2.0, 0.5, dead_load=0.0, y=0.5) == pytest.approx(2.0**1.5)
    assert at(friction, "sliding_rolling", 8.0, 1.0, sliding=0.5, rolling_power=1 / 3) == pytest.approx(17.0)
    assert at(friction, "clearance", 1.2, 0.5, gap=0.4, seat=0.05) == pytest.approx(0.8, abs=1e-4)
    assert at(iron, "hysteresis_eddy", 1.0, 0.25, hysteresis=0.2) == pytest.approx(0.4)
    assert at(iron, "excess", 4.0, 0.25, excess=1.0) == pytest.approx(4.0)
    # ISO VG 100 of viscosity index 95: 11.1 mm2/s at 100 degC (ISO 3448 and ASTM D2270 tables)
    assert 100.0 * np.exp(at(oil, "walther", 100.0, grade=100.0, slope=3.55)) == pytest.approx(11.1, rel=0.1)
    for name, drawn in (("vogel", {"b": 900.0, "c": 95.0}), ("roelands", {"start": 7.0, "slope": 1.2})):
        assert np.exp(at(oil, name, 100.0, **drawn)) == pytest.approx(0.11, rel=0.35)
    assert at(slip, "exponential", 1.0) == pytest.approx(1.0)
    assert at("windage", "churning", 1e4, corner=0.5) / at("windage", "churning", 1e3, corner=0.5) == pytest.approx(
        10.0 ** (7 / 3), rel=1e-6
    )
    assert at("windage", "vortices", 0.1, at=0.5) / 0.1 == pytest.approx(0.5**0.6, rel=1e-4)


def test_shielded_parts_are_those_of_the_field_equations() -> None:
    """By the complex fields: flux in a sheet and in a cylinder, and the surface impedance of a sheet."""
    for speed in (5.0, 40.0, 190.0):
        x, corner = np.sqrt(speed / 8.0), 8.0
        z = 0.5 * x * (1.0 + 1.0j)
        field = -6.0 / x**2 * (np.tanh(z) / z).imag
        assert at("eddy_skin_effect", "field", speed, corner=corner) == pytest.approx(field)
        flux = 6.0 / x**2 * (z / np.tanh(z)).imag
        assert at("eddy_skin_effect", "lamination", speed, corner=corner) == pytest.approx(flux)
        k = x * np.sqrt(-1j)
        cylinder = -8.0 / x**2 * (2.0 * jv(1, k) / (k * jv(0, k))).imag
        assert at("eddy_skin_effect", "cylinder", speed, corner=corner) == pytest.approx(cylinder)


# --- which laws are drawn ------------------------------------------------------------------------------


@pytest.mark.parametrize("form", LIBRARY_FORMS, ids=lambda form: form.identifier)
def test_laws_come_from_the_list_asked_for(form: EffectForm, rng: np.random.Generator) -> None:
    laws = form.laws
    assert not set(laws.usual) & set(laws.reserved)
    if form.identifier == "torque_zero_offset":
        assert laws.among("reserved") == laws.among("usual") == ("constant",)
        return
    assert len(laws.usual) >= 3
    assert laws.reserved
    drawn = {choice: {str(laws.draw(choice, rng, {})["law"]) for _ in range(200)} for choice in CHOICES}
    assert drawn == {"usual": set(laws.usual), "reserved": set(laws.reserved), "all": set(laws.every)}
    assert {law: laws.family(law) for law in laws.every} == {
        **dict.fromkeys(laws.usual, "usual"),
        **dict.fromkeys(laws.reserved, "reserved"),
    }


@pytest.mark.parametrize("choice", CHOICES)
def test_a_trial_conceals_only_laws_of_its_choice_and_its_truth_names_them(choice: str) -> None:
    seen: set[str] = set()
    for lot in draw_lots(24, 7, ("one", "two"), choice):
        for effect in json.loads(seal_truth(lot.draw().truth)[0])["effects"]:
            laws = form_of(effect["id"]).laws
            assert effect["knobs"]["law"] in laws.among(choice)
            assert set(effect["knobs"]) >= set(laws.every[effect["knobs"]["law"]].ranges)
            assert effect["laws"] == laws.family(effect["knobs"]["law"])
            seen.add(effect["laws"])
    assert seen >= ({"usual", "reserved"} if choice == "all" else {choice})


def test_another_choice_of_laws_replaces_the_laws_alone() -> None:
    for usual, reserved in zip(draw_lots(8, 3), draw_lots(8, 3, laws="reserved"), strict=True):
        one, other = usual.draw(), reserved.draw()
        assert (one.stratum, one.world) == (other.stratum, other.world)
        np.testing.assert_array_equal(one.design.at.started_at, other.design.at.started_at)
        np.testing.assert_array_equal(one.bare[0], other.bare[0])
        placed = [[(s.effect.form.identifier, s.effect.shaft, s.asked) for s in case.effects] for case in (one, other)]
        assert placed[0] == placed[1]
        noise, again = (measure_case(case, lot.rng("measure")) for case, lot in ((one, usual), (other, reserved)))
        np.testing.assert_allclose(noise.torque_sun - one.shown[0], again.torque_sun - other.shown[0], atol=1e-12)


def test_decoys_are_broad_and_set_in_beyond_a_corner(rng: np.random.Generator) -> None:
    scene = draw_case(find_stratum("clean random"), rng).scene
    at = scene.design.at
    hump, bump = form_of("outside_drag_hump"), form_of("outside_resonance_bump")
    widths = [[float(form.knobs(scene, rng)["width"]) for _ in range(50)] for form in (hump, bump)]
    assert min(widths[0]) > max(widths[1])
    corner = form_of("outside_load_speed_corner")
    effect = Effect(corner, "sun", 0.1, {"speed": 0.5, "load": 0.5, "width": 0.03})
    sun, ring = corner.drag(scene, effect) if corner.drag else (ZERO, ZERO)
    v, load = np.abs(at.speed_sun) / FASTEST_SUN, np.abs(scene.load) / LOAD_RING
    assert not np.any(ring)
    below, beyond = (v < 0.35) | (load < 0.35), (v > 0.65) & (load > 0.65)
    assert beyond.any()
    assert np.all(np.abs(sun[below]) < 1e-3)
    np.testing.assert_allclose(sun[beyond], 0.1 * ((v - 0.5) * (load - 0.5) * np.sign(at.speed_sun))[beyond], rtol=0.02)


def test_an_effect_of_no_size_changes_nothing(rng: np.random.Generator) -> None:
    scene = draw_case(find_stratum("clean random"), rng).scene
    without = torques(scene, ())[1]
    for form in LIBRARY_FORMS:
        for name in form.laws.every:
            for shaft in form.components:
                drawn = form.knobs(scene, rng) | form.laws.draw("all", rng, {"law": name})
                for with_it, bare in zip(torques(scene, (Effect(form, shaft, 0.0, drawn),))[1], without, strict=True):
                    np.testing.assert_allclose(with_it, bare, atol=1e-12)


def test_a_pinned_law_is_drawn_with_its_own_constants(rng: np.random.Generator) -> None:
    found = draw_case(find_stratum("one-way flow, load_dependent_bearing_friction sun 2"), rng, "reserved")
    assert found.effects[0].effect.knobs == {"law": "power", "power": 1.03}


def test_a_trial_is_not_resumed_with_other_laws(tmp_path: Path) -> None:
    lots = draw_lots(2, 1)
    seal(draw_truths(lots)[0], tmp_path, seed=1, kinds=("clean",), route="grid", laws="usual")
    with pytest.raises(StoreError, match="sealed for laws usual; expected a seal for laws all"):
        seal(draw_truths(lots)[0], tmp_path, seed=1, kinds=("clean",), route="grid", laws="all")

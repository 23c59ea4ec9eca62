"""Masses, couplings and the magnetic spring that are not as the data sheet has them, and what limits a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.forms_magnetic import GEAR
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.effect import MotionEffect, MotionForm, named_laws
from pmg.pipeline.trials.motion.machine import ROW
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.motion.machine import SyntheticMachine

ROTORS = {"sun": "sun_rotor", "ring": "ring_rotor"}
COUPLINGS = {"sun": "sun_coupling", "ring": "ring_coupling"}
MOTORS = {"ring": "ring_motor"}
STEADY_TORQUE = 2.8
"""Torque of the ring's motor that the manoeuvres need at steady speed: no limit lies below [N m]."""


def _more_inertia(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Size times the rotor's inertia: fixed to it, dragged along by a film, or on a stiff spring."""
    shaft = machine.shafts[ROW[effect.shaft]]
    more = effect.size * shaft[at.ROTOR_INERTIA]
    if effect.law == "fixed":
        shaft[at.ROTOR_INERTIA] += more
        return
    shaft[at.EXTRA_INERTIA] = more
    if effect.law == "film":
        shaft[at.EXTRA_DAMPING] = more / effect.number("time")
    else:
        rate = REVOLUTION * effect.number("frequency")
        shaft[at.EXTRA_STIFFNESS], shaft[at.EXTRA_DAMPING] = more * rate**2, 2.0 * effect.number("damped") * more * rate


def _softer(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Compliance larger by size: at any twist, or at small ones."""
    shaft = machine.shafts[ROW[effect.shaft]]
    if effect.law == "straight":
        shaft[at.STIFFNESS] /= 1.0 + effect.size
    else:
        shaft[at.SOFTNESS] = effect.size / (1.0 + effect.size)
        shaft[at.SOFT_TWIST] = effect.number("twist")


def _play(machine: SyntheticMachine, effect: MotionEffect) -> None:
    shaft = machine.shafts[ROW[effect.shaft]]
    shaft[at.GAP] = 0.5 * effect.size
    if effect.law == "round":
        shaft[at.GAP_ROUND] = effect.number("round")


def _hysteresis(machine: SyntheticMachine, effect: MotionEffect) -> None:
    machine.gear[at.HYSTERESIS] = effect.size
    machine.gear[at.HYSTERESIS_LAW] = ("bristles", "slip", "sign").index(effect.law)
    machine.gear[at.HYSTERESIS_SPAN] = effect.number("span")


def _harmonic(machine: SyntheticMachine, effect: MotionEffect) -> None:
    if effect.law == "flat":
        machine.gear[at.FLATNESS] = np.sqrt(3.0 * effect.size / machine.gear[at.PULL_OUT])
    else:
        machine.gear[at.THIRD] += effect.signed


def _other_spring(machine: SyntheticMachine, effect: MotionEffect) -> None:
    machine.gear[at.PULL_OUT] *= 1.0 + effect.signed if effect.law == "constant" else np.exp(effect.signed)


def _limit(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """A limit as near to what steady runs need as size says: 1 is there, 0 is far."""
    shaft = machine.shafts[ROW[effect.shaft]]
    if effect.size > 0.0:
        shaft[at.LIMIT] = STEADY_TORQUE / effect.size
        shaft[at.LIMIT_SOFT] = float(effect.law == "soft")


ELASTICS: tuple[MotionForm, ...] = (
    MotionForm(
        "rotor_inertia",
        ROTORS,
        "1",
        0.1,
        2.0,
        _more_inertia,
        named_laws(fixed={}, film={"time": (4e-4, 1e-3)}, spring={"frequency": (90.0, 160.0), "damped": (0.02, 0.1)}),
        {},
    ),
    MotionForm(
        "coupling_compliance",
        COUPLINGS,
        "1",
        1.0,
        30.0,
        _softer,
        named_laws(straight={}, progressive={"twist": (3e-4, 1.5e-3)}),
        {},
    ),
    MotionForm(
        "coupling_backlash",
        COUPLINGS,
        "rad",
        2e-3,
        0.1,
        _play,
        named_laws(sharp={}, round={"round": (0.05, 0.25)}),
        {},
    ),
    MotionForm(
        "gear_hysteresis",
        GEAR,
        "N m",
        2e-3,
        0.03,
        _hysteresis,
        named_laws(bristles={"span": (4e-3, 0.02)}, slip={"span": (4e-3, 0.02)}, sign={"span": (0.05, 0.3)}),
        {},
    ),
    MotionForm("torque_map_harmonic", GEAR, "N m", 0.02, 0.15, _harmonic, named_laws(third={}, flat={}), {}, True),
    MotionForm("pull_out_torque", GEAR, "1", 0.1, 0.5, _other_spring, named_laws(constant={}, grown={}), {}, True),
    MotionForm("drive_limit", MOTORS, "1", 1.0, 1.0, _limit, named_laws(hard={}, soft={}), {}, seen=False),
)
"""Forms of masses, springs and drives."""

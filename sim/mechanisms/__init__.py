"""The catalogue of mechanisms: one class each, listed once."""

from __future__ import annotations

from pmg.sim.mechanisms.base import Component, Experiment, Mechanism, Parameter, Reveals, RotorLaw, Torques
from pmg.sim.mechanisms.bearings import NeutralRemainder, RelativeBearing, RingBearings, SunBearings
from pmg.sim.mechanisms.magnetic import EddyDamping, ExcessDamping, HysteresisDamping

BASELINE: tuple[type[Mechanism], ...] = (
    SunBearings,
    RelativeBearing,
    RingBearings,
    NeutralRemainder,
    HysteresisDamping,
    EddyDamping,
    ExcessDamping,
)
"""The mechanisms of the thesis's own model, in the order of the power chain."""

LIBRARY: tuple[type[Mechanism], ...] = BASELINE
"""Every mechanism pmg knows; what the diagnosis may name beyond the baseline joins here."""

__all__ = [
    "BASELINE",
    "LIBRARY",
    "Component",
    "EddyDamping",
    "ExcessDamping",
    "Experiment",
    "HysteresisDamping",
    "Mechanism",
    "NeutralRemainder",
    "Parameter",
    "RelativeBearing",
    "Reveals",
    "RingBearings",
    "RotorLaw",
    "SunBearings",
    "Torques",
]

"""The catalogue of mechanisms: one class each, listed once."""

from __future__ import annotations

from pmg.sim.mechanisms.base import (
    Component,
    Experiment,
    Instrument,
    Mechanism,
    Parameter,
    Reveals,
    RotorLaw,
    Torques,
)
from pmg.sim.mechanisms.bearings import NeutralRemainder, RelativeBearing, RingBearings, SunBearings
from pmg.sim.mechanisms.field import ResidualCoupling, SkinEffect
from pmg.sim.mechanisms.friction import MixedLubrication, PoleSlip, RubbingCarrier, Windage
from pmg.sim.mechanisms.instruments import Crosstalk, GainError, ZeroDrift, ZeroOffset
from pmg.sim.mechanisms.load import LoadFriction, LoadIronLoss, RelativeBearingDrag
from pmg.sim.mechanisms.magnetic import EddyDamping, ExcessDamping, HysteresisDamping
from pmg.sim.mechanisms.thermal import LubricantViscosity, MagnetTemperature
from pmg.sim.mechanisms.waveform import (
    ClockOffset,
    CoggingLines,
    Eccentricity,
    EncoderScale,
    Misalignment,
    Unbalance,
)

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

CANDIDATES: tuple[type[Mechanism], ...] = (
    LubricantViscosity,
    LoadFriction,
    MixedLubrication,
    Windage,
    RelativeBearingDrag,
    RubbingCarrier,
    ResidualCoupling,
    SkinEffect,
    LoadIronLoss,
    MagnetTemperature,
    ZeroOffset,
    ZeroDrift,
    GainError,
    Crosstalk,
)
"""Mechanisms beyond the baseline that show in mean torques: those the diagnosis may name."""

REFINED: tuple[type[Mechanism], ...] = tuple(kind.refined for kind in CANDIDATES if kind.refined is not None)
"""Candidates in more detail, under the same ids."""

OTHERS: tuple[type[Mechanism], ...] = (
    PoleSlip,
    CoggingLines,
    Unbalance,
    Misalignment,
    Eccentricity,
    EncoderScale,
    ClockOffset,
)
"""Mechanisms that show in speeds or within a turn, not in mean torques."""

LIBRARY: tuple[type[Mechanism], ...] = (*BASELINE, *CANDIDATES, *OTHERS)
"""Every mechanism pmg knows."""

__all__ = [
    "BASELINE",
    "CANDIDATES",
    "LIBRARY",
    "OTHERS",
    "REFINED",
    "Component",
    "EddyDamping",
    "ExcessDamping",
    "Experiment",
    "GainError",
    "HysteresisDamping",
    "Instrument",
    "LoadFriction",
    "LubricantViscosity",
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

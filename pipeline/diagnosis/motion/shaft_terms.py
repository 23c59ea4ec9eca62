"""Candidates on one shaft: its bearings, its coupling, its encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.term import Quantity
from pmg.pipeline.diagnosis.motion.constants import dry_name, form_names
from pmg.pipeline.diagnosis.motion.terms import amount, engaged, signed, stack, term
from pmg.pipeline.diagnosis.motion.view import lagging
from pmg.pipeline.motion.smooth import derivative
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.motion.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


def _moved(view: RotorView, side: str, angle: Array, curvature: Array) -> Array:
    """Torque on a rotor if that of a side stands by an angle [rad] ahead of where it was thought to stand."""
    inertia = view.constant(f"inertia_{side}") if view.side == side else 0.0
    return np.asarray(inertia * curvature + view.stiffness * view.history.baseline.sheet.poles[side] * angle)


def _softer(side: str) -> Callable[[RotorView, float], Array]:
    def law(view: RotorView, _: float) -> Array:
        shaft = view.shaft_of(side)
        return stack(_moved(view, side, -shaft.torque, -shaft.torque_curvature))

    return law


def _play(side: str) -> Callable[[RotorView, float], Array]:
    """A rotor that lags or leads by half the play, for a play of 1 rad; smooth through no torque."""

    def law(view: RotorView, _: float) -> Array:
        rate = view.state.stretch.run.fine_rate
        angle = -0.5 * np.tanh(view.shaft_of(side).torque / PLAY_PASSAGE)
        return stack(_moved(view, side, angle, derivative(derivative(angle, rate), rate)))

    return law


PLAY_PASSAGE = 0.02
"""Torque over which a play passes from one flank to the other [N m]."""


def _eccentric(side: str) -> Callable[[RotorView, float], Array]:
    """An encoder that shows an angle too large by a wave of once a turn, for 1 rad."""

    def law(view: RotorView, _: float) -> Array:
        angle, speed = view.shaft_of(side).angle, view.shaft_of(side).speed
        return stack(*(_moved(view, side, -wave(angle), speed**2 * wave(angle)) for wave in (np.cos, np.sin)))

    return law


def bearing_terms(side: str) -> Iterator[MotionTerm]:
    """Friction in the bearings of a shaft."""
    bearings = Component(f"{side}_bearings")
    yield term(
        "lubricant_viscosity",
        "Lubricant that thins as the bearings warm",
        "-a x(t) M(w)",
        amount("fall", "1", 20.0),
        lambda v, settles: stack(-v.direction * v.drag * v.warmth(settles)),
        source=sources.HARRIS,
        shape=Quantity("settles", "s", (20.0, 2000.0)),
        component=bearings,
        shaft=side,
    )

    yield term(
        "load_dependent_bearing_friction",
        "Bearing friction growing with load",
        "mu |T| sign(w)",
        amount("mu", "1", 0.3),
        engaged(lambda v, _: stack(v.direction * np.abs(v.load))),
        source=sources.PALMGREN,
        component=bearings,
        shaft=side,
    )

    yield term(
        "stribeck_mixed_lubrication",
        "Mixed lubrication at low speed",
        "M exp(-|w|/ws) sign(w)",
        amount("extra", "N m", 1.0),
        lambda v, speed: stack(v.direction * np.exp(-np.abs(v.speed) / speed)),
        source=sources.ARMSTRONG,
        shape=Quantity("speed", "rad/s", (1.5, 40.0)),
        mimicked_by=form_names(side),
        component=bearings,
        shaft=side,
    )

    yield term(
        "presliding_friction",
        "Friction that rises over an angle after a reversal",
        "M (z(theta) - sign(w))",
        amount("friction", "N m", 1.0),
        lambda v, over: stack(lagging(v.shaft.angle, over) - v.direction),
        source=sources.DAHL,
        shape=Quantity("angle", "rad", (0.03, 6.0)),
        component=bearings,
        shaft=side,
    )

    yield term(
        "direction_dependent_friction",
        "More drag in one sense of rotation",
        "a M(|w|)",
        signed("part", unit="1", most=1.0),
        lambda v, _: stack(v.direction**2 * v.drag),
        source=sources.ARMSTRONG,
        component=bearings,
        shaft=side,
    )


def rubbing_terms(side: str) -> Iterator[MotionTerm]:
    """What rubs on a rotor in the engaged gear."""
    yield term(
        "engaged_dry_friction",
        "Dry friction in the engaged gear",
        "M sign(w)",
        amount("friction", "N m", 1.0),
        engaged(lambda v, _: stack(v.direction)),
        source=sources.BALANCE,
        mimicked_by=(dry_name(side),),
        component=Component.MAGNETIC_GEAR,
        shaft=side,
    )


def turning_terms(side: str) -> Iterator[MotionTerm]:
    """What turns with a shaft: its mass, its unbalance, its encoder."""
    bearings = Component(f"{side}_bearings")
    yield term(
        "shaft_unbalance",
        "Unbalance of the shaft",
        "m g e sin(theta + theta0)",
        signed("cosine", "sine", unit="N m", most=1.0),
        lambda v, _: stack(np.cos(v.shaft.angle), np.sin(v.shaft.angle)),
        source=sources.BALANCE,
        component=bearings,
        shaft=side,
    )

    yield term(
        "encoder_eccentricity",
        "Encoder that sits off centre",
        "J w2 e sin(theta + theta0)",
        signed("cosine", "sine", unit="rad", most=0.05),
        _eccentric(side),
        source=sources.BALANCE,
        spreads=True,
        component=Component(f"{side}_encoder"),
        shaft=side,
    )

    yield term(
        "rotor_inertia",
        "A mass that the drawing does not have",
        "dJ dw/dt",
        signed("more", unit="kg m2", most=0.1),
        lambda v, _: stack(v.state.acceleration),
        source=sources.BALANCE,
        constant=f"inertia_{side}",
        component=bearings,
        shaft=side,
    )


def coupling_terms(side: str) -> Iterator[MotionTerm]:
    """The coupling of a shaft."""
    coupling = Component(f"{side}_coupling")
    yield term(
        "coupling_compliance",
        "A softer coupling",
        "-(J d2T/dt2 + K p T) dc",
        (Quantity("more", "rad/(N m)", (-2e-4, 5e-3)),),
        _softer(side),
        source=sources.BALANCE,
        constant=f"compliance_{side}",
        spreads=True,
        component=coupling,
        shaft=side,
    )

    yield term(
        "coupling_backlash",
        "Play in the coupling",
        "-(J s2 + K p) b/2 sign(T)",
        amount("play", "rad", 0.2),
        _play(side),
        source=sources.BALANCE,
        spreads=True,
        component=coupling,
        shaft=side,
    )

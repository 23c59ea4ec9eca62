"""Candidates on one shaft: its bearings, what turns with it, its encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import amount, signed, stack, term
from pmg.pipeline.diagnosis.motion.constants import (
    SPEED_UNIT,
    dry_name,
    eccentricity_names,
    form_names,
    passage_names,
    ripple_names,
)
from pmg.pipeline.diagnosis.motion.stance import eccentric
from pmg.pipeline.diagnosis.motion.view import lagging, stopping
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


SHARP = 0.06
"""Speed over which friction that changes sides at once does so [rad/s]: twice the noise of a speed."""


SLIDING = 0.7
"""Friction of a dry pair that slides over that at rest; drag by the speed takes up where it is another part."""

RISES = 1e-3
"""Angle over which the friction of any bearing may rise after a reversal [rad], as its balls roll on before they slip;
what rises over less than the least angle of a finding is not told from it."""


def _eccentric(side: str) -> Callable[[RotorView, float], Array]:
    """An encoder that shows an angle too large by a wave of once a turn, for 1 rad."""

    return lambda view, _: stack(*eccentric(view.state, side))


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
        mixes=True,
        follows=(LawCovariate.SPEED, LawCovariate.TIME),
        component=bearings,
        shaft=side,
    )

    yield term(
        "load_dependent_bearing_friction",
        "Bearing friction growing with load",
        "mu |T| sign(w)",
        amount("mu", "1", 0.3),
        lambda v, _: stack(v.direction * np.abs(v.load)),
        engaged_only=True,
        source=sources.PALMGREN,
        follows=(LawCovariate.LOAD, LawCovariate.SPEED),
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
        mixes=True,
        follows=(LawCovariate.SPEED,),
        component=bearings,
        shaft=side,
    )

    yield term(
        "stribeck_mixed_lubrication",
        "Mixed lubrication at low speed, up to standstill",
        "M exp(-(w/ws)2) sign(w)",
        amount("extra", "N m", 1.0),
        lambda v, speed: stack(np.tanh(v.speed / SHARP) * np.exp(-((v.speed / speed) ** 2))),
        source=sources.ARMSTRONG,
        shape=Quantity("speed", "rad/s", (0.7, 20.0)),
        mimicked_by=(*form_names(side), *passage_names(side)),
        mixes=True,
        follows=(LawCovariate.SPEED,),
        variant="to standstill",
        component=bearings,
        shaft=side,
    )


def reversal_terms(side: str) -> Iterator[MotionTerm]:
    """Friction that depends on the sense of rotation, and on the last reversal."""
    bearings = Component(f"{side}_bearings")
    for gives, at_most, variant in ((lagging, "", ""), (stopping, ", z at most 1", "one stop")):

        def law(view: RotorView, over: float, gives: Callable[[Array, float], Array] = gives) -> Array:
            return stack(gives(view.slow_angle, over) - view.direction)

        yield term(
            "presliding_friction",
            "Friction that rises over an angle after a reversal",
            f"M (z(theta) - sign(w)){at_most}",
            amount("friction", "N m", 1.0),
            law,
            source=sources.DAHL,
            shape=Quantity("angle", "rad", (3e-3, 3.0)),
            variant=variant,
            mixes=True,
            follows=(LawCovariate.SPEED,),
            component=bearings,
            shaft=side,
            granted=None if variant else RISES,
        )

    yield term(
        "direction_dependent_friction",
        "More drag in one sense of rotation",
        "a M(|w|)",
        signed("part", unit="1", most=1.0),
        lambda v, _: stack(v.direction**2 * v.drag),
        source=sources.ARMSTRONG,
        follows=(LawCovariate.SPEED,),
        component=bearings,
        shaft=side,
    )

    yield term(
        "direction_dependent_friction",
        "Dry friction that is larger in one sense of rotation",
        "M",
        signed("friction", unit="N m", most=0.5),
        lambda v, _: stack(v.direction**2),
        source=sources.ARMSTRONG,
        mimicked_by=(f"zero_{side}",),
        variant="dry",
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
        lambda v, _: stack(v.direction),
        engaged_only=True,
        source=sources.BALANCE,
        mimicked_by=(dry_name(side),),
        follows=(LawCovariate.SPEED, LawCovariate.LOAD),
        component=Component.MAGNETIC_GEAR,
        shaft=side,
    )

    yield term(
        "engaged_dry_friction",
        "Dry friction in the engaged gear that passes through standstill over some speed",
        "M tanh(w/w0)",
        amount("friction", "N m", 1.0),
        lambda v, passage: stack(np.tanh(v.speed / passage)),
        engaged_only=True,
        source=sources.BALANCE,
        shape=Quantity("passage", "rad/s", (SHARP, 3.0)),
        mimicked_by=(dry_name(side),),
        follows=(LawCovariate.SPEED, LawCovariate.LOAD),
        variant="passing",
        component=Component.MAGNETIC_GEAR,
        shaft=side,
    )

    yield term(
        "engaged_dry_friction",
        "Dry friction in the engaged gear that falls from rest to sliding",
        "M (s + (1 - s)/(1 + (w/ws)2)) sign(w), s = 0.7",
        amount("friction", "N m", 1.0),
        lambda v, speed: stack(v.direction * (SLIDING + (1.0 - SLIDING) / (1.0 + (v.speed / speed) ** 2))),
        engaged_only=True,
        source=sources.ARMSTRONG,
        shape=Quantity("speed", "rad/s", (1.5, 80.0)),
        mimicked_by=(dry_name(side),),
        follows=(LawCovariate.SPEED, LawCovariate.LOAD),
        variant="falling",
        component=Component.MAGNETIC_GEAR,
        shaft=side,
    )


def wave_terms(side: str) -> Iterator[MotionTerm]:
    """What comes back with every turn of a shaft."""
    yield term(
        "shaft_unbalance",
        "Unbalance of the shaft",
        "m g e sin(theta + theta0)",
        signed("cosine", "sine", unit="N m"),
        lambda v, _: stack(np.cos(v.shaft.angle), np.sin(v.shaft.angle)),
        source=sources.BALANCE,
        constants=ripple_names(side, 1),
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

    yield term(
        "shaft_unbalance",
        "Unbalance that grows as the shaft bends with speed",
        "(m g e + k w2) sin(theta + theta0)",
        signed("cosine", "sine", "bent_cosine", "bent_sine", unit="N m", most=1.0),
        lambda v, _: stack(*(w(v.shaft.angle) * (v.speed / SPEED_UNIT) ** n for n in (0, 2) for w in (np.cos, np.sin))),
        source=sources.BALANCE,
        mimicked_by=ripple_names(side, 1),
        variant="bent",
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

    yield term(
        "coupling_misalignment",
        "Misaligned coupling",
        "C sin(2 theta + theta0)",
        signed("cosine", "sine", unit="N m"),
        lambda v, _: stack(np.cos(2.0 * v.shaft.angle), np.sin(2.0 * v.shaft.angle)),
        source=sources.BALANCE,
        constants=ripple_names(side, 2),
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

    yield term(
        "coupling_misalignment",
        "Misaligned coupling whose joints bend twice a turn",
        "C sin(2 theta + theta0) + D sin(4 theta + theta1)",
        signed("cosine", "sine", "fourth_cosine", "fourth_sine", unit="N m", most=1.0),
        lambda v, _: stack(*(wave(order * v.shaft.angle) for order in (2.0, 4.0) for wave in (np.cos, np.sin))),
        source=sources.BALANCE,
        mimicked_by=ripple_names(side, 2),
        variant="bent",
        component=Component(f"{side}_coupling"),
        shaft=side,
    )


def turning_terms(side: str) -> Iterator[MotionTerm]:
    """What turns with a shaft: its encoder, its mass."""
    yield term(
        "encoder_eccentricity",
        "Encoder that sits off centre",
        "(J w2 - K p) e sin(theta + theta0)",
        signed("cosine", "sine", unit="rad", most=0.05),
        _eccentric(side),
        source=sources.BALANCE,
        constants=eccentricity_names(side),
        spreads=True,
        component=Component(f"{side}_encoder"),
        shaft=side,
    )

    yield term(
        "rotor_inertia",
        "A mass that the drawing does not have",
        "dJ dw/dt",
        signed("more", unit="kg m2"),
        lambda v, _: stack(v.state.acceleration),
        source=sources.BALANCE,
        constants=(f"inertia_{side}",),
        component=Component(f"{side}_bearings"),
        shaft=side,
    )

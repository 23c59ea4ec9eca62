"""Candidates in the magnetic gear and between the shafts."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import BOTH, amount, signed, stack, term
from pmg.pipeline.diagnosis.motion.constants import COGGING_ORDERS, MAP_WAVES, map_name
from pmg.pipeline.diagnosis.motion.view import lagging, stopping, waves_of
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array

STOPS = (2.5, 1.0, 0.4)
"""Angles at which the springs of a hysteresis give way, over the middle one."""

STEADY_ANGLE = 0.004
"""Least pole angle at which one may give way [rad]: counts of the encoders let the pole angle tremble by a milliradian
or two, and a spring that gives way at that follows their noise."""

EVEN = 0.05
"""Largest even harmonic of the torque over the pole angle [N m], a tenth of the pull-out torque of the gears that ship:
north and south poles that are alike make none."""


def hysteresis_terms() -> Iterator[MotionTerm]:
    """Hysteresis of the magnetic spring."""
    several = "several stops"
    for gives, at_most, variant, within in ((lagging, "", "", ""), (stopping, ", z at most 1", "one stop", several)):

        def law(view: RotorView, over: float, gives: Callable[[Array, float], Array] = gives) -> Array:
            return stack(view.pairs * view.of_poles(over, gives))

        yield term(
            "gear_hysteresis",
            "Hysteresis of the gear: a drag on the pole angle that does not depend on its rate",
            f"p h z(phi){at_most}",
            amount("drag", "N m", 0.1),
            law,
            engaged_only=True,
            shape=Quantity("angle", "rad", (STEADY_ANGLE, 0.2)),
            source=sources.DAHL,
            variant=variant,
            within=within,
            mixes=True,
            of_pole_angle=True,
            follows=(LawCovariate.LOAD,),
            component=Component.MAGNETIC_GEAR,
            shaft=BOTH,
        )

    yield term(
        "gear_hysteresis",
        "Hysteresis of the gear: a drag on the pole angle that does not depend on its rate",
        "p sum h_i z_i(phi), z_i at most 1",
        (*amount("soft", "N m", 0.1), *amount("drag", "N m", 0.1), *amount("stiff", "N m", 0.1)),
        lambda v, over: v.pairs * stack(*(v.of_poles(k * over, stopping) for k in STOPS)),
        engaged_only=True,
        shape=Quantity("angle", "rad", (STEADY_ANGLE / STOPS[-1], 0.1)),
        source=sources.DAHL,
        variant=several,
        of_parts=True,
        mixes=True,
        of_pole_angle=True,
        follows=(LawCovariate.LOAD,),
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )

    yield term(
        "gear_hysteresis",
        "Drag of the gear that changes its sign with the rate of the pole angle",
        "p h erf(v/v0)",
        amount("drag", "N m", 0.1),
        lambda v, slow: stack(v.pairs * erf(v.slip / slow)),
        engaged_only=True,
        shape=Quantity("slow", "rad/s", (0.05, 2.0)),
        variant="by rate",
        of_pole_angle=True,
        follows=(LawCovariate.LOAD,),
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )


def spring_terms() -> Iterator[MotionTerm]:
    """The magnetic spring: its shape, its strength."""
    third, second = signed("third", unit="N m", most=0.5), signed("second", unit="N m", most=EVEN)
    for waves, sizes, variant, shape, equation in (
        ((3,), third, "", "is no sine", "p A3 sin 3 phi"),
        (
            (2, 3),
            (*second, *third),
            "even",
            "is no sine, and steeper on one of its flanks",
            "p (A2 sin 2 phi + A3 sin 3 phi)",
        ),
    ):

        def law(view: RotorView, _: float, waves: tuple[int, ...] = waves) -> Array:
            return view.pairs * stack(*(np.sin(wave * view.state.pole_angle) for wave in waves))

        yield term(
            "torque_map_harmonic",
            f"Torque against pole angle that {shape}",
            equation,
            sizes,
            law,
            engaged_only=True,
            variant=variant,
            mimicked_by=tuple(map(map_name, MAP_WAVES)),
            of_pole_angle=True,
            follows=(LawCovariate.LOAD,),
            component=Component.MAGNETIC_GEAR,
            shaft=BOTH,
        )

    yield term(
        "pull_out_torque",
        "Another pull-out torque of the magnetic spring",
        "p dA sin phi",
        signed("more", unit="N m"),
        lambda v, _: stack(v.pairs * np.sin(v.state.pole_angle)),
        engaged_only=True,
        constants=("pull_out",),
        of_pole_angle=True,
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )

    yield term(
        "magnet_temperature",
        "Magnets that weaken as they warm",
        "-p a t A sin phi",
        amount("fall", "1", 0.5),
        lambda v, settles: stack(-v.load * (1.0 - np.exp(-v.campaign_time / settles))),
        engaged_only=True,
        shape=Quantity("settles", "s", (60.0, 5000.0)),
        mixes=True,
        follows=(LawCovariate.TIME,),
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )


def loss_terms() -> Iterator[MotionTerm]:
    """Losses of the gear, and drag between the shafts."""
    yield term(
        "load_dependent_iron_loss",
        "Magnetic loss growing with load",
        "k |T| w",
        (*amount("sun", "s/rad", 0.01), *amount("ring", "s/rad", 0.01)),
        lambda v, _: stack(*(np.abs(v.load) * v.speed * (1.0 if v.side == side else 0.0) for side in SIDES)),
        engaged_only=True,
        source=sources.BERTOTTI,
        follows=(LawCovariate.LOAD, LawCovariate.SPEED),
        of_parts=True,
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )

    yield term(
        "eddy_skin_effect",
        "Eddy drag that grows more slowly than speed",
        "-d w (1 - 1/(1 + (w/wc)2))",
        (*amount("sun", "N m s/rad", 0.05), *amount("ring", "N m s/rad", 0.05)),
        lambda v, corner: stack(
            *(-v.speed * (v.side == side) * (1.0 - 1.0 / (1.0 + (v.speed / corner) ** 2)) for side in SIDES)
        ),
        engaged_only=True,
        shape=Quantity("corner", "rad/s", (10.0, 300.0)),
        source=sources.STOLL,
        mixes=True,
        follows=(LawCovariate.SPEED,),
        of_parts=True,
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )

    yield term(
        "residual_magnetic_coupling",
        "Coupling of the rotors left in neutral",
        "p c v/(1 + (v/vc)2)",
        amount("damping", "N m s/rad", 0.01),
        lambda v, corner: stack((0.0 if v.coupled else v.pairs) * v.slip / (1.0 + (v.slip / corner) ** 2)),
        shape=Quantity("corner", "rad/s", (20.0, 2000.0)),
        mixes=True,
        follows=(LawCovariate.SLIP,),
        shown_held=True,
        component=Component.MAGNETIC_GEAR,
        shaft=BOTH,
    )

    yield term(
        "relative_bearing_drag",
        "Drag of the bearing between the shafts",
        "+-(M + b |dw|) sign(dw)",
        signed("constant", "rate", unit="N m", most=0.5),
        lambda v, _: (1.0 if v.side == "sun" else -1.0) * stack(np.tanh(v.relative), v.relative / 100.0),
        source=sources.HARRIS,
        follows=(LawCovariate.DIFFERENCE,),
        shown_held=True,
        component=Component.RELATIVE_BEARING,
        shaft=BOTH,
    )


def cogging_terms() -> Iterator[MotionTerm]:
    """Cogging by order: of the engaged gear, or of a rotor in whichever configuration; a wave, or a sharper course."""
    plain, sharp = ("cosine", "sine"), ("cosine", "sine", "second_cosine", "second_sine")
    for side, engaged_only, names in itertools.product(SIDES, (False, True), (plain, sharp)):

        def law(view: RotorView, order: float, waves: int = len(names) // 2) -> Array:
            return waves_of(view, view.side, tuple(k * round(order) for k in range(1, waves + 1)))

        yield term(
            "cogging",
            f"Cogging of the magnetic gear{' where it is engaged' if engaged_only else ''}",
            f"C sin(n theta_{side} + phase){' + D sin(2 n theta + phase2)' if names == sharp else ''}",
            signed(*names, unit="N m", most=0.5),
            law,
            engaged_only=engaged_only,
            shape=Quantity("order", "1", (float(COGGING_ORDERS[0]), float(COGGING_ORDERS[-1]))),
            one_of=tuple(map(float, COGGING_ORDERS)),
            follows=(LawCovariate.SPEED,),
            component=Component.MAGNETIC_GEAR,
            shaft=side,
            variant=" ".join((*("sharp",) * (names == sharp), *("engaged",) * engaged_only)),
        )

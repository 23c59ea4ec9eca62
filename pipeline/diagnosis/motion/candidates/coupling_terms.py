"""Candidates in the coupling of a shaft, which let a rotor stand behind where its motor says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import amount, stack, term
from pmg.pipeline.diagnosis.motion.constants import coupling_loss_name
from pmg.pipeline.diagnosis.motion.stance import torque_of_angle
from pmg.pipeline.motion.smooth import derivative
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


SIDES_YIELD = 5.0
"""Torque at which the soft sides of a play are compressed by half, over the torque of contact. With both fitted, it was
4.4 for two strong plays with round corners."""


def _moved(view: RotorView, side: str, *moved: Array) -> Array:
    """Torque on a rotor if that of a side stands by an angle ahead of where it was thought to stand.

    `moved` is that angle and its first two derivatives in time [rad, rad/s, rad/s2].
    """
    angle, rate, curvature = moved
    return torque_of_angle(view.state, side, (angle, rate, curvature))


def _softer(side: str) -> Callable[[RotorView, float], Array]:
    def law(view: RotorView, _: float) -> Array:
        shaft = view.shaft_of(side)
        return stack(_moved(view, side, -shaft.torque, -shaft.torque_rate, -shaft.torque_curvature))

    return law


def _yielding(side: str, *angles_of: Callable[[Array, float, float], Array]) -> Callable[[RotorView, float], Array]:
    """A rotor that lags by angles made of the torque in its coupling by the shape, at a rate of samples."""

    def law(view: RotorView, shape: float) -> Array:
        rate, found = view.state.stretch.run.fine_rate, []
        for angle_of in angles_of:
            angle = -angle_of(view.shaft_of(side).torque, shape, rate)
            slope = derivative(angle, rate)
            found.append(_moved(view, side, angle, slope, derivative(slope, rate)))
        return stack(*found)

    return law


def _damped(torque: Array, settles: float, rate: float) -> Array:
    r"""A torque by a first-order lag, :math:`1/(1 + s\tau)` with the bilinear rule."""
    twice = 2.0 * rate * settles
    first = 1.0 / (1.0 + twice)
    slower = (1.0 - twice) * first
    return np.asarray(lfilter([first, first], [1.0, slower], torque, zi=[(first - slower) * torque[0]])[0])


def _crossing(torque: Array, contact: float, _: float) -> Array:
    r"""Half the side on which a rotor lies in its play (n,), which it crosses from rest, evenly accelerated.

    It lies on a side where the torque is beyond `contact` [N m]. Nothing acts between: of a crossing from
    :math:`t_0` to :math:`t_1` it has gone the part :math:`((t - t_0)/(t_1 - t_0))^2`.
    """
    size = np.abs(torque)
    place, lies = np.arange(len(torque)), size > contact
    if not lies.any():
        return np.zeros(len(torque))
    first, last = np.flatnonzero(lies)[[0, -1]]
    left = np.maximum.accumulate(np.where(lies, place, first))
    reached = np.minimum.accumulate(np.where(lies, place, last)[::-1])[::-1]
    after, ahead = np.minimum(left + 1, last), np.maximum(reached - 1, first)
    crossing = ~lies & (left < place) & (place < reached)
    fall, rise = (np.where(crossing, size[a] - size[b], 1.0) for a, b in ((left, after), (reached, ahead)))
    begins = left + (size[left] - contact) / fall
    ends = reached - (size[reached] - contact) / rise
    gone = np.where(crossing, (place - begins) / np.maximum(ends - begins, 1e-9), 0.0)
    side = np.sign(torque)
    return np.asarray(0.5 * (side[left] + (side[reached] - side[left]) * np.clip(gone, 0.0, 1.0) ** 2))


def _pressed(torque: Array, contact: float, _: float) -> Array:
    """Half the compression of the soft sides of a play by a torque (n,), over that by a large one."""
    return np.asarray(0.5 * torque / (np.abs(torque) + SIDES_YIELD * contact))


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
        constants=(f"compliance_{side}",),
        spreads=True,
        component=coupling,
        shaft=side,
    )

    yield term(
        "coupling_compliance",
        "A coupling that is softer at small torques",
        "-(J d2/dt2 + K p) dc T/(1 + |T/T1|)",
        amount("more", "rad/(N m)", 5e-3),
        _yielding(side, lambda torque, stiffens, _: torque / (1.0 + np.abs(torque / stiffens))),
        source=sources.BALANCE,
        shape=Quantity("stiffens", "N m", (0.1, 6.0)),
        mimicked_by=(f"compliance_{side}",),
        mixes=True,
        variant="progressive",
        spreads=True,
        component=coupling,
        shaft=side,
    )

    yield term(
        "coupling_compliance",
        "A softer coupling that is damped",
        "-(J d2/dt2 + K p) dc T/(1 + s tau)",
        amount("more", "rad/(N m)", 2e-2),
        _yielding(side, _damped),
        source=sources.BALANCE,
        shape=Quantity("settles", "s", (1e-3, 0.03)),
        mimicked_by=(f"compliance_{side}", coupling_loss_name(side)),
        variant="damped",
        spreads=True,
        component=coupling,
        shaft=side,
    )


def play_terms(side: str) -> Iterator[MotionTerm]:
    """Play in the coupling of a shaft."""
    yield term(
        "coupling_backlash",
        "Play in the coupling",
        "-(J s2 + K p) b/2 tanh(T/Tp)",
        amount("play", "rad", 0.2),
        _yielding(side, lambda torque, passage, _: 0.5 * np.tanh(torque / passage)),
        source=sources.BALANCE,
        shape=Quantity("passage", "N m", (0.01, 2.0)),
        mimicked_by=(f"compliance_{side}",),
        spreads=True,
        mixes=True,
        follows=(LawCovariate.LOAD,),
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

    yield term(
        "coupling_backlash",
        "Play in the coupling that the rotor crosses freely",
        "-(J s2 + K p) b/2 z(t), z from one side to the other as the square of the time since the torque was gone",
        amount("play", "rad", 0.2),
        _yielding(side, _crossing),
        source=sources.BALANCE,
        shape=Quantity("contact", "N m", (0.01, 0.5)),
        mimicked_by=(f"compliance_{side}",),
        spreads=True,
        variant="crossed",
        within="soft sides",
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

    yield term(
        "coupling_backlash",
        "Play in the coupling that the rotor crosses freely, between sides that give way",
        "-(J s2 + K p) (b/2 z(t) + c/2 T/(|T| + 5 Tc)), z as of play between hard sides, Tc the torque of contact",
        (*amount("hard", "rad", 0.2), *amount("soft", "rad", 0.2)),
        _yielding(side, _crossing, _pressed),
        source=sources.BALANCE,
        shape=Quantity("contact", "N m", (0.01, 0.5)),
        mimicked_by=(f"compliance_{side}",),
        spreads=True,
        variant="soft sides",
        component=Component(f"{side}_coupling"),
        shaft=side,
    )

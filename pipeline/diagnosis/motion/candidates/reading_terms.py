"""Candidates in the torque transducer of a shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import Quantity
from pmg.pipeline.diagnosis.motion.candidates.terms import signed, stack, term
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component, LawCovariate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


MOVES_IN = 10.0
"""Time in which a zero that moves at one time does so [s]."""


def _drifting(course: Array) -> Array:
    """A zero that moves from where it stood at the start."""
    return stack(course, np.ones_like(course))


def _bent(torque: Array) -> Array:
    """A torque, and what bends a line through zero: alike to both sides, and to one more than to the other (n, 3)."""
    return stack(torque, torque * np.abs(torque), torque**2)


def scale_terms(side: str) -> Iterator[MotionTerm]:
    """What a transducer shows in proportion to a torque, its own or the other's, and where that proportion changes."""
    for identifier, size, title, whose, heard in (
        ("torque_gain_error", "gain", "Gain of the transducer", "", (1.0, 0.0)),
        ("torque_crosstalk", "crosstalk", "Crosstalk from the other transducer", ", T of the other", (0.0, 1.0)),
    ):

        def torque(view: RotorView, own: bool = not whose) -> Array:
            return view.shaft.torque if own else view.other.torque

        straight, bends = signed(size, unit="1", most=0.2), signed("curved", "sided", unit="1/(N m)", most=0.1)
        for sizes, law, equation, changes, variant in (
            (straight, lambda v, _, of=torque: stack(of(v)), "k T", "", ""),
            (
                (*straight, *bends),
                lambda v, _, of=torque: _bent(of(v)),
                "k1 T + k2 T |T| + k3 T2",
                " that changes with the torque",
                "curved",
            ),
            (
                signed(size, "difference", unit="1", most=0.2),
                lambda v, _, of=torque: stack(of(v), 0.5 * np.abs(of(v))),
                "k T + dk/2 |T|",
                " that differs between the senses of the torque",
                "by sense",
            ),
        ):
            yield term(
                identifier,
                title + changes,
                equation + whose,
                sizes,
                law,
                hears=lambda rate, _, heard=heard: heard,
                shown_held=bool(whose),
                source=sources.GUM,
                follows=(LawCovariate.LOAD,),
                component=Component(f"{side}_torque_transducer"),
                shaft=side,
                variant=variant,
            )


def zero_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer that does not show zero at rest."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "torque_zero_offset",
        "Zero error of the transducer",
        "T0",
        signed("offset", unit="N m"),
        lambda v, _: stack(np.ones_like(v.speed)),
        source=sources.GUM,
        constants=(f"zero_{side}",),
        component=transducer,
        shaft=side,
    )


def drift_terms(side: str) -> Iterator[MotionTerm]:
    """A transducer whose zero moves over the campaign."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "torque_zero_drift",
        "Zero of the transducer that moved at one time",
        "T0 H(t - t0) + T1",
        signed("step", "start", unit="N m", most=0.5),
        lambda v, when: _drifting(0.5 + 0.5 * np.tanh((v.campaign_time - when * v.history.length) / MOVES_IN)),
        source=sources.GUM,
        shape=Quantity("when", "1", (0.1, 0.95)),
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
        variant="step",
    )

    yield term(
        "torque_zero_drift",
        "Zero of the transducer that drifts steadily",
        "T0 t + T1",
        (*signed("drift", unit="N m/s"), *signed("start", unit="N m")),
        lambda v, _: _drifting(v.campaign_time),
        source=sources.GUM,
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
        variant="steady",
    )

    yield term(
        "torque_zero_drift",
        "Zero of the transducer that drifts over the campaign",
        "T0 (1 - exp(-t/tau)) + T1",
        signed("drift", "start", unit="N m", most=0.5),
        lambda v, settles: _drifting(1.0 - np.exp(-v.campaign_time / settles)),
        source=sources.GUM,
        shape=Quantity("settles", "s", (60.0, 5000.0)),
        mimicked_by=(f"zero_{side}",),
        holds=("torque_zero_offset",),
        shown_at_rest=True,
        follows=(LawCovariate.TIME,),
        component=transducer,
        shaft=side,
    )

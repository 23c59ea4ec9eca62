"""Candidates in the torque transducer of a shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.term import Quantity
from pmg.pipeline.diagnosis.motion.terms import amount, signed, stack, term
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


def _later(view: RotorView, delay: float) -> Array:
    """A torque less itself that much later, by its values."""
    time = view.state.stretch.run.time
    return view.shaft.torque - np.interp(time + delay, time, view.shaft.torque)


def reading_terms(side: str) -> Iterator[MotionTerm]:
    """What a transducer shows beyond the torque of its coupling."""
    transducer = Component(f"{side}_torque_transducer")
    yield term(
        "torque_gain_error",
        "Gain of the transducer",
        "g T",
        signed("gain", unit="1", most=0.2),
        lambda v, _: stack(v.shaft.torque),
        source=sources.GUM,
        component=transducer,
        shaft=side,
    )

    yield term(
        "torque_crosstalk",
        "Crosstalk from the other transducer",
        "c T_other",
        signed("crosstalk", unit="1", most=0.2),
        lambda v, _: stack(v.other.torque),
        source=sources.GUM,
        component=transducer,
        shaft=side,
    )

    yield term(
        "transducer_bandwidth",
        "First-order lag of the transducer",
        "-tau dT/dt",
        amount("lag", "s", 0.1),
        lambda v, _: stack(-v.shaft.torque_rate - v.skew * v.shaft.torque_curvature),
        source=sources.BALANCE,
        component=transducer,
        shaft=side,
    )

    yield term(
        "channel_delay",
        "Delay between the channels of torque and angle",
        "T(t) - T(t + d)",
        (Quantity("part", "1", (0.5, 1.5)),),
        lambda v, delay: stack(_later(v, delay)),
        source=sources.BALANCE,
        shape=Quantity("delay", "s", (1e-3, 0.05)),
        component=transducer,
        shaft=side,
    )

    yield term(
        "torque_zero_drift",
        "Zero of the transducer that drifts over the campaign",
        "T0 (1 - exp(-t/tau))",
        signed("drift", unit="N m", most=0.5),
        lambda v, settles: stack(1.0 - np.exp(-v.campaign_time / settles)),
        source=sources.GUM,
        shape=Quantity("settles", "s", (60.0, 5000.0)),
        component=transducer,
        shaft=side,
    )

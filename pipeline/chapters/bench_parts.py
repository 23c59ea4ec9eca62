"""The bench as a chain of parts from the sun motor to the ring motor, with what a diagnosis points to marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pmg.pipeline.report.action_sheet import MachinePart
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

CHAIN = (
    (Component.SUN_MOTOR, "sun", "motor"),
    (Component.SUN_ENCODER, "sun", "encoder"),
    (Component.SUN_TORQUE_TRANSDUCER, "sun", "torque transducer"),
    (Component.SUN_COUPLING, "sun", "coupling"),
    (Component.SUN_BEARINGS, "sun", "bearings"),
    (Component.MAGNETIC_GEAR, "", "magnetic gear"),
    (Component.RELATIVE_BEARING, "", "relative bearing"),
    (Component.RING_BEARINGS, "ring", "bearings"),
    (Component.RING_COUPLING, "ring", "coupling"),
    (Component.RING_TORQUE_TRANSDUCER, "ring", "torque transducer"),
    (Component.RING_ENCODER, "ring", "encoder"),
    (Component.RING_MOTOR, "ring", "motor"),
)
"""Components in the order of the power flow, with their shaft and name."""

ON_THE_OTHER = {"sun": "ring", "ring": "sun"}


def bench_parts(document: Mapping[str, Any]) -> tuple[MachinePart, ...]:
    """The parts of the bench, those that a diagnosis names marked; `document` is its ``diagnosis.json``.

    A cause on a shaft that cannot be told marks both; where no cause is named, the place of the difference is marked.
    """
    named = {Component(row["component"]) for row in document["mechanisms"]}
    either = {_opposite(Component(row["component"])) for row in document["mechanisms"] if row["shaft"] == "either"}
    both = {_opposite(Component(row["component"])) for row in document["mechanisms"] if row["shaft"] == "both"}
    places = {Component(row["component"]) for row in document["locations"][:1] if row["component"]}
    sure: Literal["cause", "possible"] = "cause" if document["verdict"] == "named" and not either else "possible"

    def mark(component: Component) -> Literal["cause", "possible", "seen", ""]:
        if component in named | either | both:
            return sure
        return "seen" if not named and component in places else ""

    return tuple(MachinePart(name, group, mark(component)) for component, group, name in CHAIN)


def _opposite(component: Component) -> Component:
    """The same part on the other shaft; itself where there is one only."""
    shaft, _, part = component.partition("_")
    other = ON_THE_OTHER.get(shaft)
    return component if other is None else Component(f"{other}_{part}")

"""The bench as a chain of parts from the sun motor to the ring motor, with what a diagnosis points to marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.report.action_sheet import MachinePart
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

SHEET = "`pmg next --store STORE --out DIR`"
"""Command that writes the sheet of the next test."""

UNSETTLED = "The recordings contradict themselves (see the warning): until that is settled, this verdict may not hold."
"""What is said of a verdict while the recordings of the campaign contradict each other."""

UNSETTLED_COST = "What is contradicted goes into every number of this report."
"""What such a contradiction costs where nothing else is wrong."""

GROUNDS = "diagnosis"
"""Section of a report that holds the grounds of its verdict."""

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


LOOK = "Look for the cause"
ASKS = {
    Verdict.CONSISTENT: "Check the warnings",
    Verdict.AMBIGUOUS: "Test again",
    Verdict.CONFOUNDED: "Complete the test",
    Verdict.NOT_IN_LIBRARY: LOOK,
}
"""What a verdict asks for that names no one cause, where not all is well."""


def asked_of(verdict: Verdict, *, repair: bool = False, test: bool = True) -> str:
    """What a verdict asks for where not all is well.

    Parameters
    ----------
    verdict : Verdict
        The verdict.
    repair : bool
        Whether something can be mended on the bench.
    test : bool
        Whether a test is known that would tell several causes apart.
    """
    asks = ASKS.get(verdict, "Act on the bench" if repair else "Use the extended model")
    return asks if test or asks != ASKS[Verdict.AMBIGUOUS] else LOOK


OPEN = {
    Verdict.AMBIGUOUS: "which cause makes it stays open",
    Verdict.NOT_IN_LIBRARY: "what makes it stays open",
}
"""What a verdict leaves open of a difference that there is."""


def surely_differs(verdict: Verdict, p_value: float) -> str:
    """How sure it is that there is a difference, where what makes it is open; empty where it is not."""
    if verdict not in OPEN:
        return ""
    return f"Chance makes such a difference in at most {100.0 * p_value:.1g}% of campaigns; {OPEN[verdict]}."


def bench_parts(
    causes: Iterable[tuple[Component, str]], *, sure: bool, places: Iterable[Component] = (), signal: str = ""
) -> tuple[MachinePart, ...]:
    """The parts of the bench, those that a diagnosis names marked.

    Parameters
    ----------
    causes : iterable of (Component, str)
        Where each cause sits, and its shaft: ``sun``, ``ring``, ``both``, or ``either`` where that cannot be told.
    sure : bool
        Whether they are named, not merely possible.
    places : iterable of Component
        Where the difference may sit, marked where there is no cause.
    signal : str
        Reading that shows the difference, such as ``torque_ring``: its transducer is marked where the place is not
        known either.
    """
    known, where = list(causes), tuple(places)
    certain = {component for component, shaft in known if sure and shaft != "either"}
    certain |= {_opposite(component) for component, shaft in known if sure and shaft == "both"}
    possible = {component for component, _ in known}
    possible |= {_opposite(component) for component, shaft in known if shaft in ("both", "either")}

    reading = signal.replace("torque_", "") + "_torque_transducer"

    def mark(component: Component) -> Literal["cause", "either", "possible", "inspect", "seen", "read", ""]:
        if component in possible:
            return "cause" if component in certain else "either" if sure else "possible"
        if known:
            return ""
        if component in where:
            return "seen" if len(where) == 1 else "inspect"
        return "read" if not where and component == reading else ""

    return tuple(MachinePart(name, group, mark(component)) for component, group, name in CHAIN)


def part_words(component: Component) -> str:
    """A part of the bench in words, such as ``sun torque transducer``."""
    return next(f"{group} {name}".strip() for each, group, name in CHAIN if each is component)


def parts_of(document: Mapping[str, Any]) -> tuple[MachinePart, ...]:
    """The parts of the bench as a ``diagnosis.json`` marks them."""
    causes = ((Component(row["component"]), row["shaft"]) for row in document["mechanisms"])
    seen, signal = next(((row["component"], row["signal"]) for row in document["locations"]), (None, ""))
    places = () if seen is None else (Component(seen),)
    return bench_parts(causes, sure=document["verdict"] == "named", places=places, signal=signal)


def _opposite(component: Component) -> Component:
    """The same part on the other shaft; itself where there is one only."""
    shaft, _, part = component.partition("_")
    other = ON_THE_OTHER.get(shaft)
    return component if other is None else Component(f"{other}_{part}")

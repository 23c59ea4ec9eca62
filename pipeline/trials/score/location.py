"""Whether a diagnosis points to the place where an effect sits: rotor, coupling, gear, transducer, encoder or motor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

PLACES = {
    "bearings": "rotor",
    "rotor": "rotor",
    "bearing": "rotor",
    "both": "rotor",
    "coupling": "coupling",
    "gear": "gear",
    "transducer": "transducer",
    "encoder": "encoder",
    "motor": "motor",
}
"""Places by the last word of a component; ``both`` are the bearings of both shafts."""
SILENT = ("consistent", "confounded")
"""Verdicts that claim no mismatch; every other one is an alarm."""


def place_of(component: str) -> str:
    """The place that a component is part of."""
    return PLACES[component.rsplit("_", 1)[-1]]


def located(truth: Mapping[str, Any], document: Mapping[str, Any] | None) -> bool | None:
    """Whether the first place told is that of a single effect, on its shaft; None where there is no single effect.

    The first place is that of the cause that is named, or that leads a set; where none is, of the clearest difference.
    A place that is told without its shaft counts. A mismatch that is not claimed has no place, nor has one that is
    claimed without any.
    """
    if document is None or len(truth["effects"]) != 1 or "component" not in truth["effects"][0]:
        return None
    true = str(truth["effects"][0]["component"])
    if document["verdict"] in SILENT:
        return False
    rows = document["mechanisms"] if document["verdict"] == "named" else document["mechanisms"][:1]
    places = rows or document.get("locations", ())[:1]
    return bool(places) and all(_same(row, true) for row in places)


def _same(row: Mapping[str, Any], true: str) -> bool:
    """Whether a mechanism or a location has the place of a component, and its shaft where it tells one."""
    told = row.get("component")
    if told is None or place_of(told) != place_of(true):
        return False
    sides = {name for name in ("sun", "ring") if true.startswith(name)}
    return row.get("shaft") == "either" or not sides or any(told.startswith(side) for side in sides)

"""Checks by hand that tell causes apart where no further recording of the bench would."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.sim.shafts import SIDES, other_side

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.found_set import Naming

CHECKS = {
    "torque_gain_error": "load the {shaft} transducer by a lever and known weights; only a gain error shows there",
    "torque_crosstalk": "load the {other} shaft by a lever, the {shaft} shaft free; only crosstalk moves its reading",
    "torque_zero_offset": "uncouple the {shaft} transducer and read it; only a zero error shows there",
    "torque_zero_drift": "read the zero of the {shaft} transducer again later; only a drift moves it",
    "coupling_backlash": "turn the {shaft} rotor to and fro by hand, its motor locked; only play lets it",
    "coupling_compliance": "load the {shaft} coupling by a lever and read its twist; only a soft one gives more",
    "coupling_misalignment": "hold a dial gauge to the {shaft} coupling; only a misaligned one moves it",
    "encoder_eccentricity": "hold a dial gauge to the seat of the {shaft} encoder; only an eccentric one moves it",
    "rotor_inertia": "swing the {shaft} rotor on two threads, or weigh its parts; only another inertia shows there",
    "transducer_bandwidth": "look up the low-pass of the {shaft} torque amplifier; only a lag is explained by it",
}
"""What shows a mechanism at standstill, or outside the bench, and what no other cause would do there; the most
decisive first."""


BY_HAND_MIN = 20.0
"""Time that such a check is taken to need [min]."""


def nothing_yet(naming: Naming[Any, Any] | None, *, test_tells: bool) -> str:
    """What to do on the bench while several causes are open: nothing, and a check by hand where no test would tell.

    Parameters
    ----------
    naming : Naming, optional
        The causes.
    test_tells : bool
        Whether a test is known that tells them apart, more likely than not.
    """
    if test_tells:
        return "Repair nothing yet: the next test tells."
    check, _ = check_by_hand(naming)
    return f"Repair nothing yet. To tell by hand: {check}." if check else "Repair nothing yet."


def check_by_hand(naming: Naming[Any, Any] | None) -> tuple[str, str]:
    """A check that tells some of the possible causes from the others, and the one that it shows; empty without."""
    sets = () if naming is None else (naming.best.fits, *(rival.fits for rival in naming.rivals))
    everywhere = set.intersection(*({fit.identifier for fit in fits} for fits in sets)) if sets else set()
    places = {fit.identifier: fit.place for fits in reversed(sets) for fit in fits}
    for name, check in CHECKS.items():
        if name not in everywhere and places.get(name) in SIDES:
            return check.format(shaft=places[name], other=other_side(places[name])), name
    return "", ""

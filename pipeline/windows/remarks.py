"""What is told of a window that was accepted all the same."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.windows.steadiness import speed_off, speed_unsettled, torque_unsettled
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.windows.limits import Steadiness
    from pmg.pipeline.windows.steadiness import WindowEvidence

REMARK = "remark"
"""Start of what is told of an accepted window."""
NEAR = 0.5
"""Part of a limit beyond which a window is near it."""


def near_limits(window: WindowEvidence, limits: Steadiness) -> tuple[str, ...]:
    """What speaks against an accepted window by `NEAR` of the limits of speed and torque."""
    part = replace(
        limits,
        speed_change=NEAR * limits.speed_change,
        speed_change_relative=NEAR * limits.speed_change_relative,
        speed_offset=NEAR * limits.speed_offset,
        speed_offset_relative=NEAR * limits.speed_offset_relative,
        torque_drift=NEAR * limits.torque_drift,
    )
    found = (check(window, part) for check in (speed_unsettled, speed_off, torque_unsettled))
    return tuple(f"{REMARK}: half the limits would reject it: {reason}" for reason in found if reason is not None)


def window_remarks(window: Mapping[str, Any]) -> tuple[str, ...]:
    """Reasons of a window as the store holds it; of an accepted one also that a torque's noise may be slow."""
    reasons = tuple(map(str, window["reasons"]))
    if not window["accepted"]:
        return reasons
    uneven = [side for side in SIDES if window["means"][side].get("correlated")]
    return reasons + tuple(
        f"{REMARK}: the noise of the torque of the {side} may not be flat at the lowest frequencies of the window; "
        "what goes on below them is not seen"
        for side in uneven
    )

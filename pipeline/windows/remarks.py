"""Remarks on windows that were accepted all the same."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.windows.steadiness import speed_off, speed_unsettled, torque_unsettled

if TYPE_CHECKING:
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.pipeline.windows.steadiness import WindowEvidence

REMARK = "remark"
"""Start of what is stated of an accepted window."""
NEAR = 0.5
"""Part of a limit beyond which a window is near it."""


def near_limits(window: WindowEvidence, limits: Steadiness) -> tuple[str, ...]:
    """Remarks on an accepted window within `NEAR` of the limits of speed and torque."""
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

"""The limits of the motors' drives over a run: which was reached, by which motor, and when."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.sim.dynamics.trace import Trace


LISTED = 4
"""Stretches of a run that are listed."""


class DriveLimit(StrEnum):
    """What a drive gives no more of."""

    VOLTAGE = "bus voltage"
    CURRENT = "peak current"


@dataclass(frozen=True)
class LimitReached:
    """A limit that held a motor back.

    Parameters
    ----------
    side : str
        ``sun`` or ``ring``: whose motor.
    limit : DriveLimit
        Which limit.
    value : float
        Its size [V or A].
    stretches : tuple of (first, last)
        Instants of the trace between which it did without a break [s].
    """

    side: str
    limit: DriveLimit
    value: float
    stretches: tuple[tuple[float, float], ...]

    @property
    def words(self) -> str:
        """The limit, its motor and when, in words."""
        unit = "V" if self.limit is DriveLimit.VOLTAGE else "A"
        when = [
            f"at {first:.4g} s" if first == last else f"from {first:.4g} to {last:.4g} s"
            for first, last in self.stretches[:LISTED]
        ]
        if len(self.stretches) > LISTED:
            when.append(f"{len(self.stretches) - LISTED} times more")
        return f"{self.side} motor at its {self.limit} of {self.value:g} {unit}: {', '.join(when)}"


def limits_reached(trace: Trace) -> tuple[LimitReached, ...]:
    """Limits that held a motor back at instants of a run; none where the drives have no limits.

    Notes
    -----
    At each instant of the trace the voltage that the loop asks for is compared with the one that the drive gives.
    Where they differ, the bus has the last word: it is the limit where the voltage given is that of the bus, the
    current elsewhere. What happens between two instants is not seen.
    """
    train = trace.drivetrain
    q = train.constants
    if not q.limited:
        return ()
    given, asked = (of.motion(trace.state, trace.asked) for of in (train, train.unlimited))
    found = []
    for side in SIDES:
        voltage, wanted = (np.asarray(getattr(m, side).voltage) for m in (given, asked))
        held = voltage != wanted
        at_bus = held & (np.abs(voltage) >= q.U_bus)
        for limit, size, rows in (
            (DriveLimit.VOLTAGE, q.U_bus, at_bus),
            (DriveLimit.CURRENT, q.i_peak, held & ~at_bus),
        ):
            places = np.flatnonzero(np.broadcast_to(rows, trace.time.shape))
            if len(places):
                runs = np.split(trace.time[places], np.flatnonzero(np.diff(places) > 1) + 1)
                stretches = tuple((float(run[0]), float(run[-1])) for run in runs)
                found.append(LimitReached(side, limit, float(size), stretches))
    return tuple(found)

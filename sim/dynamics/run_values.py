"""Inputs and outputs of a run of the fast solver: named values that compiled code takes and makes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pmg.sim.signals import Array

DONE, STOPPED, NO_STEP, TOO_MANY = 0, 1, -1, -2
"""Ends of a run: at its end, at a slipped pole, without a step that converges, after too many steps."""


class Settings(NamedTuple):
    """Settings of the integration of a run.

    `rtol` is the relative tolerance, the absolute one is this times `scales` (20,), the usual size of each state;
    `locked` the rate of the phase below which the gear counts as locked [rad/s]; `stop` says whether to end at the
    first slipped pole; after `most` steps, accepted or not, the run is given up.
    """

    rtol: float
    scales: Array
    locked: float
    stop: bool
    most: int


class Well(NamedTuple):
    """Where a pole slips: half a period from `centre` [rad] of the state `phase`, which is -1 where nothing can."""

    phase: int
    centre: float


class Room(NamedTuple):
    """Arrays that a run fills.

    `states` (m, 20) at the wanted instants; `energy` (k,), zeros to which the sums over time of the powers are
    added, empty when not wanted; `slips` (q,), the times of slipped poles; `entries` of the Jacobian J at
    the last step and `factors` of d I - J.
    """

    states: Array
    energy: Array
    slips: Array
    entries: Array
    factors: Array


class Ended(NamedTuple):
    """End of a run.

    `code` is one of the codes above; then the numbers of steps, rejected steps, instants reported and slipped poles;
    `locked_at` is the time from which it stayed locked (NaN if it did not), `time` the time reached [s].
    """

    code: int
    steps: int
    rejected: int
    reported: int
    slipped: int
    locked_at: float
    time: float


class Stride(NamedTuple):
    """Begin and length of a step [s]."""

    begin: float
    length: float


class Slips(NamedTuple):
    """Poles slipped so far, and the share of the step at which the run halts, or 1."""

    slipped: int
    share: float
    halted: bool


class Lock(NamedTuple):
    """Time from which the gear stayed locked (NaN where it is not), and the rate of the phase last looked at."""

    since: float
    rate: float

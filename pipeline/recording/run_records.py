"""Facts of a run and of its windows, as values: set-points, names, start."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from datetime import datetime

    from pmg.sim.grid import Configuration


class Manoeuvre(StrEnum):
    """What a run does; the words of the key ``manoeuvre``."""

    STEADY = "steady"
    RAMP = "ramp"
    COAST = "coast"
    STEPS = "steps"
    SWEEP = "sweep"
    DITHER = "dither"
    ZERO = "zero"

    @property
    def moves(self) -> bool:
        """Whether its run has no steady window."""
        return self not in (Manoeuvre.STEADY, Manoeuvre.ZERO)

    @property
    def phase(self) -> str:
        """Phase of its test steps."""
        return "MEASURE" if self is Manoeuvre.STEADY else self.name


@dataclass(frozen=True)
class Setpoints:
    """Set-points of a run; None where the recording does not state them.

    Parameters
    ----------
    speed_sun, speed_ring : float or None
        Speeds [rad/s].
    torque_ring : float or None
        Torque of the ring motor [N m].
    """

    speed_sun: float | None = None
    speed_ring: float | None = None
    torque_ring: float | None = None


NO_SETPOINTS = Setpoints()


@dataclass(frozen=True)
class RunRecord:
    """The run of a source; of one that is not usable what is known of it.

    Parameters
    ----------
    campaign, point : str or None
        Names; the point is None for a sequence.
    configuration, drive : str or None
        ``neutral``, ``engaged`` or ``zero``, and the driving side.
    gear : int or None
        1 or 2.
    started_at : str or None
        Start, ISO 8601.
    note : str or None
        Free text.
    setpoints : Setpoints
        Set-points of the whole run; kept of a source that is not usable, whose windows cannot say them.
    manoeuvre : str or None
        What a run in motion does; None of a steady one.
    """

    campaign: str | None = None
    point: str | None = None
    configuration: str | None = None
    gear: int | None = None
    drive: str | None = None
    started_at: str | None = None
    note: str | None = None
    setpoints: Setpoints = NO_SETPOINTS
    manoeuvre: str | None = None


@dataclass(frozen=True)
class WindowRecord:
    """Test point, samples and verdict of a window.

    Parameters
    ----------
    point : str
        Test point.
    configuration : Configuration
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    drive : str
        Side that drives when engaged.
    first_sample, stop_sample : int
        Sample indices, `stop_sample` left out.
    setpoints : Setpoints
        What was asked for.
    accepted : bool
        Whether every check was met.
    reasons : tuple of str
        Why not, each with its numbers; of an accepted window what the reader should know all the same.
    rest_sun, rest_ring : bool
        Shaft held at rest.
    """

    point: str
    configuration: Configuration
    gear: int
    drive: str
    first_sample: int
    stop_sample: int
    setpoints: Setpoints
    accepted: bool
    reasons: tuple[str, ...]
    rest_sun: bool
    rest_ring: bool


@dataclass(frozen=True)
class RunInfo:
    """The run as its recorder describes it.

    Parameters
    ----------
    campaign : str
        Name of the campaign.
    point : str or None
        Test point; None for a sequence, whose steps name the points.
    configuration : Configuration
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    drive : str
        Side that drives when engaged.
    started_at : datetime
        Start [UTC].
    setpoints : Setpoints
        Set-points of the whole run.
    note : str
        Free text; empty when there is none.
    manoeuvre : Manoeuvre
        What the run does.
    """

    campaign: str
    point: str | None
    configuration: Configuration
    gear: int
    drive: str
    started_at: datetime
    setpoints: Setpoints
    note: str
    manoeuvre: Manoeuvre = Manoeuvre.STEADY

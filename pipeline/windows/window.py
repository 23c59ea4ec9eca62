"""A window: samples that were meant as one test point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from datetime import datetime

    from pmg.pipeline.recording.run import Setpoints
    from pmg.sim.grid import Configuration


@dataclass(frozen=True)
class Window:
    """A stretch of samples that was meant as one test point.

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
    started_at : datetime
        Time of the first sample [UTC].
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
    started_at: datetime
    first_sample: int
    stop_sample: int
    setpoints: Setpoints
    accepted: bool
    reasons: tuple[str, ...]
    rest_sun: bool
    rest_ring: bool

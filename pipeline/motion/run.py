"""A run in motion: ramps, coast-downs, steps, sweeps and dithers, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from datetime import datetime

    from pmg.pipeline.recording.run_records import Manoeuvre
    from pmg.pipeline.store.moving_record import Phase
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class MovingRun:
    """One run of a campaign, sample by sample, all arrays of length n.

    Parameters
    ----------
    file, point : str
        Name of its file; test point.
    configuration : Configuration
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    drive : str
        Side that drives when engaged.
    manoeuvre : Manoeuvre
        What it does.
    started_at : datetime
        Time of the first sample [UTC].
    rate : float
        Sample rate [Hz].
    torque : PerShaft of (n,) array
        Torque in the coupling of each shaft, positive in the positive direction of rotation [N m]; NaN where it is not
        known.
    angle : PerShaft of (n,) array
        Angle of each motor, as counted [rad]; NaN where it is not known.
    count : PerShaft of float
        Angle of one encoder count [rad].
    turns : PerShaft of bool
        Whether the shaft turned; one that does not is held, or at rest in a zero check.
    phases : tuple of Phase
        In order; samples count from the first of the run.
    """

    file: str
    point: str
    configuration: Configuration
    gear: int
    drive: str
    manoeuvre: Manoeuvre
    started_at: datetime
    rate: float
    torque: PerShaft[Array]
    angle: PerShaft[Array]
    count: PerShaft[float]
    turns: PerShaft[bool]
    phases: tuple[Phase, ...] = ()

    @property
    def name(self) -> str:
        """File and test point: its own in a campaign."""
        return f"{self.file} {self.point}"

    @property
    def coupled(self) -> bool:
        """Whether the magnetic gear couples the shafts."""
        return self.configuration is Configuration.ENGAGED

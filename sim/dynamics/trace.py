"""A run of the bench: states, set torques and energies over time, and what happened on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.power import Powers, powers
from pmg.sim.dynamics.state import STATES, SetTorques

if TYPE_CHECKING:
    from pmg.sim.dynamics.account import Account
    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.errors import BenchError
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Trace:
    """A run of the bench.

    Parameters
    ----------
    drivetrain : Drivetrain
        What was run.
    time : (n,) array
        Instants [s].
    state : (18, n) array
        The states, in the order of `STATES`.
    asked : SetTorques
        Set torques [N m] and their rates [N m/s] at those instants.
    locked_at : float
        Time from which the gear stays locked [s]; NaN if it has not locked by the end.
    slips : (m,) array
        Times at which a pole slipped [s].
    stopped : BenchError or None
        Why the run ended early, told in four parts; None when it went to its end.
    steps : int
        Steps of the integrator.
    energy : Account
        Energy that flowed through each element over the run [J].
    """

    drivetrain: Drivetrain
    time: Array
    state: Array
    asked: SetTorques
    locked_at: float
    slips: Array
    stopped: BenchError | None
    steps: int
    energy: Account

    def __getitem__(self, name: str) -> Array:
        """One state over time."""
        return np.asarray(self.state[STATES.index(name)])

    @property
    def torque_sun(self) -> Array:
        """Torque that the sun motor gives to its shaft [N m]."""
        return np.asarray(self.drivetrain.motion(self.state, self.asked).sun.torque_out)

    @property
    def torque_ring(self) -> Array:
        """Torque that the ring motor gives to its shaft [N m]."""
        return np.asarray(self.drivetrain.motion(self.state, self.asked).ring.torque_out)

    def powers(self) -> Powers:
        """Power of every element over time [W]."""
        return powers(self.drivetrain, self.state, self.asked)

"""A run of the bench: states, set torques and energies over time, and what happened on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.power import Powers, powers
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.errors import BenchError
from pmg.sim.grid import OperatingPoints
from pmg.sim.mechanisms.base import Torques
from pmg.sim.mechanisms.instruments import distorted
from pmg.sim.shafts import PerShaft

if TYPE_CHECKING:
    from pmg.sim.dynamics.account import Account
    from pmg.sim.dynamics.drivetrain import Drivetrain
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
    state : (20, n) array
        The states, in the order of `STATES`.
    asked : SetPoints
        What the motors are asked for at those instants, and its rates.
    locked_at : float
        Time from which the gear stays locked [s]; NaN if it has not locked by the end.
    slips : (m,) array
        Times at which a pole slipped [s].
    stopped : BenchError or None
        Why the run ended early, stated in four parts; None when it went to its end.
    steps : int
        Steps of the integrator.
    last : (20,) array
        State at the end of the run.
    account : Account or None
        Energy that flowed through each element over the run [J]; None where it was not summed.
    """

    drivetrain: Drivetrain
    time: Array
    state: Array
    asked: SetPoints
    locked_at: float
    slips: Array
    stopped: BenchError | None
    steps: int
    last: Array
    account: Account | None

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

    @property
    def torque(self) -> PerShaft[Array]:
        """Torques that both motors give to their shafts [N m]."""
        return PerShaft(self.torque_sun, self.torque_ring)

    @property
    def readings(self) -> Torques:
        """Readings of the two torque transducers [N m]: torques of the motors, with the faults of the readings."""
        true = Torques(self.torque_sun, self.torque_ring)
        faults = self.drivetrain.instruments
        if not faults:
            return true
        error_sun, error_ring = distorted(faults, self._points(), true)
        return Torques(true.sun + error_sun, true.ring + error_ring)

    def _points(self) -> OperatingPoints:
        """The instants as operating points, for what distorts a reading by its time."""
        n, gear = len(self.time), self.drivetrain.gear
        return OperatingPoints(
            name=np.arange(n).astype(np.str_),
            configuration=np.full(n, str(self.drivetrain.configuration)),
            gear=np.full(n, gear, dtype=np.int64),
            drive=np.full(n, "sun"),
            speed_sun=self["speed_sun"],
            speed_ring=self["speed_ring"],
            torque_ring=self.torque_ring,
            load_set=self.torque_ring,
            started_at=self.time,
            rest_sun=np.zeros(n, dtype=bool),
            rest_ring=np.zeros(n, dtype=bool),
        )

    @property
    def energy(self) -> Account:
        """Energy that flowed through each element over the run [J]."""
        if self.account is None:
            raise BenchError("energy of a run", "not summed", "a run that sums it", "Set energy when it is run.")
        return self.account

    def powers(self) -> Powers:
        """Power of every element over time [W]."""
        return powers(self.drivetrain, self.state, self.asked)

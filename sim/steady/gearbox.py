"""The gearbox at steady speed: ideal magnetic coupling plus the sum of contributions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.mechanisms.base import Instrument, RotorLaw, Torques, nothing
from pmg.sim.steady.baseline import baseline_mechanisms

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Gearbox:
    """The bench between the two torque transducers.

    Parameters
    ----------
    bench : BenchParameters
        Pole pairs of the stages.
    mechanisms : tuple of Mechanism
        What acts on the rotors in addition to the coupling.
    """

    bench: BenchParameters
    mechanisms: tuple[Mechanism, ...]

    @classmethod
    def calibrated(cls, bench: BenchParameters, model: LossModel) -> Gearbox:
        """The baseline with the numbers of a calibration."""
        return cls(bench, baseline_mechanisms(model, bench))

    @property
    def instruments(self) -> tuple[Instrument, ...]:
        """The faults among the mechanisms: they act on readings, not on rotors."""
        return tuple(mechanism for mechanism in self.mechanisms if isinstance(mechanism, Instrument))

    @property
    def same_at_any_load(self) -> bool:
        """Whether every contribution follows from the speeds alone."""
        return all(isinstance(mechanism, RotorLaw | Instrument) for mechanism in self.mechanisms)

    def ratio(self, at: OperatingPoints) -> Array:
        """Magnitude of w_sun / w_ring of each point's stage."""
        return self.bench.ratio(at.gear)

    def contributions(self, at: OperatingPoints) -> tuple[Torques, ...]:
        """Torques on the rotors, mechanism by mechanism."""
        return tuple(mechanism.torque(at) for mechanism in self.mechanisms)

    def torque(self, at: OperatingPoints) -> Torques:
        """Sum of all contributions."""
        total = Torques(nothing(at), nothing(at))
        for part in self.contributions(at):
            total = total + part
        return total

    def transmitted(self, at: OperatingPoints, drag: Torques | None = None) -> Array:
        r"""Magnetic torque that the sun rotor passes on when engaged [N m]; 0 otherwise.

        Parameters
        ----------
        at : OperatingPoints
            The n points.
        drag : Torques, optional
            Sum of all contributions there, where it is known already.

        Notes
        -----
        The coupling is ideal: with the carrier fixed and :math:`\omega_r = -\omega_s / i`, virtual power gives
        :math:`-M` on the sun rotor and :math:`-iM` on the ring rotor. The ring's balance
        :math:`T_r + \tau_r - iM = 0` then gives M.
        """
        drag = self.torque(at) if drag is None else drag
        return np.where(at.engaged, (at.torque_ring + drag.ring) / self.ratio(at), 0.0)

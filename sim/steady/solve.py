"""Steady states of the bench."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.grid import Grid
from pmg.sim.mechanisms.base import Torques
from pmg.sim.mechanisms.instruments import distorted

if TYPE_CHECKING:
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array
    from pmg.sim.steady.gearbox import Gearbox


def steady(gearbox: Gearbox, at: OperatingPoints, campaign: str = "") -> Grid:
    r"""Torques that hold the bench at the given speeds and, when engaged, the given ring torque.

    Parameters
    ----------
    gearbox : Gearbox
        The model.
    at : OperatingPoints
        Speeds [rad/s] and, where engaged, ring torque [N m]; elsewhere the ring torque is an outcome.
    campaign : str
        Name to carry on.

    Returns
    -------
    Grid
        Simulated torques. A shaft at rest feels no drag here: its real reading is a static reaction.
        Uncertainties are zero: those of the calibration are added where they are known.

    Notes
    -----
    Balance of each rotor at constant speed, with :math:`\tau` the sum of contributions and M the transmitted
    torque: :math:`T_s = M - \tau_s`; when engaged :math:`T_r` is given and :math:`M = (T_r + \tau_r)/i`, in
    neutral :math:`T_r = -\tau_r`. Holds for either direction of rotation and of power flow. (Thesis, section 6.1.1:
    the ring gets the measured torque, the sun torque is what keeps the speed.) Faults of the instruments come last:
    what is given is then a reading, from which the true ring torque follows, and what comes out are readings.
    """
    torques, zero = holding_torques(gearbox, at), np.zeros(len(at))
    return Grid(
        origin="simulated",
        campaign=campaign,
        points=at,
        torque_sun=torques.sun,
        torque_ring=torques.ring,
        within_sun=zero,
        within_ring=zero,
        u_sun=zero,
        u_ring=zero,
        common_sun=zero,
        common_ring=zero,
        accepted=np.ones(len(at), dtype=bool),
        reason=np.full(len(at), ""),
    )


def holding_torques(gearbox: Gearbox, at: OperatingPoints, drag: Torques | None = None) -> Torques:
    """The torques of `steady` alone (n,) [N m].

    Parameters
    ----------
    gearbox : Gearbox
        The model.
    at : OperatingPoints
        The n points.
    drag : Torques, optional
        Sum of all contributions there, where it is known already and the same at any load.
    """
    if drag is None and gearbox.same_at_any_load:
        drag = gearbox.torque(at)
    faults = gearbox.instruments
    if faults:
        at = replace(at, torque_ring=true_load(gearbox, at, drag))
    drag = gearbox.torque(at) if drag is None else drag
    torque_sun = gearbox.transmitted(at, drag) - drag.sun
    torque_ring = np.where(at.engaged, at.torque_ring, -drag.ring)
    if faults:
        error_sun, error_ring = distorted(faults, at, Torques(torque_sun, torque_ring))
        torque_sun, torque_ring = torque_sun + error_sun, torque_ring + error_ring
    return Torques(torque_sun, torque_ring)


_FAULT_STEPS = 8
"""Fixed-point steps from a distorted load to the true one at most; each gains two digits or more, as faults are
small."""


def true_load(gearbox: Gearbox, at: OperatingPoints, known: Torques | None = None) -> Array:
    """Ring torque [N m] whose reading is the one given, where engaged: what faults of the instruments hide.

    The sum of all contributions may be `known`, where it is the same at any load.
    """
    load = at.torque_ring
    for _ in range(_FAULT_STEPS):
        guess = replace(at, torque_ring=load)
        drag = gearbox.torque(guess) if known is None else known
        true = Torques(gearbox.transmitted(guess, drag) - drag.sun, load)
        before, hidden = load, distorted(gearbox.instruments, guess, true)[1]
        load = np.where(at.engaged, at.torque_ring - hidden, at.torque_ring)
        if np.array_equal(load, before):
            break
    return np.asarray(load)

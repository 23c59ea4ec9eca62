"""Steady states of the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.grid import Grid

if TYPE_CHECKING:
    from pmg.sim.gearbox import Gearbox
    from pmg.sim.grid import OperatingPoints


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
    the ring gets the measured torque, the sun torque is what keeps the speed.)
    """
    drag = gearbox.torque(at)
    zero = np.zeros(len(at))
    return Grid(
        origin="simulated",
        campaign=campaign,
        points=at,
        torque_sun=gearbox.transmitted(at) - drag.sun,
        torque_ring=np.where(at.engaged, at.torque_ring, -drag.ring),
        within_sun=zero,
        within_ring=zero,
        u_sun=zero,
        u_ring=zero,
        common_sun=zero,
        common_ring=zero,
        accepted=np.ones(len(at), dtype=bool),
        reason=np.full(len(at), ""),
    )

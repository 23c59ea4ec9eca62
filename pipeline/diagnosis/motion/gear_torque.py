"""Torque of the magnetic gear on a rotor in the baseline, by where the poles stand and how fast they pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.constants import MAP_WAVES, SLIP_PASSAGE, map_name

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.sim.signals import Array


def gear_columns(sheet: DataSheet, side: str, pole_angle: Array, slip: Array) -> dict[str, Array]:
    r"""Torque of the gear on the rotor of a side per unit of each constant that it is made of.

    Parameters
    ----------
    sheet : DataSheet
        What the constants are, and the pole pairs.
    side : str
        The rotor.
    pole_angle, slip : (n,) array
        Angle of the rotors' poles against each other, and its rate [rad, rad/s]; of any shape.

    Returns
    -------
    dict of (n,) array
        By constant.

    Notes
    -----
    :math:`p\,(A\sin\varphi + \sum_w A_w \sin w\varphi + c\,\dot\varphi) + o\tanh(\dot\varphi/s)`, with the pull-out
    torque A, the waves of the map, the slip damping c, and what it is off at small slips on each side by itself.
    """
    poles = sheet.poles[side]
    columns = {"pull_out": poles * np.sin(pole_angle), "slip_damping": poles * slip}
    columns |= {map_name(wave): poles * np.sin(wave * pole_angle) for wave in MAP_WAVES}
    return columns | {f"slip_damping_off_{side}": np.tanh(slip / SLIP_PASSAGE)}

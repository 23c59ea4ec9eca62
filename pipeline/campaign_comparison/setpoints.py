"""Changes of quantities between two sets of speeds and loads, by the calibrated models."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.calibration import start_model
from pmg.pipeline.fit.losses import QUANTITIES, power_balance
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array

Changes = dict[str, "Array"]


def carried(
    sides: tuple[CampaignSide, CampaignSide], start: OperatingPoints, end: OperatingPoints
) -> tuple[Changes, Changes]:
    r"""Change of each quantity from one set of n points to another, and one standard uncertainty of it, SI.

    Parameters
    ----------
    sides : tuple of two CampaignSide
        Campaigns whose models are asked.
    start, end : OperatingPoints
        The n points of both; speeds and, engaged, ring torques as they were.

    Returns
    -------
    tuple of two dicts of str to (n,) array
        Torques at every point, powers and efficiencies NaN where the gear is not engaged. Both empty where no
        campaign has loss curves.

    Notes
    -----
    The mean of what the models of both campaigns say; half of how far they disagree is taken as the half-width of a
    rectangular distribution (GUM 4.3.7), one error for all points, with its sign. Where only one campaign has a model,
    half of the change is.
    """
    found = [changes for side in sides if (changes := _change(side, start, end))]
    if not found:
        return {}, {}
    if len(found) == 1:
        return found[0], {name: change / math.sqrt(12.0) for name, change in found[0].items()}
    one, other = found
    names = [name for name in one if name in other]
    return (
        {name: 0.5 * (one[name] + other[name]) for name in names},
        {name: (one[name] - other[name]) / math.sqrt(12.0) for name in names},
    )


def _change(side: CampaignSide, start: OperatingPoints, end: OperatingPoints) -> Changes:
    analysis = side.analysis
    if analysis.fits is None:
        return {}
    model = start_model(analysis.fits) if analysis.calibration is None else analysis.calibration.model
    gearbox = Gearbox.calibrated(side.bench, model)
    simulated = [steady(gearbox, at) for at in (start, end)]
    changes = {
        name: getattr(simulated[1], name) - getattr(simulated[0], name) for name in ("torque_sun", "torque_ring")
    }
    engaged = start.engaged
    if engaged.any() and analysis.calibration is not None:
        n = int(engaged.sum())
        usable = [replace(grid[engaged], accepted=np.ones(n, dtype=bool)) for grid in simulated]
        before, after = (power_balance(grid, analysis.fits, model.correction).values for grid in usable)
        for signal in QUANTITIES:
            change = np.full(len(start), np.nan)
            change[engaged] = after[signal.name] - before[signal.name]
            changes[signal.name] = change
    return changes

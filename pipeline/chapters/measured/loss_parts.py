"""What the loss of each engaged point is made of: bearings 1 to 7 and the magnetic gear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import names_of
from pmg.pipeline.grid.levels import by_load, speed_levels
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording import numerals
from pmg.sim.mechanisms import (
    EddyDamping,
    ExcessDamping,
    HysteresisDamping,
    NeutralRemainder,
    RelativeBearing,
    RingBearings,
    SunBearings,
)
from pmg.sim.signals import LOSS_TOTAL, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.analysis.power_flow import Flow
    from pmg.sim.bench import BearingParameters
    from pmg.sim.signals import Array, Mask
    from pmg.sim.steady.gearbox import Gearbox

_OTHER = "other effects of the model"
_PARTS = (*(f"bearing {number}" for number in range(1, 8)), "magnetic gear", _OTHER)
_MEASURED = "measured total"
_COLOURS = dict(zip((*_PARTS, _MEASURED), (0, 2, 3, 4, 5, 6, 7, 1, 8, 9), strict=True))
_GEAR = (HysteresisDamping, EddyDamping, ExcessDamping, NeutralRemainder)


def _loss_parts(gearbox: Gearbox, flow: Flow) -> dict[str, Array]:
    """Loss of each bearing and of the gear [W] at the points of a flow, as the model has them.

    The neutral curves give the bearings of a shaft together; each bearing has its share by size (thesis, table 5.2).
    """
    at, share = flow.grid.points, gearbox.bench.bearings
    parts = {name: np.zeros(len(at)) for name in _PARTS}
    for mechanism, torques in zip(gearbox.mechanisms, gearbox.contributions(at), strict=True):
        loss = -torques.power(at)
        for name, part in _shares(mechanism, share).items():
            parts[name] += part * loss
    if not parts[_OTHER].any():
        del parts[_OTHER]
    return parts


def _shares(mechanism: object, share: BearingParameters) -> dict[str, float]:
    """Parts of a mechanism's loss by the name they are shown under."""
    if isinstance(mechanism, SunBearings):
        return {"bearing 1": share.share_sun_1 / share.sun, "bearing 2": share.share_sun_2 / share.sun}
    if isinstance(mechanism, RingBearings):
        ring = (share.share_ring_4, share.share_ring_5, share.share_ring_6, share.share_ring_7)
        return {f"bearing {number}": part / share.ring for number, part in enumerate(ring, 4)}
    if isinstance(mechanism, RelativeBearing):
        return {"bearing 3": 1.0}
    return {"magnetic gear" if isinstance(mechanism, _GEAR) else _OTHER: 1.0}


def loss_parts_figure(gearbox: Gearbox, flow: Flow) -> Figure:
    """Bars of the model's losses at each point, a panel for each load, and the measured total loss beside them.

    Parameters
    ----------
    gearbox : Gearbox
        The simulator.
    flow : Flow
        From measured torques.
    """
    at, parts = flow.grid.points, _loss_parts(gearbox, flow)
    panels = tuple(_panel(flow, parts, name, rows) for name, rows in by_load(at))
    total = np.sum(list(parts.values()), axis=0)
    most = int(np.argmax(total))
    largest = sorted(parts, key=lambda name: -parts[name][most])[:3]
    said = ", ".join(f"{name} {numerals.number(float(parts[name][most]), 1)} W" for name in largest)
    same = (
        " Each is the same at every load, as in the model it follows the speeds alone."
        if gearbox.same_at_any_load
        else ""
    )
    printed = " Figure 6.14 of the source, bearing by bearing." if flow.grid.origin == "published" else ""
    return Figure(
        "loss-parts",
        "What the losses are made of",
        f"Of {numerals.number(float(total[most]), 1)} W simulated at {at.name[most]}: {said}. Bearings 1 and 2 are the "
        f"sun's, 4 to 7 the ring's, 3 lies between the shafts; each has its share by size of what neutral tests "
        f"give.{same} Points: measured total loss, U = 2u.{printed}",
        panels,
        columns=2,
    )


def _panel(flow: Flow, parts: dict[str, Array], name: str, rows: Mask) -> Chart:
    at = flow.grid.points[rows]
    x = np.abs(speed_levels(at)[0])
    levels = np.unique(x)
    series = [
        Series(
            part, levels, np.array([watts[rows][x == level].mean() for level in levels]), None, "bars", _COLOURS[part]
        )
        for part, watts in parts.items()
    ]
    measured = (flow.chain.mechanical_in - flow.chain.mechanical_out)[rows]
    u = flow.spread.total({"mechanical_in": 1.0, "mechanical_out": -1.0})[rows]
    series.append(Series(_MEASURED, x, measured, u, "markers", _COLOURS[_MEASURED], points=names_of(at.name)))
    return Chart(SPEED_SUN.label, f"{LOSS_TOTAL.meaning} [W]", tuple(series), title=name)

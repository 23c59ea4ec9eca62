"""Tables on a model with the physics in: what it predicts unseen, and where the moving bench comes to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.model.apply_model import remark
from pmg.pipeline.report.document import Column, Measured, Table
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pmg.pipeline.model.apply_model import Carried
    from pmg.pipeline.model.extreme_steady_points import SteadyEnd
    from pmg.pipeline.report.table import Cell


def prediction_table(carried: Carried) -> Table:
    """The model as it came next to what this campaign's own fits make of it."""
    unit = RESIDUAL.display_unit
    rows: list[tuple[Cell, ...]] = [
        (p.kind, float(p.count), *(float(RESIDUAL.display(v)) for v in (p.noise, p.as_is, p.recalibrated, p.refitted)))
        for p in carried.predictions
    ]
    return Table(
        "prediction",
        "Prediction of a campaign not seen" if not carried.own else "The model at its own campaign",
        f"{remark(carried)} The model: {carried.model.description}. Errors are root mean squares.",
        (
            Column("readings", "Readings"),
            Column("count", "Number", "", digits=0),
            Column("noise", "Noise", unit, digits=2),
            Column("as_is", "Model as it came", unit, digits=2),
            Column("recalibrated", "Plain baseline, calibrated here", unit, digits=2),
            Column("refitted", "Model, fitted here", unit, digits=2),
        ),
        tuple(rows),
    )


def ends_table(ends: tuple[SteadyEnd, ...]) -> Table:
    """Steady ends of the moving bench without and with the mechanisms."""
    rows: list[tuple[Cell, ...]] = [
        (end.point, end.configuration, end.shaft, Measured(end.measured, end.u), end.before, end.after) for end in ends
    ]
    closer = sum(abs(end.after - end.measured) < abs(end.before - end.measured) for end in ends)
    return Table(
        "steady-ends",
        "The moving bench at some set-points",
        f"Torque at which the whole drivetrain stays, with motors and loops, with the baseline alone and with what was "
        f"left out: closer to the measurement at {closer} of {len(ends)} readings.",
        (
            Column("point", "Point"),
            Column("configuration", "Configuration"),
            Column("shaft", "Shaft"),
            Column("measured", "Measured", "N m", uncertain=True),
            Column("before", "Baseline alone", "N m", digits=4),
            Column("after", "With the mechanisms", "N m", digits=4),
        ),
        tuple(rows),
    )

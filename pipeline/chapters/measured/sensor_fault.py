"""Text of a chapter on losses where the diagnosis found a fault of a torque reading."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.report.document import Column, Table, Text, measured
from pmg.pipeline.wording import numerals
from pmg.sim import signals

if TYPE_CHECKING:
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.pipeline.model.sensor_fault_correction import CorrectedLosses
    from pmg.pipeline.report.table import Cell


MOVES = 0.1
"""Smallest change of a loss by a fault that is listed, as a part of the U of the loss."""


def sensor_fault_warning(found: tuple[CorrectedLosses, ...]) -> str:
    """The warning in a sentence."""
    of = "may have" if found[0].doubtful else "has"
    return f"Losses and efficiencies are as read, and a transducer {of} a fault: their uncertainty does not cover it."


def highest_loss(found: tuple[CorrectedLosses, ...], balance: PowerBalance | None) -> str:
    """The highest loss as read and without the fault, under each explanation that moves it; empty without a fault."""
    if not found or balance is None:
        return ""
    loss_name = signals.LOSS_TOTAL.name
    i = int(np.argmax(balance.values[loss_name]))
    u = float(balance.u(loss_name)[i])
    read = float(balance.values[loss_name][i])
    moved = [float(one.values[loss_name][i]) - read for one in found]
    others = [
        f"{_loss(read + off, 2.0 * float(np.hypot(u, one.spread[loss_name][i])))} without {one.description}"
        for one, off in zip(found, moved, strict=True)
        if not np.hypot(off, 2.0 * one.spread[loss_name][i]) < MOVES * 2.0 * u
    ]
    fault = "a possible fault would change" if found[0].doubtful else "the fault changes"
    change = "; ".join(others) or f"{fault} it by at most {max(map(abs, moved)):.1g} W"
    return f"Total loss at {balance.grid.points.name[i]} (U = 2u): {_loss(read, 2.0 * u)} as read; {change}."


def _loss(value: float, expanded: float) -> str:
    """A loss with its U, or without where it has none."""
    return f"{numerals.measured(value, expanded)} W" if np.isfinite(expanded) else f"{value:.1f} W (U unknown)"


def sensor_fault_items(found: tuple[CorrectedLosses, ...], balance: PowerBalance) -> tuple[Text | Table, ...]:
    """The warning, and the losses by load as read and without the fault, under each explanation that has one."""
    if not found:
        return ()
    at = balance.grid.points
    total, efficiency = signals.LOSS_TOTAL, signals.EFFICIENCY_TOTAL
    rows: list[tuple[Cell, ...]] = []
    for load, chosen in by_load(at):
        for signal in (total, efficiency):
            mean = balance.mean(signal.name, chosen)
            row: list[Cell] = [load, signal.meaning, signal.display_unit, measured(signal, mean.value, mean.u)]
            for one in found:
                # A fault moves all points alike: its part of the uncertainty does not average out.
                u = float(np.mean(one.spread[signal.name][chosen]))
                row.append(
                    measured(signal, float(np.mean(one.values[signal.name][chosen])), float(np.hypot(u, mean.u)))
                )
            rows.append(tuple(row))
    columns = [
        Column("load", "Load"),
        Column("quantity", "Quantity"),
        Column("unit", "Unit"),
        Column("as_read", "As read", "", uncertain=True),
        *(Column(f"without_{i}", f"Without {one.description}", "", uncertain=True) for i, one in enumerate(found, 1)),
    ]
    text = "as many explanations as these recordings leave open" if len(found) > 1 else "the explanation that was found"
    return (
        Text(sensor_fault_warning(found), kind="warning"),
        Text(highest_loss(found, balance), kind="finding"),
        Table(
            "losses-misread",
            "Losses with and without the fault",
            f"Means over the points of each load, as read and with the fault taken out of the readings: {text}. Only a "
            "calibration of the transducers, or exchanging the two, says which figure holds.",
            tuple(columns),
            tuple(rows),
        ),
    )

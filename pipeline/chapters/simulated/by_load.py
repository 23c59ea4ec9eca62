"""Measured against simulated losses and efficiencies, a panel for each load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import names_of, sun_speed_label
from pmg.pipeline.fit.losses import QUANTITIES, losses_and_efficiencies
from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording import numerals
from pmg.sim import signals
from pmg.sim.signals import SPEED_SUN
from pmg.sim.steady.power_chain import MotorConvention

if TYPE_CHECKING:
    from pmg.pipeline.analysis.power_flow import Flow
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.sim.signals import Array, Mask, Signal
    from pmg.sim.steady.power_chain import PowerChain

LOSSES = (signals.LOSS_TOTAL, signals.LOSS_BEARINGS, signals.LOSS_MAGNETIC)
"""Losses that are set side by side."""
EFFICIENCIES = (signals.EFFICIENCY_TOTAL, signals.EFFICIENCY_MAGNETIC, signals.EFFICIENCY_BEARINGS)
"""Efficiencies that are set side by side."""


def by_load_figures(balance: PowerBalance, flows: tuple[Flow, ...]) -> tuple[Figure, Figure]:
    """Losses, and efficiencies, of the engaged points by load: measured with U, simulated as lines.

    Parameters
    ----------
    balance : PowerBalance
        What was measured.
    flows : tuple of Flow
        As `power_flows` gives them; the one from simulated torques is what was simulated.
    """
    flow = next(f for f in flows if f.origin == "simulated" and f.convention is MotorConvention.CONSISTENT)
    row_of = {str(name): i for i, name in enumerate(flow.grid.points.name)}
    order = np.array([row_of[str(name)] for name in balance.grid.points.name])
    simulated = {name: values[order] for name, values in _quantities(flow.chain).items()}
    published = balance.grid.origin == "published"
    return (
        Figure(
            "losses-by-load",
            "Losses by load: measured against simulated",
            f"{_differences(balance, simulated, LOSSES)} Bearing loss is the same by construction where the neutral "
            "curves are; the magnetic loss is what is left of the total. Bars: U = 2u, with what all points share."
            + (" Figures 6.20 to 6.24 of the source." if published else ""),
            _panels(balance, simulated, LOSSES, "power [W]"),
            columns=2,
        ),
        Figure(
            "efficiencies-by-load",
            "Efficiencies by load: measured against simulated",
            f"{_differences(balance, simulated, EFFICIENCIES)} Bars: U = 2u, with what all points share."
            + (" Figures 6.25 to 6.29 of the source." if published else ""),
            _panels(balance, simulated, EFFICIENCIES, "efficiency [%]"),
            columns=2,
        ),
    )


def _quantities(chain: PowerChain) -> dict[str, Array]:
    """Powers, losses [W] and efficiencies of a chain by signal name, from its branches."""
    sun = chain.loss_sun_bearings + chain.loss_relative_sun
    ring = chain.loss_ring_bearings + chain.loss_relative_ring
    into, out = np.where(chain.drive_ring, (ring, sun), (sun, ring))
    values = losses_and_efficiencies(chain.mechanical_in, chain.mechanical_out, into, out)
    return {signal.name: row for signal, row in zip(QUANTITIES, values, strict=True)}


def _differences(balance: PowerBalance, simulated: dict[str, Array], of: tuple[Signal, ...]) -> str:
    """Root mean squares of measured minus simulated, in a sentence."""
    said = []
    for signal in of:
        difference = signal.display(balance.values[signal.name] - simulated[signal.name])
        unit = "points" if signal.display_unit == "%" else signal.display_unit
        rms = float(np.sqrt(np.nanmean(difference**2)))
        said.append(f"{signal.meaning} {numerals.number(rms, 2)} {unit}")
    return f"Root mean square of measured minus simulated: {', '.join(said)}."


def _panels(
    balance: PowerBalance, simulated: dict[str, Array], of: tuple[Signal, ...], label: str
) -> tuple[Chart, ...]:
    return tuple(_panel(balance, simulated, of, label, name, rows) for name, rows in by_load(balance.grid.points))


def _panel(
    balance: PowerBalance, simulated: dict[str, Array], of: tuple[Signal, ...], label: str, name: str, rows: Mask
) -> Chart:
    at = balance.grid.points[rows]
    order = np.argsort(np.abs(at.speed_sun), kind="stable")
    x, points = SPEED_SUN.display(np.abs(at.speed_sun))[order], names_of(at.name[order])
    ratio = float(np.median(np.abs(at.speed_sun / at.speed_ring)))
    read, lines = list[Series](), list[Series]()
    for i, signal in enumerate(of):
        y = signal.display(balance.values[signal.name][rows])[order]
        u = balance.u(signal.name)[rows][order] / signal.scale
        read.append(Series(signal.meaning, x, y, u, "markers", i, "measured", points))
        y = signal.display(simulated[signal.name][rows])[order]
        lines.append(Series(signal.meaning, x, y, None, "line", i, "simulated"))
    reference = (("", 100.0),) if of is EFFICIENCIES else (("", 0.0),)
    return Chart(sun_speed_label(ratio), label, (*read, *lines), reference, title=f"Load {name}")

"""Chapter on the source's own simulation: measured against printed simulated torques, over speed and over load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.report.document import Chart, Column, Figure, Section, Series, Table, Text
from pmg.pipeline.thesis_figures.printed_simulation import PATTERN_LEVEL, printed_simulation
from pmg.pipeline.thesis_figures.tables import LOADS
from pmg.pipeline.wording.probability import nominal_p_text
from pmg.sim import sources
from pmg.sim.signals import RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.thesis_figures.printed_simulation import PrintedSimulation
    from pmg.sim.grid import Grid


_MEANING = {
    (True, False): (
        "follows the speed and not the load",
        "So the curves or the damping are at fault, not what depends on load.",
    ),
    (False, True): ("follows the load and not the speed", "So what depends on load is at fault, not the curves."),
    (True, True): ("follows the speed and the load", "So more than the curves and the damping is at fault."),
    (False, False): ("follows neither speed nor load", "So neither curves, damping nor load are shown to be at fault."),
}
"""What the differences follow, and what that says, by whether speed and load take a part of them."""


def printed_simulation_sections(grid: Grid) -> tuple[Section, ...]:
    """The chapter for a campaign of published grids; none where they are not the thesis's."""
    found = printed_simulation(grid)
    if found is None:
        return ()
    return (
        Section(
            "printed-simulation",
            "Measured against the source's simulation",
            (Text(_finding(found), kind="finding"), _figure(found), _table(found)),
            (sources.THESIS.at("tables 6.2 and 6.3"), sources.THESIS.at("section 6.5")),
        ),
    )


def _finding(found: PrintedSimulation) -> str:
    of_speed, of_load = found.pattern()
    follows, at_fault = _MEANING[of_speed.p < PATTERN_LEVEL, of_load.p < PATTERN_LEVEL]
    return (
        f"What the source's simulation misses {follows}: speed takes {of_speed.share:.0%} of "
        f"the differences' sum of squares (F = {of_speed.f:.1f}, p {nominal_p_text(of_speed.p)}), load "
        f"{of_load.share:.0%} (F = {of_load.f:.1f}, p {nominal_p_text(of_load.p)}). The rest scatters by "
        f"{RESIDUAL.display(found.scatter):.1f} mN m; rounding of the measured torques makes "
        f"{RESIDUAL.display(found.u):.1f}. {at_fault} R² of the loss power is {found.r_squared:.4f}."
    )


def _figure(found: PrintedSimulation) -> Figure:
    speed = SPEED_RING.display(found.speed_ring)
    u = np.full(len(speed), found.u)
    series = [
        Series(f"{load:.2f} N m", speed, RESIDUAL.display(row), RESIDUAL.display(u), "markers", i)
        for i, (load, row) in enumerate(zip(LOADS, found.difference, strict=True))
    ]
    series.append(Series("mean", speed, RESIDUAL.display(found.difference.mean(axis=0)), None, "line", len(LOADS)))
    chart = Chart(
        SPEED_RING.label,
        "sun torque, measured − simulated in the source [mN m]",
        tuple(series),
        references=(("", 0.0),),
    )
    return Figure(
        "printed-simulation-difference",
        "Measured less printed simulated torque",
        "The total loss torque, referred to the sun, at the 48 engaged points: one curve for all loads. Bars: U = 2u "
        "of the rounding to 0.01 N m. Its pattern over speed is what the source's loss curves and damping leave out.",
        (chart,),
    )


def _table(found: PrintedSimulation) -> Table:
    difference, at = RESIDUAL.display(found.difference), found.sample.grid.points
    sun = SPEED_SUN.display(at.speed_sun[found.sample.rows[0]])
    ring = SPEED_RING.display(found.speed_ring)
    loads = tuple(Column(f"load_{load:.2f}", f"{load:.2f} N m", "mN m", digits=1) for load in LOADS)
    return Table(
        "printed-simulation-table",
        "Measured less printed simulated sun torque",
        f"By speed and load; each is rounded by up to {RESIDUAL.display(0.005):.0f} mN m.",
        (
            Column("sun", "Sun speed", "rpm", format=".0f"),
            Column("ring", "Ring speed", "rpm", format=".0f"),
            *loads,
            Column("mean", "Mean", "mN m", digits=1),
        ),
        tuple(
            (float(sun[j]), float(ring[j]), *map(float, difference[:, j]), float(difference[:, j].mean()))
            for j in range(len(sun))
        ),
    )

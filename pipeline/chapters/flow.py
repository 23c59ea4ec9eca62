"""Chapter on the power flow: the chain for every engaged point, and its drawing for the highest one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import by_speed
from pmg.pipeline.report.document import Column, Figure, PowerFlow, Section, Table, Text
from pmg.sim import sources
from pmg.sim.powerchain import MotorConvention, power_chain
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.report.table import Cell
    from pmg.sim.bench import BenchParameters
    from pmg.sim.gearbox import Gearbox
    from pmg.sim.grid import Grid
    from pmg.sim.powerchain import PowerChain

_COLUMNS = (
    ("electric_in", "electric in"),
    ("loss_motor_in", "driving motor"),
    ("mechanical_in", "mechanical in"),
    ("loss_sun_bearings", "sun bearings"),
    ("loss_relative_sun", "relative bearing, sun side"),
    ("loss_gear", "magnetic gear"),
    ("loss_relative_ring", "relative bearing, ring side"),
    ("loss_ring_bearings", "ring bearings"),
    ("unexplained", "unexplained"),
    ("mechanical_out", "mechanical out"),
    ("loss_motor_out", "loading motor"),
    ("electric_out", "electric out"),
)


def flow_section(gearbox: Gearbox, measured: Grid, simulated: Grid, bench: BenchParameters) -> Section:
    """Power flow of the accepted engaged points, from measured and from simulated torques."""
    rows = np.flatnonzero(measured.points.engaged & measured.accepted)
    grids = {"measured": measured[rows], "simulated": simulated[rows]}
    chains = {
        (origin, convention): power_chain(gearbox, grid, bench, convention)
        for origin, grid in grids.items()
        for convention in MotorConvention
    }
    best = int(np.argmax(chains["simulated", MotorConvention.CONSISTENT].mechanical_in))
    name = str(grids["measured"].points.name[best])
    shown = chains["measured", MotorConvention.CONSISTENT]
    return Section(
        "power-flow",
        "Power flow",
        (
            Text(
                "Powers between the two transducers come from torque and speed; the split between the elements is the "
                "calibrated model's. What the measured balance leaves open is a branch of its own, named unexplained. "
                "The motors are reckoned with one constant for torque and back-EMF and physical signs; the table "
                "gives them as the thesis reckons them too, where a torque constant of 1.19 N m/A beside a back-EMF "
                "constant of 1.0219 V s/rad creates power in one motor and removes it in the other."
            ),
            Figure(
                "power-flow-highest",
                f"Power flow at {name}",
                f"Highest power, {name}: {shown.mechanical_in[best]:.1f} W into the gearbox, "
                f"{shown.mechanical_out[best]:.1f} W out; unexplained {shown.unexplained[best]:+.2f} W.",
                (_drawing(shown, best),),
            ),
            _table(grids["measured"], chains),
        ),
        (sources.THESIS.at("sections 5.4 and 6.4.3"),),
    )


def _drawing(chain: PowerChain, i: int) -> PowerFlow:
    losses = [
        ("driving motor", float(chain.loss_motor_in[i]), 0),
        ("sun bearings", float(chain.loss_sun_bearings[i] + chain.loss_relative_sun[i]), 1),
        ("magnetic gear", float(chain.loss_gear[i]), 1),
        ("ring bearings", float(chain.loss_ring_bearings[i] + chain.loss_relative_ring[i]), 1),
        ("unexplained", float(chain.unexplained[i]), 1),
        ("loading motor", float(chain.loss_motor_out[i]), 2),
    ]
    if chain.drive_ring[i]:
        losses[1], losses[3] = losses[3], losses[1]
    main = (
        ("electric supply", float(chain.electric_in[i])),
        ("into the gearbox", float(chain.mechanical_in[i])),
        ("out of the gearbox", float(chain.mechanical_out[i])),
        ("useful electric power", float(chain.electric_out[i])),
    )
    return PowerFlow("", main, tuple(losses))


def _table(grid: Grid, chains: dict[tuple[str, MotorConvention], PowerChain]) -> Table:
    at = grid.points
    rows: list[tuple[Cell, ...]] = []
    for i in by_speed(at):
        for (origin, convention), chain in chains.items():
            rows.append(
                (
                    str(at.name[i]),
                    origin,
                    str(convention),
                    float(SPEED_SUN.display(at.speed_sun[i])),
                    float(at.load_set[i]),
                    *(float(getattr(chain, name)[i]) for name, _ in _COLUMNS),
                )
            )
    return Table(
        "power-flow-table",
        "Power flow by point",
        f"{len(at)} engaged points, measured and simulated torques, both conventions of the motors. Every line closes.",
        (
            Column("point", "Point"),
            Column("torques", "Torques"),
            Column("motors", "Motors"),
            Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=0),
            Column("load", "load asked for", "N m", digits=2),
            *(Column(name, label, "W", digits=2) for name, label in _COLUMNS),
        ),
        tuple(rows),
    )

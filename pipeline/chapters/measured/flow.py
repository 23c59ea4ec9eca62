"""Chapter on the power flow: the chain for every engaged point, and its drawing for the highest one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binom, norm

from pmg.pipeline.analysis.power_flow import BRANCHES
from pmg.pipeline.grid.levels import by_speed
from pmg.pipeline.report.document import Column, Figure, Measured, PowerFlow, Section, Table, Text
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.probability import CONFIDENCE, COVERAGE_FACTOR
from pmg.sim import sources
from pmg.sim.signals import SPEED_SUN
from pmg.sim.steady.power_chain import MotorConvention

if TYPE_CHECKING:
    from pmg.pipeline.analysis.power_flow import Flow
    from pmg.pipeline.report.table import Cell
    from pmg.sim.signals import Array

_LABELS = {
    "electric_in": "electric in",
    "loss_motor_in": "driving motor",
    "mechanical_in": "mechanical in",
    "loss_sun_bearings": "sun bearings",
    "loss_relative_sun": "relative bearing, sun side",
    "loss_gear": "magnetic gear",
    "loss_relative_ring": "relative bearing, ring side",
    "loss_ring_bearings": "ring bearings",
    "unexplained": "unexplained",
    "mechanical_out": "mechanical out",
    "loss_motor_out": "loading motor",
    "electric_out": "electric out",
}

_PARTS = {
    "transducers": "transducers",
    "curves": "curves",
    "K_corr": "K_corr",
    "damping": "b, c, d",
}

AGREE = "The losses of the model are the measured ones, within the uncertainty (U = 2u),"
"""What is said of power balances that leave nothing open, to go on with where."""

_ABSENT = "Branches marked * depend on {inputs} too, for which no uncertainty is stated: the figures leave it out."


def flow_section(flows: tuple[Flow, ...], parts: tuple[Figure, ...] = ()) -> Section:
    """Power flow of the accepted engaged points, from measured and from simulated torques, with its uncertainty.

    Parameters
    ----------
    flows : tuple of Flow
        As `power_flows` gives them.
    parts : tuple of Figure
        What the losses of each point are made of.
    """
    by = {(flow.origin, flow.convention): flow for flow in flows}
    shown = by["measured", MotorConvention.CONSISTENT]
    best = int(np.argmax(by["simulated", MotorConvention.CONSISTENT].chain.mechanical_in))
    name = str(shown.grid.points.name[best])
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
            _finding(shown),
            Figure(
                "power-flow-highest",
                "Power flow of a point",
                f"Of the engaged points, {name} takes the highest power. {_words(shown, best)} On the page other "
                f"points can be chosen; print and files show {name}."
                + (" Figure 6.19 of the source." if shown.grid.origin == "published" else ""),
                (_choice(shown, best),),
            ),
            *parts,
            _point_table(shown, best),
            _table(by),
            _parts_table(by),
        ),
        (sources.THESIS.at("sections 5.4 and 6.4.3"), sources.GUM.at("section 5.2.2")),
    )


def _words(flow: Flow, i: int) -> str:
    """What goes in and out at a point, and what is left open."""
    chain, u = flow.chain, float(flow.expanded("unexplained")[i])
    left = numerals.number(float(chain.unexplained[i]), spec="+.2f")
    return (
        f"{flow.grid.points.name[i]}: {chain.mechanical_in[i]:.1f} W into the gearbox, {chain.mechanical_out[i]:.1f} W "
        f"out; unexplained {left} W, U = {u:.2f} W. Uncertainties are U = 2u{_left_out(flow)}."
    )


def _finding(flow: Flow) -> Text:
    beyond, n = flow.beyond, len(flow.grid)
    if not beyond.any():
        return Text(f"{AGREE} at {'all ' * (n > 1)}{counted(n, 'point')}.", kind="finding")
    names = [str(name) for name in flow.grid.points.name[beyond]]
    text = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
    outside = 2.0 * float(norm.sf(COVERAGE_FACTOR))
    far = float(np.max(np.abs(flow.chain.unexplained) / flow.expanded("unexplained")))
    plain = far * COVERAGE_FACTOR > norm.isf(0.5 * (1.0 - CONFIDENCE) / n)  # further off than any of n by chance
    if not plain and binom.sf(len(names) - 1, n, outside) > 1.0 - CONFIDENCE:
        agree = f"{AGREE} at {n - len(names)} of {n} points"
        return Text(f"{agree}; {outside:.0%} of points lie beyond U by chance, here {text}.", kind="finding")
    return Text(
        f"The losses of the model are not the measured ones, by more than the uncertainty (U = 2u), at {len(names)} of "
        f"{n} points: {text}.",
        kind="warning",
    )


def _choice(flow: Flow, best: int) -> PowerFlow:
    """The drawing of one point, with those of all others to choose from."""
    names = flow.grid.points.name
    others = tuple((str(names[i]), _drawing(flow, int(i))) for i in by_speed(flow.grid.points))
    return replace(_drawing(flow, best), others=others)


def _drawing(flow: Flow, i: int) -> PowerFlow:
    losses: list[tuple[str, tuple[str, ...], int]] = [
        ("driving motor", ("loss_motor_in",), 0),
        ("sun bearings", ("loss_sun_bearings",), 1),
        ("magnetic gear", ("loss_gear",), 1),
        ("ring bearings", ("loss_ring_bearings",), 1),
        ("relative bearing", ("loss_relative_sun", "loss_relative_ring"), 1),
        ("unexplained", ("unexplained",), 1),
        ("loading motor", ("loss_motor_out",), 2),
    ]
    if flow.chain.drive_ring[i]:
        losses[1], losses[3] = losses[3], losses[1]
    main = (
        ("electric supply", ("electric_in",)),
        ("into the gearbox", ("mechanical_in",)),
        ("out of the gearbox", ("mechanical_out",)),
        ("useful electric power", ("electric_out",)),
    )
    return PowerFlow(
        "",
        tuple((label, _sum(flow, branches, i)) for label, branches in main),
        tuple((label, _sum(flow, branches, i), stage) for label, branches, stage in losses),
        tuple(float(flow.expanded_sum(branches)[i]) for branches in [b for _, b in main] + [b for _, b, _ in losses]),
        caption=_words(flow, i),
    )


def _sum(flow: Flow, branches: tuple[str, ...], i: int) -> float:
    return float(sum(flow.watts(branch)[i] for branch in branches))


def _label(flow: Flow, branch: str) -> str:
    return _LABELS[branch] + (" *" if flow.spread.lacking(branch) else "")


def _left_out(flow: Flow) -> str:
    inputs = sorted({source for branch in BRANCHES for source in flow.spread.lacking(branch)})
    return f" of the recordings: for the constants of {' and '.join(inputs)} none is stated" if inputs else ""


def _absent(flow: Flow) -> str:
    inputs = sorted({source for branch in BRANCHES for source in flow.spread.lacking(branch)})
    return " " + _ABSENT.format(inputs=" or ".join(inputs)) if inputs else ""


def _point_table(flow: Flow, i: int) -> Table:
    """The branches of one point, and what their uncertainty is made of."""
    groups = flow.spread.groups

    def cells(branch: str) -> tuple[Cell, ...]:
        spread = flow.spread
        parts = [spread.part(branch, group)[i] for group in groups]
        u = spread.u(branch)[i]
        own, common = spread.independent(branch)[i], spread.common(branch)[i]
        return (_label(flow, branch), Measured(flow.watts(branch)[i], u), 2.0 * u, own, common, *parts)

    return Table(
        "power-flow-highest-parts",
        f"Power flow at {flow.grid.points.name[i]} and its uncertainty",
        "Standard uncertainties: what differs from point to point, what all points share, and the causes of the "
        "latter. Causes are correlated through the calibration, so their squares need not add up." + _absent(flow),
        (
            Column("branch", "Branch"),
            Column("power", "Power ± u", "W", uncertain=True),
            Column("expanded", "U", "W", digits=3),
            Column("u_independent", "u, by point", "W", digits=3),
            Column("u_common", "u, common", "W", digits=3),
            *(Column(f"u_{g.replace(' ', '_')}", f"of which {_PARTS.get(g, g)}", "W", digits=3) for g in groups),
        ),
        tuple(cells(branch) for branch in BRANCHES),
    )


def _table(by: dict[tuple[str, MotorConvention], Flow]) -> Table:
    first = next(iter(by.values()))
    at = first.grid.points
    u = {key: {branch: flow.spread.u(branch) for branch in BRANCHES} for key, flow in by.items()}
    rows: list[tuple[Cell, ...]] = []
    for i in by_speed(at):
        for (origin, convention), flow in by.items():
            rows.append(
                (
                    str(at.name[i]),
                    origin,
                    str(convention),
                    float(SPEED_SUN.display(at.speed_sun[i])),
                    float(at.load_set[i]),
                    *(Measured(flow.watts(b)[i], u[origin, convention][b][i]) for b in BRANCHES),
                    "beyond U" if flow.beyond[i] else "within U" if origin == "measured" else None,
                )
            )
    return Table(
        "power-flow-table",
        "Power flow by point",
        f"{len(at)} engaged points, measured and simulated torques, both conventions of the motors, each power with "
        "its standard uncertainty. Every line closes." + _absent(first),
        (
            Column("point", "Point"),
            Column("torques", "Torques"),
            Column("motors", "Motors"),
            Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=0),
            Column("load", "load asked for", "N m", digits=2),
            *(Column(branch, _label(first, branch), "W", uncertain=True) for branch in BRANCHES),
            Column("unexplained_is", "Unexplained"),
        ),
        tuple(rows),
    )


def _parts_table(by: dict[tuple[str, MotorConvention], Flow]) -> Table:
    flows = [by[origin, MotorConvention.CONSISTENT] for origin in ("measured", "simulated")]
    at = flows[0].grid.points
    parts: dict[str, list[tuple[Array, Array]]] = {
        flow.origin: [(flow.spread.independent(b), flow.spread.common(b)) for b in BRANCHES] for flow in flows
    }
    columns = [Column("point", "Point"), Column("torques", "Torques")]
    for branch in BRANCHES:
        columns += [
            Column(f"u_{branch}", f"{_LABELS[branch]}, by point", "W", digits=3),
            Column(f"u_common_{branch}", f"{_LABELS[branch]}, common", "W", digits=3),
        ]
    return Table(
        "power-flow-uncertainty",
        "Uncertainty of the power flow by point",
        "Standard uncertainty of each branch: what differs from point to point, and what all points share and no mean "
        "takes away. Motors reckoned consistently.",
        tuple(columns),
        tuple(
            (str(at.name[i]), flow.origin, *(float(part[i]) for pair in parts[flow.origin] for part in pair))
            for i in by_speed(at)
            for flow in flows
        ),
    )

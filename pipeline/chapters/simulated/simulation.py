"""Chapters on a simulation: what was simulated, its steady points, and the page that holds them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import lay_out
from pmg.pipeline.chapters.page import PACKAGES, versions
from pmg.pipeline.chapters.simulated.motion import NO_UNCERTAINTY, response_section, run_section
from pmg.pipeline.chapters.simulated.two_runs import two_runs_section
from pmg.pipeline.fit.losses import QUANTITIES
from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import (
    Chart,
    Column,
    Facts,
    Figure,
    Headline,
    PowerFlow,
    Report,
    Section,
    Series,
    SpeedMap,
    Table,
    Text,
)
from pmg.pipeline.simulate.simulation import ABOVE_ONE
from pmg.sim import signals, sources
from pmg.sim.dynamics.assumptions import RANGES, Assumptions
from pmg.sim.grid import Configuration
from pmg.sim.signals import SPEED_RING, SPEED_SUN
from pmg.sim.steady.power_chain import MotorConvention

if TYPE_CHECKING:
    from pmg.pipeline.report.table import Cell
    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.simulation import Run, Simulation
    from pmg.pipeline.simulate.steady_points import SteadyPoints
    from pmg.sim.signals import Mask


def simulation_report(
    simulation: Simulation,
    scenario: Scenario,
    inputs: Inputs,
    findings: tuple[Remark, ...],
    provenance: tuple[tuple[str, str], ...],
    name: str = "",
    beside: tuple[str, Run] | None = None,
) -> Report:
    """The report of one scenario.

    Parameters
    ----------
    simulation : Simulation
        Results.
    scenario : Scenario
        What was asked for.
    inputs : Inputs
        The model.
    findings : tuple of Remark
        Remarks: severity, where, message.
    provenance : tuple of (label, value)
        Scenario and its hash.
    name : str
        What the run is called beside another one.
    beside : (name, Run), optional
        A run of another scenario, to be drawn over this one's.
    """
    sections = [_scenario_section(simulation, scenario, inputs, findings)]
    if simulation.points is not None:
        sections.append(_points_section(simulation.points, scenario, inputs))
    if simulation.run is not None:
        sections.append(run_section(simulation.run, scenario))
        if beside is not None:
            sections.append(two_runs_section((name, simulation.run), beside))
    if simulation.modes:
        sections.append(response_section(simulation))
    if not scenario.output.figures:
        sections = [_without_figures(section) for section in sections]
    return Report(
        title=scenario.title or f"Simulation {scenario.output.campaign}",
        subtitle="Simulated, all of it: a model of the bench, not the bench",
        verdict=_verdict(simulation, findings),
        sections=tuple(sections),
        provenance=Facts((*provenance, ("Versions", versions(PACKAGES)))),
    )


def _without_figures(section: Section) -> Section:
    return replace(section, items=tuple(item for item in section.unfolded if not isinstance(item, Figure)))


def _verdict(simulation: Simulation, findings: tuple[Remark, ...]) -> Headline:
    points, run = simulation.points, simulation.run
    lines = []
    if points is not None:
        lines.append(f"{len(points.grid)} steady point{'s' if len(points.grid) > 1 else ''}.")
    if run is not None:
        trace = run.trace
        speeds = (float(SPEED_SUN.display(trace[name][-1])) for name in ("speed_sun_motor", "speed_ring_motor"))
        sun, ring = (f"{speed:.1f}".replace("-", "−") for speed in speeds)
        if trace.stopped is None:
            lines.append(f"After {trace.time[-1]:g} s the sun turns at {sun} rpm, the ring motor at {ring} rpm.")
        else:
            lines.append(f"A pole slipped after {trace.time[-1]:.3f} s; the run ends there.")
    if simulation.answer is not None:
        lines.append(f"Frequency response to the {simulation.answer.side} motor's torque.")
    grave = any(finding.severity != "info" for finding in findings)
    return Headline(" ".join(lines), "attention" if grave else "neutral")


_WORDS = {None: "ideal", True: "yes", False: "no"}


def _scenario_section(
    simulation: Simulation, scenario: Scenario, inputs: Inputs, findings: tuple[Remark, ...]
) -> Section:
    bench = scenario.bench
    mode = f"gear {bench.gear}, {bench.configuration}, {bench.held} held"
    control = f"sun follows {bench.control_sun}, ring follows {bench.control_ring}"
    facts = (("Bench", mode), ("Motors", control), *inputs.facts, ("Torque loops", simulation.control.statement))
    rows: list[tuple[Cell, ...]] = []
    for f in fields(Assumptions):
        value = getattr(scenario.assumptions, f.name)
        shown = f"{value:g}" if type(value) is float else _WORDS.get(value, str(value))
        unit = RANGES[f.name][2] if f.name in RANGES and value is not None else ""
        rows.append((f.name, shown, "" if unit == "1" else unit, "default" if value == f.default else "chosen"))
    chosen = sum(row[-1] == "chosen" for row in rows)
    text = "".join(f"{f.severity}: {f.place}: {f.message}\n\n" for f in findings)
    items = (
        Text("Everything on this page is simulated. Nothing of it was measured.", kind="note"),
        Facts(facts),
        *((Text(text, kind="warning"),) if text else ()),
        Table(
            "assumptions",
            "What the source leaves open",
            f"{len(rows)} choices that the source does not make; {chosen} differ from their default.",
            (Column("name", "Choice"), Column("value", "Value"), Column("unit", "Unit"), Column("origin", "Origin")),
            tuple(rows),
        ),
    )
    return Section("scenario", "What was simulated", items, (sources.THESIS.at("chapter 5"),))


def _points_section(points: SteadyPoints, scenario: Scenario, inputs: Inputs) -> Section:
    engaged = scenario.bench.configuration is Configuration.ENGAGED
    figures: list[Figure] = []
    if scenario.grid is not None or scenario.pairs is not None:
        series = by_load(points.grid.points) if scenario.pairs is None else [("", points.grid.points.engaged)]
        figures.append(_engaged_figure(points, series) if engaged else _neutral_figure(points))
    if points.chains:
        figures.append(_flow_figure(points, inputs))
    tables = [_points_table(points), *([_chain_table(points)] if points.chains else [])]
    return Section(
        "steady-points", "Steady points", (*figures, *tables), (sources.THESIS.at("sections 4.2 and 6.1.1"),)
    )


def _engaged_figure(points: SteadyPoints, loads: list[tuple[str, Mask]]) -> Figure:
    """Torque, loss and efficiencies over speed, a line for each load; points alone where they have no levels."""
    at = points.grid.points
    panels = []
    for signal, values in (
        (signals.TORQUE_SUN, points.grid.torque_sun),
        (signals.LOSS_TOTAL, points.values["loss_total"]),
        (signals.EFFICIENCY_TOTAL, points.values["efficiency_total"]),
        (signals.EFFICIENCY_MAGNETIC, points.values["efficiency_magnetic"]),
    ):
        series = []
        for i, (load, rows) in enumerate(loads):
            order = np.flatnonzero(rows)[np.argsort(np.abs(at.speed_sun[rows]), kind="stable")]
            x, y = SPEED_SUN.display(np.abs(at.speed_sun[order])), signal.display(values[order])
            series.append(Series(load, x, y, None, "both" if load else "markers", i))
        panels.append(
            Chart(SPEED_SUN.label, signal.label, tuple(series), legend_title="Load" if len(loads) > 1 else "")
        )
    eta, loss = signals.EFFICIENCY_TOTAL.display(points.values["efficiency_total"]), points.values["loss_total"]
    caption = (
        f"Total loss {np.nanmin(loss):.2f} to {np.nanmax(loss):.2f} W, total efficiency {np.nanmin(eta):.1f} to "
        f"{np.nanmax(eta):.1f} % over {len(at)} points. {NO_UNCERTAINTY}"
    )
    return Figure("points-by-speed", "Torque, loss and efficiency", caption, tuple(panels), columns=2)


def _neutral_figure(points: SteadyPoints) -> Figure:
    grid = points.grid
    at = grid.points
    sun, ring = np.round(SPEED_SUN.display(at.speed_sun)), np.round(SPEED_RING.display(at.speed_ring))
    maps = []
    for signal, torque in ((signals.TORQUE_SUN, grid.torque_sun), (signals.TORQUE_RING, grid.torque_ring)):
        x, y, z = lay_out(ring, sun, torque)
        maps.append(SpeedMap(x, y, z, SPEED_RING.label, SPEED_SUN.label, signal.label, title=signal.meaning))
    caption = (
        f"Loss torque of the sun {grid.torque_sun.min():.3f} to {grid.torque_sun.max():.3f} N m, of the ring "
        f"{grid.torque_ring.min():.3f} to {grid.torque_ring.max():.3f} N m. A shaft at rest feels no drag in the "
        f"model. {NO_UNCERTAINTY}"
    )
    return Figure("points-neutral", "Torque over the neutral grid", caption, tuple(maps), columns=2)


def _flow_figure(points: SteadyPoints, inputs: Inputs) -> Figure:
    """Power flow of the point with the highest power, its losses by mechanism."""
    chain = points.chains[MotorConvention.CONSISTENT]
    i = int(np.argmax(chain.mechanical_in))
    losses = [("driving motor", float(chain.loss_motor_in[i]), 0)]
    for mechanism in inputs.gearbox.mechanisms:
        loss = float(points.losses[mechanism.identifier][i])
        if loss:
            losses.append((mechanism.title, loss, 1))
    losses.append(("loading motor", float(chain.loss_motor_out[i]), 2))
    main = (
        ("electric supply", float(chain.electric_in[i])),
        ("into the gearbox", float(chain.mechanical_in[i])),
        ("out of the gearbox", float(chain.mechanical_out[i])),
        ("useful electric power", float(chain.electric_out[i])),
    )
    name = str(points.grid.points.name[i])
    caption = (
        f"Highest power, {name}: {chain.mechanical_in[i]:.1f} W into the gearbox, {chain.mechanical_out[i]:.1f} W "
        f"out. Motors with one constant for torque and back-EMF. {NO_UNCERTAINTY}"
    )
    return Figure("points-flow", f"Power flow at {name}", caption, (PowerFlow("", main, tuple(losses)),))


def _points_table(points: SteadyPoints) -> Table:
    grid, at = points.grid, points.grid.points
    columns = [
        Column("point", "Point"),
        Column("drive", "Driven by"),
        Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=2),
        Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=2),
        Column("speed_carrier", "carrier speed", SPEED_RING.display_unit, digits=2),
        Column("torque_sun", signals.TORQUE_SUN.meaning, "N m", digits=4),
        Column("torque_ring", signals.TORQUE_RING.meaning, "N m", digits=4),
        Column("load_angle", "electrical phase", "rad", digits=4),
    ]
    columns += [Column(signal.name, signal.meaning, signal.display_unit, digits=2) for signal in QUANTITIES]
    values = [signal.display(points.values[signal.name]) for signal in QUANTITIES]
    rows: list[tuple[Cell, ...]] = [
        (
            str(at.name[i]),
            str(at.drive[i]) if at.engaged[i] else "both",
            float(SPEED_SUN.display(at.speed_sun[i])),
            float(SPEED_RING.display(at.speed_ring[i])),
            float(SPEED_RING.display(points.speed_carrier[i])),
            float(grid.torque_sun[i]),
            float(grid.torque_ring[i]),
            _known(points.load_angle[i]),
            *(_known(column[i]) for column in values),
        )
        for i in range(len(at))
    ]
    caption = f"{len(at)} points. {NO_UNCERTAINTY} All quantities, losses by mechanism too, are in the points table."
    above = points.values["efficiency_magnetic"] > 1.0 + ABOVE_ONE
    if above.any():
        caption += f" Magnetic efficiency above 1 at {int(above.sum())} points: shown as it comes out."
    return Table("points", "Steady points", caption, tuple(columns), tuple(rows))


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


_CHAIN = (
    ("electric_in", "electric in"),
    ("loss_motor_in", "driving motor"),
    ("mechanical_in", "mechanical in"),
    ("loss_between", "losses between"),
    ("mechanical_out", "mechanical out"),
    ("loss_motor_out", "loading motor"),
    ("electric_out", "electric out"),
)


def _chain_table(points: SteadyPoints) -> Table:
    at = points.grid.points
    rows: list[tuple[Cell, ...]] = [
        (str(at.name[i]), str(convention), *(float(getattr(chain, name)[i]) for name, _ in _CHAIN))
        for i in range(len(at))
        for convention, chain in points.chains.items()
    ]
    return Table(
        "points-chain",
        "Power from supply to useful power",
        f"{len(at)} points in both conventions of the motors; the thesis's uses two motor constants, so that one motor "
        f"creates power and the other removes it. {NO_UNCERTAINTY}",
        (Column("point", "Point"), Column("motors", "Motors"), *(Column(n, t, "W", digits=2) for n, t in _CHAIN)),
        tuple(rows),
    )

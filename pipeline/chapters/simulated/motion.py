"""Chapters on the bench in motion: a run in time, its energies; the modes and the frequency response."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Section, Series, Table, Text
from pmg.pipeline.wording.units import MILLI
from pmg.sim import sources
from pmg.sim.dynamics.limits import limits_reached
from pmg.sim.grid import Configuration
from pmg.sim.signals import REVOLUTION, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.report.table import Cell
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.simulation import Answer, Run, Simulation
    from pmg.sim.dynamics.linear import Mode
    from pmg.sim.dynamics.trace import Trace
    from pmg.sim.signals import Array

    Rows = npt.NDArray[np.int64]

MOST_DRAWN = 4000
"""Instants drawn at most; the table holds all."""

TIME = "time [s]"
NO_UNCERTAINTY = "Simulated values carry no uncertainty of their own."


def run_section(run: Run, scenario: Scenario) -> Section:
    """A run in time: what happened, speeds, torques, powers, torsion, and where the energy went."""
    trace = run.trace
    rows = np.unique(np.linspace(0, len(trace.time) - 1, min(len(trace.time), MOST_DRAWN)).round().astype(np.int64))
    engaged = scenario.bench.configuration is Configuration.ENGAGED
    items: list[Text | Facts | Figure | Table] = [Facts(_happened(trace, engaged))]
    if trace.stopped is not None:
        text = f"The run ended at {trace.time[-1]:.4g} s: {trace.stopped.came}. {trace.stopped.do}"
        items.append(Text(text, kind="finding"))
    figures = (_speeds, _torques, _powers, _torsion)
    items += [draw(trace, rows, engaged) for draw in figures]
    if run.opening is not None:
        items.append(_opening(run.opening, engaged))
    items.append(_energies(trace))
    return Section("transient", "Run in time", tuple(items), (sources.THESIS.at("chapter 5 and section 6.4"),))


def _happened(trace: Trace, engaged: bool) -> tuple[tuple[str, str], ...]:
    ended = f"{trace.time[-1]:g} s" + ("" if trace.stopped is None else ", stopped at a slipped pole")
    facts = [("Length of the run", ended), ("Steps of the integrator", str(trace.steps))]
    if engaged:
        locked = "not by the end" if np.isnan(trace.locked_at) else f"from {trace.locked_at:.3f} s on"
        slips = ", ".join(f"{time:.4g} s" for time in trace.slips[:10]) + (" ..." if len(trace.slips) > 10 else "")
        facts += [("Gear locked", locked), ("Slipped poles", f"{len(trace.slips)}" + (f": {slips}" if slips else ""))]
    facts += _limits(trace)
    facts.append(("Energy account", f"leaves over {abs(trace.energy.residual):.1g} of the turnover"))
    return tuple(facts)


def _limits(trace: Trace) -> list[tuple[str, str]]:
    """Whether a drive met its limits."""
    q = trace.drivetrain.constants
    if not q.limited:
        return [("Limits of the motors", "none set")]
    reached = "; ".join(limit.words for limit in limits_reached(trace))
    sizes = f"{q.U_bus:g} V, {q.i_peak:g} A"
    return [
        ("Limits of the motors", reached or f"not reached ({sizes}) at the {len(trace.time)} instants of the table")
    ]


def _chart(time: Array, label: str, named: Sequence[tuple[str, Array]], title: str = "") -> Chart:
    series = tuple(Series(name, time, values, None, "line", i) for i, (name, values) in enumerate(named))
    return Chart(TIME, label, series, title=title)


def _speeds(trace: Trace, rows: Rows, engaged: bool) -> Figure:
    q = trace.drivetrain.constants
    names = [("sun", "speed_sun"), ("ring", "speed_ring")]
    if q.ring_held:
        names = [("sun", "speed_sun"), ("carrier", "speed_carrier"), ("ring, held", "speed_ring")]
    elif q.sun_held:
        names = [("carrier", "speed_carrier"), ("ring", "speed_ring"), ("sun, held", "speed_sun")]
    speeds = {name: SPEED_SUN.display(trace[state]) for name, state in names}
    ends = ", ".join(f"{name} {values[-1]:.1f} rpm" for name, values in speeds.items())
    peak = max(float(np.abs(values).max()) for values in speeds.values())
    caption = f"Speeds at {trace.time[-1]:g} s: {ends}; the highest on the way is {peak:.1f} rpm."
    panels = tuple(_chart(trace.time[rows], "speed [rpm]", [("", v[rows])], name) for name, v in speeds.items())
    return Figure("run-speeds", "Speeds", caption.replace("-", "−"), panels, columns=2)


def _torques(trace: Trace, rows: Rows, engaged: bool) -> Figure:
    m, q = trace.drivetrain.motion(trace.state, trace.asked), trace.drivetrain.constants
    n = len(trace.time)
    panels, lines = [], []
    carrier = ("carrier", m.magnetic_carrier)
    on_sun = carrier if q.sun_held else ("sun", m.magnetic_sun)
    on_ring = carrier if q.ring_held else ("ring", m.magnetic_ring)
    for side, by, asked, seen, member, field in (
        ("sun", q.sun.by_speed, trace.asked.sun, m.sun.torque_out, *on_sun),
        ("ring", q.ring.by_speed, trace.asked.ring, m.ring.torque_out, *on_ring),
    ):
        columns = [("transducer", np.broadcast_to(seen, n)[rows])]
        if engaged:  # it swings most, so it is drawn first
            columns.insert(0, (f"field on the {member}, sign turned", -np.broadcast_to(field, n)[rows]))
        if not by:
            columns.append(("asked", np.broadcast_to(asked, n)[rows]))
        panels.append(_chart(trace.time[rows], "torque [N m]", columns, f"{side} motor's side"))
        lines.append(f"{side} {np.broadcast_to(seen, n)[-1]:.4f} N m (largest {np.abs(seen).max():.3f})")
    caption = f"Torque at the transducers at the end: {', '.join(lines)}.".replace("-", "−")
    return Figure(
        "run-torques", "Torques: asked for, at the transducer, of the field", caption, tuple(panels), columns=2
    )


def _powers(trace: Trace, rows: Rows, engaged: bool) -> Figure:
    m = trace.drivetrain.motion(trace.state, trace.asked)
    sides = np.stack([m.sun.torque_out * trace["speed_sun_motor"], m.ring.torque_out * trace["speed_ring_motor"]])
    into, out = np.maximum(sides, 0.0).sum(axis=0), -np.minimum(sides, 0.0).sum(axis=0)
    titles = {law.title for law in trace.drivetrain.losses}
    lost = trace.powers().dissipated
    losses = np.broadcast_to(sum((np.asarray(lost[name]) for name in titles), np.zeros(1)), into.shape)
    chart = _chart(
        trace.time[rows],
        "power [W]",
        [
            ("put in by the motors", into[rows]),
            ("taken out", out[rows]),
            ("lost between the transducers", losses[rows]),
        ],
    )
    caption = (
        f"Mechanical power at {trace.time[-1]:g} s: {into[-1]:.2f} W in, {out[-1]:.2f} W out, {losses[-1]:.2f} W lost "
        f"in bearings and gear; the rest, {into[-1] - out[-1] - losses[-1]:+.2f} W, is stored or damped."
    )
    return Figure("run-powers", "Powers", caption.replace("-", "−"), (chart,))


def _torsion(trace: Trace, rows: Rows, engaged: bool) -> Figure:
    named = {
        "block": trace["angle_block"] / MILLI,
        "ring joint": trace["twist_ring"] / MILLI,
        "sun joint": trace["twist_sun"] / MILLI,
    }
    panels = [_chart(trace.time[rows], "twist [mrad]", [(k, v[rows]) for k, v in named.items()], "joints")]
    largest = ", ".join(f"{name} {np.abs(values).max():.3f} mrad" for name, values in named.items())
    caption = f"Largest twist: {largest}."
    if engaged:
        phase = trace["phase"]
        panels.append(_chart(trace.time[rows], "electrical phase [rad]", [("", phase[rows])], "magnetic coupling"))
        caption += f" The phase swings between {phase.min():.3f} and {phase.max():.3f} rad and ends at {phase[-1]:.3f}."
    return Figure("run-torsion", "Torsion", caption.replace("-", "−"), tuple(panels), columns=2)


def _opening(trace: Trace, engaged: bool) -> Figure:
    """The first second of a run: speeds, torques and powers."""
    rows = np.arange(len(trace.time))
    panels = [
        replace(panel, title=f"{panel.title}: {title}".removeprefix(": "))
        for title, draw in (("speed", _speeds), ("torques", _torques), ("powers", _powers))
        for panel in draw(trace, rows, engaged).panels
        if isinstance(panel, Chart)
    ]
    speed = SPEED_SUN.display(trace["speed_sun"])
    locked = ""
    if engaged and not np.isnan(trace.locked_at):
        locked = f" The gear is locked from {trace.locked_at:.3f} s on." if trace.locked_at > 0.0 else ""
    caption = (
        f"The first {trace.time[-1]:g} s, each millisecond: the sun's speed lies between {speed.min():.1f} and "
        f"{speed.max():.1f} rpm."
    )
    return Figure("run-opening", "The first second", caption.replace("-", "−") + locked, tuple(panels), columns=2)


def _energies(trace: Trace) -> Table:
    account = trace.energy
    rows: list[tuple[Cell, ...]] = [
        (group, name, float(value))
        for group in ("supplied", "created", "dissipated", "stored")
        for name, value in getattr(account, group).items()
        if value or group == "supplied"
    ]
    stored = sum(account.stored.values())
    caption = (
        f"Supplied {sum(account.supplied.values()):.3f} J, dissipated {sum(account.dissipated.values()):.3f} J, stored "
        f"{stored:.3f} J; what the account leaves over is {abs(account.residual):.1g} of the turnover. {NO_UNCERTAINTY}"
    )
    return Table(
        "run-energy",
        "Where the energy went",
        caption.replace("-", "−") if stored < 0.0 else caption,
        (Column("group", "Group"), Column("element", "Element"), Column("energy", "Energy", "J", digits=4)),
        tuple(rows),
    )


def response_section(simulation: Simulation) -> Section:
    """Modes of the linearised bench, and how the speeds answer to a torque."""
    answer = simulation.answer
    about = "the state at the end of the run" if answer is None else answer.about
    items: list[Figure | Table] = [] if answer is None else [_bode(answer)]
    items.append(_modes(simulation.modes, about))
    return Section("response", "Small motions", tuple(items), (sources.THESIS.at("chapter 5"),))


def _modes(modes: Sequence[Mode], about: str) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (str(m.kind), m.frequency / REVOLUTION, m.damping_ratio, m.eigenvalue.real, "yes" if m.oscillates else "no")
        for m in modes
        if m.eigenvalue.imag >= 0.0
    ]
    swinging = [m for m in modes if m.eigenvalue.imag > 0.0]
    text = ", ".join(f"{m.kind} at {m.frequency / REVOLUTION:.4g} Hz" for m in swinging) or "none"
    return Table(
        "modes",
        "Modes by name",
        f"About {about}; a pair that oscillates stands once. Oscillating: {text}. {NO_UNCERTAINTY}",
        (
            Column("mode", "Mode"),
            Column("frequency", "Undamped frequency", "Hz", format=".4g"),
            Column("damping_ratio", "Damping ratio", format=".3g"),
            Column("rate", "Real part", "1/s", format=".4g"),
            Column("oscillates", "Oscillates"),
        ),
        tuple(rows),
    )


def _bode(answer: Answer) -> Figure:
    found = answer.response
    frequency = found.frequency / REVOLUTION
    magnitude = {"sun": SPEED_SUN.display(np.abs(found.speed_sun)), "ring": SPEED_SUN.display(np.abs(found.speed_ring))}
    phase = {
        name: np.degrees(np.unwrap(np.angle(value)))
        for name, value in (("sun", found.speed_sun), ("ring", found.speed_ring))
    }
    inside = [m for m in found.resonances if frequency[0] <= m.frequency / REVOLUTION <= frequency[-1]]
    marks = []
    for i, mode in enumerate(inside):
        at = mode.frequency / REVOLUTION
        height = np.exp(np.interp(np.log(at), np.log(frequency), np.log(magnitude["sun"])))
        marks.append(Series(f"{mode.kind}, {at:.4g} Hz", np.array([at]), np.array([height]), None, "markers", 2 + i))
    lines = [Series(f"{k} speed", frequency, v, None, "line", i) for i, (k, v) in enumerate(magnitude.items())]
    turns = [Series(f"{k} speed", frequency, v, None, "line", i) for i, (k, v) in enumerate(phase.items())]
    text = ", ".join(f"{m.kind} at {m.frequency / REVOLUTION:.4g} Hz (damping {m.damping_ratio:.2g})" for m in inside)
    caption = (
        f"Rotor speeds per set torque of the {answer.side} motor, about {answer.about}. "
        f"{f'Resonances: {text}' if text else 'No resonance in this range'}. "
        f"At {frequency[0]:g} Hz a torque of 1 N m moves the sun's speed by {magnitude['sun'][0]:.4g} rpm. "
        f"{NO_UNCERTAINTY}"
    )
    axis = "frequency [Hz]"
    return Figure(
        "bode",
        "Frequency response",
        caption,
        (
            Chart(axis, "magnitude [rpm per N m]", (*lines, *marks), title="magnitude", x_log=True, y_log=True),
            Chart(axis, "phase [degrees]", tuple(turns), title="phase", x_log=True),
        ),
        columns=2,
    )

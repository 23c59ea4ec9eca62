"""Chapter on two runs in time, one drawn over the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.simulated.motion import MOST_DRAWN, NO_UNCERTAINTY, TIME
from pmg.pipeline.report.document import Chart, Column, Figure, Section, Series, Table
from pmg.sim import sources
from pmg.sim.shafts import SIDES, PerShaft
from pmg.sim.signals import SPEED_SUN, TORQUES

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.report.table import Cell
    from pmg.pipeline.simulate.simulation import Run
    from pmg.sim.dynamics.trace import Trace
    from pmg.sim.signals import Array

    Named = tuple[str, Run]


def two_runs_section(first: Named, second: Named) -> Section:
    """Speeds and torques of two runs over one time axis, over all of it and over the first second, and their ends.

    Parameters
    ----------
    first, second : tuple of (name, Run)
        The runs; the first is drawn solid.
    """
    names = [first[0], second[0]]
    if names[0] == names[1]:
        names = [f"{names[0]} (first)", f"{names[1]} (second)"]
    whole = [(name, run.trace) for name, (_, run) in zip(names, (first, second), strict=True)]
    opening = [
        (name, run.opening) for name, (_, run) in zip(names, (first, second), strict=True) if run.opening is not None
    ]
    figures = [_figure("two-runs", "Two runs", whole)]
    if len(opening) == len(whole):
        figures.append(_figure("two-runs-opening", "Two runs, the first second", opening))
    return Section("two-runs-overlaid", "Two runs", (*figures, _ends(whole)), (sources.THESIS.at("section 6.3"),))


def _figure(id_: str, title: str, traces: list[tuple[str, Trace]]) -> Figure:
    panels = (
        *(_panel(traces, "speed [rpm]", _speed, f"{side}: speed", (side,)) for side in SIDES),
        _panel(traces, "torque [N m]", _field, "torques of the field, sign turned", SIDES),
    )
    apart = _apart(traces)
    caption = f"{apart} {NO_UNCERTAINTY}"
    return Figure(id_, title, caption, panels, columns=2)


def _speed(trace: Trace, side: str) -> Array:
    return np.asarray(SPEED_SUN.display(trace[f"speed_{side}"]))


def _field(trace: Trace, side: str) -> Array:
    """Torque that a rotor takes up from its shaft and passes on [N m]."""
    m = trace.drivetrain.motion(trace.state, trace.asked)
    return -np.asarray(PerShaft(m.magnetic_sun, m.magnetic_ring)[side])


def _panel(
    traces: list[tuple[str, Trace]],
    label: str,
    values: Callable[[Trace, str], Array],
    title: str,
    sides: tuple[str, ...],
) -> Chart:
    series = []
    for name, trace in traces:
        rows = np.unique(np.linspace(0, len(trace.time) - 1, min(len(trace.time), MOST_DRAWN)).round().astype(np.int64))
        for side in sides:
            y = np.broadcast_to(values(trace, side), trace.time.shape)[rows]
            series.append(Series(side, trace.time[rows], y, None, "line", SIDES.index(side), name))
    return Chart(TIME, label, tuple(series), title=title)


def _apart(traces: list[tuple[str, Trace]]) -> str:
    """Largest difference of the sun's speed at common times, as a sentence."""
    (_, first), (_, second) = traces
    time = first.time[first.time <= second.time[-1]]
    speed = np.interp(time, first.time, first["speed_sun"]) - np.interp(time, second.time, second["speed_sun"])
    worst = int(np.argmax(np.abs(speed)))
    size = f"{float(SPEED_SUN.display(speed[worst])):+.2f} rpm".replace("-", "−")
    return f"The sun's speeds differ most at {time[worst]:.4g} s, by {size} (first − second)."


def _ends(traces: list[tuple[str, Trace]]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, trace in traces:
        speeds = (float(SPEED_SUN.display(trace[f"speed_{side}"][-1])) for side in SIDES)
        torques = (float(np.broadcast_to(trace.torque[side], trace.time.shape)[-1]) for side in SIDES)
        locked = None if np.isnan(trace.locked_at) else float(trace.locked_at)
        rows.append((name, float(trace.time[-1]), *speeds, *torques, locked, len(trace.slips)))
    return Table(
        "two-runs-ends",
        "Ends of the two runs",
        f"Speeds and torques at the end of each run. {NO_UNCERTAINTY}",
        (
            Column("run", "Run"),
            Column("end", "End", "s", format=".4g"),
            Column("speed_sun", "sun speed", "rpm", digits=2),
            Column("speed_ring", "ring speed", "rpm", digits=2),
            *(Column(signal.name, signal.meaning, signal.display_unit, digits=4) for signal in TORQUES),
            Column("locked", "Locked from", "s", digits=3),
            Column("slips", "Slipped poles"),
        ),
        tuple(rows),
    )

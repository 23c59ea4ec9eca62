"""Chapters on the efficiency by load, and on the speed ratio, of the engaged gear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import iso_levels, lay_out, names_in_cells, names_of
from pmg.pipeline.grid.levels import by_load, speed_levels
from pmg.pipeline.report.document import Chart, Facts, Figure, Section, Series, SpeedMap, Text
from pmg.pipeline.wording import numerals
from pmg.sim import signals, sources
from pmg.sim.signals import SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.analysis.comparison import Residuals
    from pmg.pipeline.fit.losses import PowerBalance
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

PPM = 1e6
"""Deviations of the speed ratio are shown in millionths."""


def efficiency_section(balance: PowerBalance, residuals: Residuals | None) -> Section:
    """Total and magnetic efficiency by load, measured and (the total one) simulated; the map over speed and load."""
    items: list[Text | Figure] = [_by_load(balance, residuals)]
    forward = np.asarray(balance.grid.points.drive == "sun")
    if forward.any():
        items.append(_map(balance, forward))
    return Section(
        "efficiency-by-load", "Efficiency by load", tuple(items), (sources.THESIS.at("equations 4.5 to 4.7"),)
    )


def _by_load(balance: PowerBalance, residuals: Residuals | None) -> Figure:
    at = balance.grid.points
    panels = []
    for signal in (signals.EFFICIENCY_TOTAL, signals.EFFICIENCY_MAGNETIC):
        series = []
        simulated = _simulated(balance, residuals) if signal is signals.EFFICIENCY_TOTAL else None
        for i, (name, rows) in enumerate(by_load(at)):
            x = SPEED_SUN.display(np.abs(at.speed_sun[rows]))
            order = np.argsort(x, kind="stable")
            y, u = signal.display(balance.values[signal.name][rows]), balance.u(signal.name)[rows] / signal.scale
            points = names_of(at.name[rows][order])
            group = "measured" if simulated is not None else ""
            series.append(Series(name, x[order], y[order], u[order], "markers", i, group, points))
            if simulated is not None:
                line = signal.display(simulated[rows][order])
                series.append(Series(name, x[order], line, None, "line", i, "simulated"))
        ordered = sorted(series, key=lambda one: one.group == "simulated")
        panels.append(Chart(SPEED_SUN.label, signal.label, tuple(ordered), (("", 100.0),), "Load", signal.meaning))
    of = signals.EFFICIENCY_TOTAL
    total, u_total = of.display(balance.values[of.name]), balance.u(of.name) / of.scale
    low, high = (
        numerals.measured(float(total[i]), 2.0 * float(u_total[i]))
        for i in (
            int(np.argmin(np.where(np.isnan(total), np.inf, total))),
            int(np.argmax(np.where(np.isnan(total), -np.inf, total))),
        )
    )
    return Figure(
        "efficiency",
        "Efficiency by load",
        f"Total efficiency between {low} and {high} % over all points, with U = 2u. Near zero load its uncertainty "
        "grows without bound: read the losses in watts first.",
        tuple(panels),
        columns=2,
    )


def _simulated(balance: PowerBalance, residuals: Residuals | None) -> Array | None:
    """Simulated total efficiency of the points of the balance; None where nothing was simulated."""
    if residuals is None:
        return None
    of = dict(zip(residuals.grid.points.name, residuals.efficiency_total.simulated, strict=True))
    values = np.array([of.get(name, np.nan) for name in balance.grid.points.name], dtype=np.float64)
    return values if np.isfinite(values).any() else None


def _map(balance: PowerBalance, rows: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Figure:
    at, of = balance.grid.points, signals.EFFICIENCY_TOTAL
    load, speed = np.abs(np.round(at.load_set, 3))[rows], speed_levels(at)[0][rows]
    x, y, z = lay_out(load, speed, of.display(balance.values[of.name][rows]))
    panel = SpeedMap(
        x,
        y,
        z,
        "load asked for [N m]",
        SPEED_SUN.label,
        of.label,
        annotate=True,
        contours=iso_levels(z),
        points=names_in_cells(load, speed, at.name[rows]),
    )
    row, column = np.unravel_index(int(np.nanargmax(z)), z.shape)
    caption = (
        f"Total efficiency over speed and load, forward flow; highest at {numerals.number(float(x[column]))} N m and "
        f"{numerals.number(float(y[row]))} rpm. Grey: not measured."
    )
    return Figure("efficiency-map", "Efficiency over speed and load", caption, (panel,))


def speed_ratio_section(balance: PowerBalance, bench: BenchParameters) -> Section:
    """Measured ratio of the speeds against the ratio of the pole pairs: a synchronous gear does not slip."""
    at = balance.grid.points
    ratio = np.abs(at.speed_sun / at.speed_ring)
    nominal = bench.ratio(at.gear)
    off = (ratio / nominal - 1.0) * PPM
    worst = int(np.argmax(np.abs(off)))
    series = []
    for i, (name, rows) in enumerate(by_load(at)):
        x = SPEED_SUN.display(np.abs(at.speed_sun[rows]))
        series.append(Series(name, x, off[rows], None, "markers", i, points=names_of(at.name[rows])))
    chart = Chart(SPEED_SUN.label, "deviation of the speed ratio [ppm]", tuple(series), (("", 0.0),), "Load")
    facts = (
        ("Ratio of the pole pairs, carrier fixed", ", ".join(f"{of:.6g}" for of in dict.fromkeys(nominal))),
        ("Largest deviation", f"{numerals.number(float(off[worst]), 1)} ppm at {at.name[worst]}"),
        ("Mean deviation", f"{numerals.number(float(off.mean()), 2)} ppm over {len(off)} points"),
    )
    caption = (
        "Measured speed ratio against that of the pole pairs. A magnetic gear runs synchronously: only the resolution "
        "of the counts and a slow swing of the load angle part the two, and slipping would show as thousands of ppm. "
        "No uncertainty is stated for a single ratio."
    )
    figure = Figure("speed-ratio", "Deviation of the speed ratio", caption, (chart,))
    return Section("speed-ratio-kept", "Speed ratio", (Facts(facts), figure))

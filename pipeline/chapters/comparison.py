"""Chapter on the comparison: simulated against measured torque, loss and efficiency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import by_load, by_speed, forward_neutral, lay_out, measured
from pmg.pipeline.compare import COVERAGE
from pmg.pipeline.completeness import speed_levels
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Section, Series, SpeedMap, Table, Text
from pmg.sim import signals, sources
from pmg.sim.signals import RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.compare import Difference, Residuals
    from pmg.sim.signals import Mask, Signal

_COMPARED = (
    ("torque_sun", signals.TORQUE_SUN, RESIDUAL),
    ("torque_ring", signals.TORQUE_RING, RESIDUAL),
    ("loss_total", signals.LOSS_TOTAL, signals.LOSS_TOTAL),
    ("efficiency_total", signals.EFFICIENCY_TOTAL, signals.EFFICIENCY_TOTAL),
)


def comparison_section(residuals: Residuals, more: tuple[Table, ...] = ()) -> Section:
    """How well the simulator meets the measurement, point by point; `more` tables stand behind the facts."""
    facts = []
    for name, signal, shown in _COMPARED:
        difference: Difference = getattr(residuals, name)
        known = difference.compared
        if known.any():
            rms = float(np.sqrt(np.mean(shown.display(difference.value[known]) ** 2)))
            facts.append(
                (
                    f"{signal.meaning}, {int(known.sum())} points",
                    f"{int(difference.within[known].sum())} within U; rms difference {rms:.3g} {shown.display_unit}",
                )
            )
    tolerance = (
        "U here is that of repeating the test: the transducers' common tolerance, which would shift whole columns "
        "alike, is not in it. It is in the uncertainties of losses and efficiencies above."
    )
    items: list[Facts | Figure | Table | Text] = [Facts(tuple(facts)), Text(tolerance, kind="note")]
    items += more
    if (residuals.grid.points.engaged & residuals.torque_sun.compared).any():
        items.append(_engaged_figure(residuals))
    items += [*_maps(residuals), _table(residuals)]
    return Section("comparison", "Simulated against measured", tuple(items), (sources.THESIS.at("section 6.1.1"),))


def _engaged_figure(residuals: Residuals) -> Figure:
    at = residuals.grid.points
    panels = []
    for name, signal, label in (
        ("torque_sun", RESIDUAL, "sun torque, measured − simulated [mN m]"),
        ("loss_total", signals.LOSS_TOTAL, "total loss, measured − simulated [W]"),
    ):
        difference: Difference = getattr(residuals, name)
        series = []
        for i, (load, rows) in enumerate(by_load(at)):
            chosen = rows & difference.compared
            x = SPEED_SUN.display(np.abs(at.speed_sun[chosen]))
            y, u = signal.display(difference.value[chosen]), difference.u[chosen] / signal.scale
            series.append(Series(load, x, y, u, "markers", i))
        panels.append(Chart(SPEED_SUN.label, label, tuple(series), (("", 0.0),), "Load", ""))
    known = at.engaged & residuals.torque_sun.compared
    inside = int(residuals.torque_sun.within[known].sum())
    return Figure(
        "engaged-residuals",
        "Engaged points: measured minus simulated",
        f"Sun torque agrees within U = {COVERAGE:g}u at {inside} of {int(known.sum())} engaged points.",
        tuple(panels),
        columns=2,
    )


def _map(
    residuals: Residuals,
    difference: Difference,
    rows: Mask,
    axes: tuple[signals.Array, signals.Array],
    labels: tuple[str, str],
    title: str,
) -> SpeedMap:
    x, y, z = lay_out(axes[0][rows], axes[1][rows], RESIDUAL.display(difference.value[rows]))
    _, _, inside = lay_out(axes[0][rows], axes[1][rows], np.where(difference.compared, difference.within, np.nan)[rows])
    return SpeedMap(x, y, z, *labels, RESIDUAL.label, inside == 1.0, diverging=True, title=title)


def _maps(residuals: Residuals) -> list[Figure]:
    grid = residuals.grid
    sun, ring = speed_levels(grid.points)
    neutral = forward_neutral(grid)
    figures = []
    if neutral.any():
        panels = tuple(
            _map(residuals, difference, neutral, (ring, sun), (SPEED_RING.label, SPEED_SUN.label), title)
            for difference, title in ((residuals.torque_sun, "sun torque"), (residuals.torque_ring, "ring torque"))
        )
        worst = max(
            float(np.nanmax(np.abs(d.value[neutral]), initial=0.0))
            for d in (residuals.torque_sun, residuals.torque_ring)
        )
        caption = (
            f"Neutral points: the largest difference is {worst * 1e3:.1f} mN m. Hatched: within U. Grey: not compared "
            "(shaft at rest) or not measured."
        )
        figures.append(Figure("neutral-residuals", "Residual over the neutral grid", caption, panels, columns=2))
    engaged = grid.points.engaged & (grid.points.drive == "sun") & residuals.torque_sun.compared
    if engaged.any():
        axes = (np.round(grid.points.load_set, 3), sun)
        panel = _map(
            residuals, residuals.torque_sun, engaged, axes, ("load asked for [N m]", SPEED_SUN.label), "sun torque"
        )
        caption = "Engaged points, forward flow: residual of the sun torque over speed and load. Hatched: within U."
        figures.append(Figure("engaged-map", "Residual over speed and load", caption, (panel,)))
    return figures


def _table(residuals: Residuals) -> Table:
    grid, at = residuals.grid, residuals.grid.points
    columns = [
        Column("point", "Point"),
        Column("configuration", "Configuration"),
        Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
        Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=1),
        Column("load_set", "load asked for", "N m", digits=2),
    ]
    for name, signal, shown in _COMPARED:
        columns += [
            Column(f"{name}_measured", f"{signal.meaning}, measured", signal.display_unit, digits=4),
            Column(f"{name}_simulated", f"{signal.meaning}, simulated", signal.display_unit, digits=4),
            Column(f"{name}_difference", "difference", shown.display_unit, uncertain=True),
        ]
    rows = []
    usable = grid.accepted & ~at.zero
    for i in by_speed(at):
        if not usable[i]:
            continue
        row: list[object] = [
            str(at.name[i]),
            str(at.configuration[i]),
            float(SPEED_SUN.display(at.speed_sun[i])),
            float(SPEED_RING.display(at.speed_ring[i])),
            float(at.load_set[i]),
        ]
        for name, signal, shown in _COMPARED:
            d: Difference = getattr(residuals, name)
            known = bool(d.compared[i])
            row += [_plain(signal, d.measured[i], known), _plain(signal, d.simulated[i], known)]
            row.append(measured(shown, d.value[i], d.u[i]) if known else None)
        rows.append(tuple(row))
    return Table(
        "comparison-by-point",
        "Measured and simulated, by point",
        f"{len(rows)} points. Engaged, the measured ring torque is the simulator's input, so it is not compared.",
        tuple(columns),
        tuple(rows),  # type: ignore[arg-type]
    )


def _plain(signal: Signal, value: float, known: bool) -> float | None:
    return float(signal.display(value)) if known else None

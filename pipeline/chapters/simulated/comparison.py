"""Chapter on the comparison: simulated against measured torque, loss and efficiency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.analysis.tolerance import COMPARED, ToleranceState
from pmg.pipeline.chapters.cells import lay_out, names_in_cells, names_of
from pmg.pipeline.chapters.simulated.residual_plots import residual_plots
from pmg.pipeline.grid.levels import by_load, by_speed, forward_neutral, speed_levels
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Section, Series, SpeedMap, Table, Text, measured
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim import signals, sources
from pmg.sim.signals import HOUR, RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.analysis.comparison import Difference, Residuals
    from pmg.pipeline.analysis.tolerance import Agreements
    from pmg.pipeline.report.table import Cell
    from pmg.sim.signals import Mask, Signal

_SHOWN_DIFFERENCE = {"torque_sun": RESIDUAL, "torque_ring": RESIDUAL}
"""Signals whose differences are shown in another unit than their values."""
WORST = 10
"""Most points of the table of those furthest out of tolerance."""


def comparison_section(residuals: Residuals, agreed: Agreements, more: tuple[Table | Figure, ...] = ()) -> Section:
    """Agreement of simulator and measurement, point by point; `more` stands behind the facts."""
    facts = []
    for name, signal in COMPARED:
        shown = _SHOWN_DIFFERENCE.get(name, signal)
        difference: Difference = getattr(residuals, name)
        agreement = agreed.of[name]
        known = agreement.compared
        if known.any():
            rms = float(np.sqrt(np.mean(shown.display(difference.value[known]) ** 2)))
            within, inside = int(agreement.within.sum()), int((difference.within & known).sum())
            facts.append(
                (
                    f"{signal.meaning}, {int(known.sum())} points compared",
                    f"{within} {ToleranceState.WITHIN}, {int(known.sum()) - within} {ToleranceState.OUT} "
                    f"({agreement.rule}); {inside} within U; rms difference {rms:.3g} {shown.display_unit}",
                )
            )
    text = (
        "A tolerance says whether the simulation is good enough for its use, and is set beforehand. U says whether a "
        "difference is real: it is that of repeating the test, without the transducers' common tolerance, which would "
        "shift whole columns alike and is in the uncertainties of losses and efficiencies above."
    )
    items: list[Facts | Figure | Table | Text] = [
        Text(agreed.description, kind="finding"),
        Facts(tuple(facts)),
        Text(text, kind="note"),
    ]
    if (worst := _worst(residuals, agreed)) is not None:
        items.append(worst)
    items += more
    if (residuals.grid.points.engaged & residuals.torque_sun.compared).any():
        items.append(_engaged_figure(residuals))
    items += [*_maps(residuals), *residual_plots(residuals, agreed), *_followed(residuals), _table(residuals, agreed)]
    return Section("comparison", "Simulated against measured", tuple(items), (sources.THESIS.at("section 6.1.1"),))


def _engaged_figure(residuals: Residuals) -> Figure:
    at = residuals.grid.points
    panels = []
    for name, signal, title in (
        ("torque_sun", RESIDUAL, signals.TORQUE_SUN.meaning),
        ("loss_total", signals.LOSS_TOTAL, signals.LOSS_TOTAL.meaning),
    ):
        difference: Difference = getattr(residuals, name)
        series = []
        for i, (load, rows) in enumerate(by_load(at)):
            chosen = rows & difference.compared
            x = SPEED_SUN.display(np.abs(at.speed_sun[chosen]))
            y, u = signal.display(difference.value[chosen]), difference.u[chosen] / signal.scale
            series.append(Series(load, x, y, u, "markers", i, points=names_of(at.name[chosen])))
        label = f"measured − simulated [{signal.display_unit}]"
        panels.append(Chart(SPEED_SUN.label, label, tuple(series), (("", 0.0),), "Load", title))
    known = at.engaged & residuals.torque_sun.compared
    inside = int(residuals.torque_sun.within[known].sum())
    return Figure(
        "engaged-residuals",
        "Engaged points: measured minus simulated",
        f"Sun torque agrees within U = {COVERAGE_FACTOR:g}u at {inside} of {int(known.sum())} engaged points.",
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
    points = names_in_cells(axes[0][rows], axes[1][rows], residuals.grid.points.name[rows])
    return SpeedMap(x, y, z, *labels, RESIDUAL.label, inside == 1.0, diverging=True, title=title, points=points)


def _followed(residuals: Residuals) -> list[Figure]:
    """Residuals against the shaft's own speed, the load asked for, and the time of the test."""
    at = residuals.grid.points
    loads = np.abs(at.load_set)
    panels, followed = [], []
    for what, x_of, label in (
        ("speed", None, "speed of the shaft [rpm]"),
        ("load", loads, "load asked for [N m]"),
        ("time", (at.started_at - np.nanmin(at.started_at)) / HOUR if at.ordered else None, "time of the test [h]"),
    ):
        if what == "time" and x_of is None:
            continue
        series = []
        for i, (name, rows, difference, speed) in enumerate(
            (
                ("sun, neutral", at.neutral, residuals.torque_sun, SPEED_SUN.display(at.speed_sun)),
                ("ring, neutral", at.neutral, residuals.torque_ring, SPEED_RING.display(at.speed_ring)),
                ("sun, engaged", at.engaged, residuals.torque_sun, SPEED_SUN.display(at.speed_sun)),
            )
        ):
            chosen = np.asarray(rows & difference.compared)
            if x_of is loads and name.endswith("neutral"):
                continue
            if chosen.any():
                x = (speed if x_of is None else x_of)[chosen]
                y, u = RESIDUAL.display(difference.value[chosen]), difference.u[chosen] / RESIDUAL.scale
                series.append(Series(name, x, y, u, "markers", i, points=names_of(at.name[chosen])))
        if series:
            panels.append(Chart(label, "measured − simulated [mN m]", tuple(series), (("", 0.0),)))
            followed.append(what)
    if not panels:
        return []
    caption = (
        f"Torque residuals against {', '.join(followed)}; bars are U = 2u. "
        "A trend means an effect is missing from the model."
    )
    return [Figure("residuals-followed", "What the residuals follow", caption, tuple(panels), columns=len(panels))]


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


def _worst(residuals: Residuals, agreed: Agreements) -> Table | None:
    """The points that are furthest out of tolerance; None where there is none."""
    grid, at = residuals.grid, residuals.grid.points
    names = [name for name, _ in COMPARED]
    ratios = np.full((len(names), len(grid)), -np.inf)
    for k, name in enumerate(names):
        agreement = agreed.of[name]
        out = agreement.compared & ~agreement.within
        with np.errstate(divide="ignore"):  # a tolerance of zero was set: any difference is beyond all measure
            ratios[k, out] = np.abs(getattr(residuals, name).value[out]) / agreement.bound[out]
    # What follows from a torque is as far out as that torque: the torque is named.
    leading = np.argmax(ratios >= ratios.max(axis=0) * (1.0 - 1e-9), axis=0)
    furthest = ratios.max(axis=0)
    beyond = np.flatnonzero(furthest > -np.inf)
    if not len(beyond):
        return None
    rows: list[tuple[Cell, ...]] = []
    for i in beyond[np.argsort(-furthest[beyond], kind="stable")][:WORST]:
        name, signal = COMPARED[int(leading[i])]
        shown = _SHOWN_DIFFERENCE.get(name, signal)
        difference: Difference = getattr(residuals, name)
        rows.append(
            (
                str(at.name[i]),
                signal.meaning,
                measured(shown, difference.value[i], difference.u[i]),
                float(agreed.of[name].bound[i]) / shown.scale,
                shown.display_unit,
                float(furthest[i]),
                float(SPEED_SUN.display(at.speed_sun[i])),
                float(SPEED_RING.display(at.speed_ring[i])),
                float(at.load_set[i]),
            )
        )
    return Table(
        "out-of-tolerance",
        f"Furthest {ToleranceState.OUT}",
        f"{len(rows)} of {counted(len(beyond), 'point')} {ToleranceState.OUT}, the furthest first, each by the "
        "quantity that is furthest out there. All are in the table by point below.",
        (
            Column("point", "Point"),
            Column("quantity", "Quantity"),
            Column("difference", "measured − simulated", "", uncertain=True),
            Column("tolerance", "tolerance", "", format=".3g"),
            Column("unit", "Unit"),
            Column("ratio", "times the tolerance", "", digits=1),
            Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
            Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=1),
            Column("load_set", "load asked for", "N m", digits=2),
        ),
        tuple(rows),
    )


def _table(residuals: Residuals, agreed: Agreements) -> Table:
    grid, at = residuals.grid, residuals.grid.points
    columns = [
        Column("point", "Point"),
        Column("state", "Judged"),
        Column("configuration", "Configuration"),
        Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
        Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=1),
        Column("load_set", "load asked for", "N m", digits=2),
    ]
    for name, signal in COMPARED:
        shown = _SHOWN_DIFFERENCE.get(name, signal)
        columns += [
            Column(f"{name}_measured", f"{signal.meaning}, measured", signal.display_unit, digits=4),
            Column(f"{name}_simulated", f"{signal.meaning}, simulated", signal.display_unit, digits=4),
            Column(f"{name}_difference", "difference", shown.display_unit, uncertain=True),
            Column(f"{name}_state", f"{signal.meaning}, judged"),
        ]
    states, overall = {name: agreed.of[name].states for name, _ in COMPARED}, agreed.states
    rows = []
    usable = grid.accepted & ~at.zero
    for i in by_speed(at):
        if not usable[i]:
            continue
        row: list[object] = [
            str(at.name[i]),
            str(overall[i]),
            str(at.configuration[i]),
            float(SPEED_SUN.display(at.speed_sun[i])),
            float(SPEED_RING.display(at.speed_ring[i])),
            float(at.load_set[i]),
        ]
        for name, signal in COMPARED:
            d: Difference = getattr(residuals, name)
            known = bool(d.compared[i])
            row += [_plain(signal, d.measured[i], known), _plain(signal, d.simulated[i], known)]
            row.append(measured(_SHOWN_DIFFERENCE.get(name, signal), d.value[i], d.u[i]) if known else None)
            row.append(str(states[name][i]))
        rows.append(tuple(row))
    return Table(
        "comparison-by-point",
        "Measured and simulated, by point",
        f"{len(rows)} points, each judged by all quantities that can be compared there, then by each of them. "
        "Engaged, the measured ring torque is the simulator's input, so it is not compared.",
        tuple(columns),
        tuple(rows),  # type: ignore[arg-type]
    )


def _plain(signal: Signal, value: float, known: bool) -> float | None:
    return float(signal.display(value)) if known else None

"""Figures of two campaigns side by side: maps, differences by load, what they follow, loss curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import lay_out, names_in_cells, names_of
from pmg.pipeline.grid.levels import by_load, speed_levels
from pmg.pipeline.report.document import Chart, Figure, Series, SpeedMap
from pmg.pipeline.wording import numerals
from pmg.sim import signals
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_RING, SPEED_SUN, SPEEDS

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.constants import CurveDifference
    from pmg.pipeline.campaign_comparison.difference import PointDifference, Versus
    from pmg.sim.signals import Array, Mask, Signal

SUN, RING = "sun torque, B − A [mN m]", "ring torque, B − A [mN m]"
LOSS, MAGNETIC = "total loss, B − A [W]", "magnetic loss, B − A [W]"


def map_figures(versus: Versus) -> list[Figure]:
    """Differences over the neutral and the engaged grid, hatched where within U."""
    at = versus.at
    sun, ring = speed_levels(at)
    load = np.round(at.load_set, 3)
    forward = at.neutral & (sun >= 0) & (ring >= 0)
    engaged = at.engaged & (at.drive == "sun")
    of_loss = versus.quantities.get(signals.LOSS_TOTAL.name)
    found = []
    for rows, axes, labels, chosen, name, title in (
        (
            forward,
            (ring, sun),
            (SPEED_RING.label, SPEED_SUN.label),
            [
                ("sun torque", versus.quantities["torque_sun"], RESIDUAL, SUN),
                ("ring torque", versus.quantities["torque_ring"], RESIDUAL, RING),
            ],
            "neutral",
            "Difference over the neutral grid",
        ),
        (
            engaged,
            (load, sun),
            ("load asked for [N m]", SPEED_SUN.label),
            [("sun torque at one load", versus.quantities["torque_sun"], RESIDUAL, SUN)]
            + ([] if of_loss is None else [("total loss", of_loss, signals.LOSS_TOTAL, LOSS)]),
            "engaged",
            "Difference over speed and load",
        ),
    ):
        panels = tuple(
            _map(versus, one, signal, rows, axes, labels, label, title_of)
            for title_of, one, signal, label in chosen
            if (rows & one.compared).any()
        )
        if panels:
            beyond = sum(int(one.beyond[rows].sum()) for _, one, _, _ in chosen)
            count = sum(int(one.compared[rows].sum()) for _, one, _, _ in chosen)
            caption = f"{beyond} of {count} cells beyond U = 2u. Hatched: within U. Grey: not in both campaigns."
            found.append(Figure(f"map-{name}", title, caption, panels, columns=2))
    return found


def _map(
    versus: Versus,
    found: PointDifference,
    signal: Signal,
    rows: Mask,
    axes: tuple[Array, Array],
    labels: tuple[str, str],
    label: str,
    title: str,
) -> SpeedMap:
    """Repeats of a cell are averaged; it is hatched where none of them is beyond U."""
    x_all, y_all = axes[0][rows], axes[1][rows]
    x, y, z = lay_out(x_all, y_all, signal.display(found.value[rows]))
    _, _, beyond = lay_out(x_all, y_all, np.where(found.compared, found.beyond, np.nan)[rows])
    names = names_in_cells(x_all, y_all, versus.at.name[rows])
    return SpeedMap(x, y, z, *labels, label, beyond == 0.0, diverging=True, title=title, points=names)


def load_figure(versus: Versus) -> Figure | None:
    """Losses of the engaged points against sun speed, a series for each load."""
    at = versus.at
    panels = []
    for signal, label in ((signals.LOSS_TOTAL, LOSS), (signals.LOSS_MAGNETIC, MAGNETIC)):
        found = versus.quantities.get(signal.name)
        if found is None:
            continue
        series = []
        for i, (load, rows) in enumerate(by_load(at)):
            chosen = np.asarray(rows & found.compared)
            if chosen.any():
                x = SPEED_SUN.display(np.abs(at.speed_sun[chosen]))
                y, u = signal.display(found.value[chosen]), found.u[chosen] / signal.scale
                series.append(Series(load, x, y, u, "markers", i, points=names_of(at.name[chosen])))
        panels.append(Chart(SPEED_SUN.label, label, tuple(series), (("", 0.0),), "Load", signal.meaning))
    if not panels:
        return None
    total = versus.quantities[signals.LOSS_TOTAL.name]
    caption = (
        f"Total loss beyond U at {int(total.beyond.sum())} of {int(total.compared.sum())} points; bars are U = 2u, "
        "with what both campaigns do not share of the transducers and curves."
    )
    return Figure("loss-differences", "Losses, B − A, by speed and load", caption, tuple(panels), columns=2)


def follow_figure(versus: Versus) -> Figure:
    """Torque differences against the shaft's own speed, its torque, and the time of the test in A."""
    at = versus.at
    sun, ring = versus.quantities["torque_sun"], versus.quantities["torque_ring"]
    groups = (
        ("sun, neutral", at.neutral, sun, at.speed_sun, SPEED_SUN),
        ("ring, neutral", at.neutral, ring, at.speed_ring, SPEED_RING),
        ("sun, engaged", at.engaged, sun, at.speed_sun, SPEED_SUN),
        ("sun, zero checks", at.zero, sun, at.speed_sun, SPEED_SUN),
        ("ring, zero checks", at.zero, ring, at.speed_ring, SPEED_RING),
    )
    hours = (at.started_at - np.nanmin(at.started_at)) / (60.0 * MINUTE) if at.ordered else None
    panels = []
    for label in ("speed of the shaft [rpm]", "torque of the shaft in A [N m]", "time of the test in A [h]"):
        series = []
        for i, (name, rows, found, speed, signal) in enumerate(groups):
            chosen = np.asarray(rows & found.compared)
            if not chosen.any() or (label.startswith("time") and hours is None):
                continue
            x = signal.display(speed) if label.startswith("speed") else found.a if hours is None else hours
            x = found.a if label.startswith("torque") else x
            y, own = RESIDUAL.display(found.value[chosen]), found.own[chosen] / RESIDUAL.scale
            series.append(Series(name, x[chosen], y, own, "markers", i, points=names_of(at.name[chosen])))
        if series:
            panels.append(Chart(label, "torque, B − A [mN m]", tuple(series), (("", 0.0),)))
    caption = (
        "Bars are twice the independent part alone, so that what a cause leaves shows as a trend; what all points "
        "share shifts or tilts a whole group."
    )
    return Figure("follows", "What the differences follow", caption, tuple(panels), columns=len(panels))


def curve_figure(curves: tuple[CurveDifference, ...]) -> Figure:
    """Fitted loss curves, B minus A."""
    panels, lines = [], []
    for i, curve in enumerate(curves):
        signal = SPEEDS[curve.shaft]
        x, y, u = signal.display(curve.speed), RESIDUAL.display(curve.value), curve.u / RESIDUAL.scale
        series = Series(f"{curve.shaft}, B − A", x, y, u, "line", i)
        panels.append(Chart(signal.label, f"{curve.shaft} loss torque, B − A [mN m]", (series,), (("", 0.0),)))
        at_top = numerals.measured(float(y[-1]), 2.0 * float(u[-1]))
        lines.append(f"{at_top} mN m at {x[-1]:.0f} rpm ({curve.shaft})")
    caption = f"Loss curves of the bearings, B − A: {', '.join(lines)}; bands are U = 2u."
    return Figure("curve-differences", "Loss curves, B − A", caption, tuple(panels), columns=2)

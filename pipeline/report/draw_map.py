"""Maps over the test grid: one cell per test point, at the speeds that were set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import Normalize, to_rgb
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from pmg.pipeline.report import mapgrid
from pmg.pipeline.report.axes import axes
from pmg.pipeline.report.sheet import POINTS, text_width
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.figure import SpeedMap
    from pmg.pipeline.report.mapgrid import Masked
    from pmg.pipeline.report.sheet import Sheet
    from pmg.sim.signals import Array, Mask


def height(chart: SpeedMap, sheet: Sheet) -> float:
    """Height that a map asks for [in]."""
    return 0.56 * sheet.width + 0.8 + (0.3 if chart.title else 0.0)


def draw(chart: SpeedMap, box: SubFigure, sheet: Sheet) -> None:
    """The map inside a part of a figure."""
    if chart.relief:
        _relief(chart, box, sheet)
        return
    ax = axes(box, chart.title, chart.x_label, chart.y_label, sheet)
    z = mapgrid.known(chart)
    edges_x, edges_y = mapgrid.edges(chart.x), mapgrid.edges(chart.y)
    scale, shades = _scale(z, chart.diverging), mapgrid.shades(chart.diverging)
    ax.add_patch(
        Rectangle(
            (edges_x[0], edges_y[0]),
            np.ptp(edges_x),
            np.ptp(edges_y),
            facecolor=sheet.palette["missing"],
            linewidth=0,
            zorder=0.5,
        )
    )
    cells = ax.pcolormesh(edges_x, edges_y, z, cmap=shades, norm=scale, edgecolor=sheet.palette["paper"], linewidth=0.4)
    ax.set(xlim=edges_x[[0, -1]], ylim=edges_y[[0, -1]])
    hatched = mapgrid.hatched(chart, z)
    _hatch(ax, hatched, edges_x, edges_y)
    _contours(ax, chart, z, sheet)
    bar = box.colorbar(
        cells,
        ax=ax,
        location="right",
        aspect=30,
        fraction=0.05,
        boundaries=np.linspace(scale.vmin or 0.0, scale.vmax or 0.0, mapgrid.SHADES + 1),
        ticks=MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]),
        pad=0.03,
    )
    bar.outline.set_visible(False)
    bar.solids.set(edgecolor="face", linewidth=0.3)  # type: ignore[union-attr]
    bar.ax.tick_params(colors=sheet.palette["muted"], labelcolor=sheet.palette["ink"], labelsize=sheet.small)
    bar.set_label(chart.z_label, size=sheet.letters, color=sheet.palette["ink"])
    _key(box, chart, z, hatched, sheet)
    room = (0.76 * sheet.width, 0.5 * height(chart, sheet))
    _ticks(ax.xaxis, chart.x, edges_x, room[0], sheet, across=True)
    _ticks(ax.yaxis, chart.y, edges_y, room[1], sheet, across=False)
    if chart.annotate:
        _annotate(ax, chart, z, hatched, room, sheet)


def _relief(chart: SpeedMap, box: SubFigure, sheet: Sheet) -> None:
    """The map as a surface in three dimensions, a point at each value."""
    paint, z = sheet.palette, mapgrid.known(chart)
    ax: Any = box.add_subplot(projection="3d", computed_zorder=False)
    ax.set_facecolor("none")
    across, up = np.meshgrid(chart.x, chart.y)
    height = np.ma.filled(z, np.nan)
    shades, scale = mapgrid.shades(chart.diverging), _scale(z, chart.diverging)
    if min(z.shape) > 1:
        look: dict[str, Any] = {"cmap": shades, "norm": scale, "edgecolor": paint["paper"], "linewidth": 0.3}
        ax.plot_surface(across, up, height, rstride=1, cstride=1, **look)
    kept = ~np.ma.getmaskarray(z)
    ax.plot(across[kept], up[kept], height[kept], linestyle="none", marker="o", markersize=1.6, color=paint["ink"])
    for axis, label in ((ax.xaxis, chart.x_label), (ax.yaxis, chart.y_label), (ax.zaxis, chart.z_label)):
        axis.set_pane_color((0.0, 0.0, 0.0, 0.0))
        axis.line.set_color(paint["muted"])
        axis.set_major_locator(MaxNLocator(5))
        axis.set_label_text(label, size=sheet.small, color=paint["ink"])
        axis.labelpad = 2.0
        axis._axinfo["grid"] |= {"color": paint["rule"], "linewidth": 0.6}
    ax.tick_params(labelsize=sheet.small - 1.0, labelcolor=paint["ink"], color=paint["muted"], pad=0.0)
    ax.view_init(*mapgrid.VIEW)
    ax.set_box_aspect((1.0, 1.0, 0.8), zoom=0.86)
    if chart.title:
        ax.set_title(chart.title, loc="left", size=sheet.letters + 1.0, weight="bold", color=paint["ink"], pad=0.0)


def _scale(z: Masked, diverging: bool) -> Normalize:
    return Normalize(*mapgrid.limits(z, diverging))


def _hatch(ax: Axes, hatched: Mask, edges_x: Array, edges_y: Array) -> None:
    for row, column in np.argwhere(hatched):
        corner = (edges_x[column], edges_y[row])
        size = (edges_x[column + 1] - corner[0], edges_y[row + 1] - corner[1])
        ax.add_patch(
            Rectangle(corner, *size, fill=False, hatch="/////", edgecolor=mapgrid.HATCHING, linewidth=0.0, zorder=1.5)
        )


def _contours(ax: Axes, chart: SpeedMap, z: Masked, sheet: Sheet) -> None:
    """Lines of equal value between cell centres, as far as the measured values reach."""
    levels = mapgrid.levels(chart, z)
    if levels:
        scale, shades = _scale(z, chart.diverging), mapgrid.shades(chart.diverging)
        colours = [mapgrid.against(to_rgb(shades(scale(level)))) for level in levels]
        lines = ax.contour(chart.x, chart.y, z, levels=levels, colors=colours, linewidths=0.9, linestyles="solid")
        ax.clabel(lines, fmt=numerals.number, fontsize=sheet.small)


def _key(box: SubFigure, chart: SpeedMap, z: Masked, hatched: Mask, sheet: Sheet) -> None:
    """Legend of grey and hatched cells, where there are any."""
    entries = []
    if np.ma.getmaskarray(z).any():
        entries.append((Patch(facecolor=sheet.palette["missing"]), "not measured"))
    if hatched.any():
        patch = Patch(facecolor="#f4f4f4", hatch="/////", edgecolor=mapgrid.HATCHING, linewidth=0.0)
        entries.append((patch, chart.hatch_meaning))
    if entries:
        box.legend(
            [patch for patch, _ in entries],
            [text for _, text in entries],
            loc="outside lower left",
            ncols=len(entries),
            fontsize=sheet.small,
            labelcolor=sheet.palette["ink"],
            handlelength=1.8,
            handleheight=1.1,
        )


def _ticks(axis: Axis, values: Array, edges: Array, room: float, sheet: Sheet, *, across: bool) -> None:
    """A tick at each value that was set, labelled as long as the labels keep their distance."""
    labels = [numerals.number(float(value)) for value in values]
    per_inch = np.ptp(edges) / room
    taken, kept = -np.inf, []
    for value, label in zip(values, labels, strict=True):
        size = text_width(label, sheet.small) + 0.08 if across else sheet.line
        if value - size / 2 * per_inch >= taken:
            kept.append((float(value), label))
            taken = value + size / 2 * per_inch
    axis.set_ticks([value for value, _ in kept], [label for _, label in kept])
    axis.set_ticks(np.asarray(values, dtype=np.float64), minor=True)


def _annotate(
    ax: Axes,
    chart: SpeedMap,
    z: Masked,
    hatched: Mask,
    room: tuple[float, float],
    sheet: Sheet,
) -> None:
    """The values inside their cells, all with the same digits, wherever they fit."""
    size = sheet.small - 1.5
    widths = np.diff(mapgrid.edges(chart.x)) / np.ptp(mapgrid.edges(chart.x)) * room[0]
    heights = np.diff(mapgrid.edges(chart.y)) / np.ptp(mapgrid.edges(chart.y)) * room[1]
    shades, scale = mapgrid.shades(chart.diverging), _scale(z, chart.diverging)
    for (row, column), text in mapgrid.lettering(z).items():
        if text_width(text, size) + 0.04 > widths[column] or heights[row] < 1.25 * size / POINTS:
            continue
        cell = to_rgb(shades(scale(z[row, column])))
        ax.text(
            chart.x[column],
            chart.y[row],
            text,
            size=size,
            ha="center",
            va="center",
            color=mapgrid.against(cell),
            bbox={"facecolor": cell, "edgecolor": "none", "pad": 0.8} if hatched[row, column] else None,
        )

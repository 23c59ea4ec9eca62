"""Maps over the test grid: one cell per test point, at the speeds that were set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import matplotlib
import numpy as np
from matplotlib.colors import Normalize, to_rgb
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from pmg.pipeline.report import numerals
from pmg.pipeline.report.axes import axes
from pmg.pipeline.report.sheet import POINTS, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.colors import Colormap
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.figure import SpeedMap
    from pmg.pipeline.report.sheet import Sheet
    from pmg.sim.signals import Array, Mask

    Masked: TypeAlias = np.ma.MaskedArray[tuple[Any, ...], np.dtype[np.float64]]

_SHADES = 47
"""Shades of a scale; an odd number has a neutral middle."""
_FIXED_DARK, _FIXED_LIGHT = "#14181c", "#ffffff"
"""Text inside cells; cells keep their colours on a dark page, so it does as well."""


def height(chart: SpeedMap, sheet: Sheet) -> float:
    """Height that a map asks for [in]."""
    return (0.86 if sheet.phone else 0.56) * sheet.width + 0.8 + (0.3 if chart.title else 0.0)


def draw(chart: SpeedMap, box: SubFigure, sheet: Sheet) -> None:
    """The map inside a part of a figure."""
    ax = axes(box, chart.title, chart.x_label, chart.y_label, sheet)
    z = np.ma.masked_invalid(np.asarray(chart.z, dtype=np.float64))
    edges_x, edges_y = _edges(chart.x), _edges(chart.y)
    scale, shades = _scale(z, chart.diverging), _shades(chart.diverging)
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
    hatched = np.zeros(z.shape, dtype=bool) if chart.hatch is None else chart.hatch & ~np.ma.getmaskarray(z)
    _hatch(ax, hatched, edges_x, edges_y)
    _contours(ax, chart, z, sheet)
    bar = box.colorbar(
        cells,
        ax=ax,
        location="bottom" if sheet.phone else "right",
        aspect=30,
        fraction=0.05,
        boundaries=np.linspace(scale.vmin or 0.0, scale.vmax or 0.0, _SHADES + 1),
        ticks=MaxNLocator(5 if sheet.phone else 7, steps=[1, 2, 2.5, 5, 10]),
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


def _edges(centres: Array) -> Array:
    """Borders between cells: half way to the neighbour, and as far beyond the outermost centres."""
    values = np.asarray(centres, dtype=np.float64)
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _scale(z: Masked, diverging: bool) -> Normalize:
    values = z.compressed()
    if not len(values):
        return Normalize(-1.0, 1.0)
    if diverging:
        reach = float(np.abs(values).max()) or 1.0
        return Normalize(-reach, reach)
    low, high = float(values.min()), float(values.max())
    return Normalize(low, high) if high > low else Normalize(low - (abs(low) or 1.0) / 2, low + (abs(low) or 1.0) / 2)


def _shades(diverging: bool) -> Colormap:
    return matplotlib.colormaps["RdBu_r" if diverging else "viridis"].resampled(_SHADES)


def _hatch(ax: Axes, hatched: Mask, edges_x: Array, edges_y: Array) -> None:
    for row, column in np.argwhere(hatched):
        corner = (edges_x[column], edges_y[row])
        size = (edges_x[column + 1] - corner[0], edges_y[row + 1] - corner[1])
        ax.add_patch(
            Rectangle(corner, *size, fill=False, hatch="/////", edgecolor="#5a5a5a", linewidth=0.0, zorder=1.5)
        )


def _contours(ax: Axes, chart: SpeedMap, z: Masked, sheet: Sheet) -> None:
    """Lines of equal value between cell centres, as far as the measured values reach."""
    values = z.compressed()
    if min(z.shape) < 2 or not len(values):
        return
    levels = sorted(level for level in set(chart.contours) if values.min() < level < values.max())
    if levels:
        scale, shades = _scale(z, chart.diverging), _shades(chart.diverging)
        colours = [_against(to_rgb(shades(scale(level)))) for level in levels]
        lines = ax.contour(chart.x, chart.y, z, levels=levels, colors=colours, linewidths=0.9, linestyles="solid")
        ax.clabel(lines, fmt=numerals.number, fontsize=sheet.small)


def _key(box: SubFigure, chart: SpeedMap, z: Masked, hatched: Mask, sheet: Sheet) -> None:
    """What grey and hatched cells mean, where there are any."""
    entries = []
    if np.ma.getmaskarray(z).any():
        entries.append((Patch(facecolor=sheet.palette["missing"]), "not measured"))
    if hatched.any():
        patch = Patch(facecolor="#f4f4f4", hatch="/////", edgecolor="#5a5a5a", linewidth=0.0)
        entries.append((patch, chart.hatch_meaning))
    if entries:
        box.legend(
            [patch for patch, _ in entries],
            [text for _, text in entries],
            loc="outside lower left",
            ncols=1 if sheet.phone else len(entries),
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
    values = z.compressed()
    if not len(values):
        return
    size = sheet.small - 1.5
    digits = max(0, 1 - int(np.floor(np.log10(np.abs(values).max() or 1.0))))
    texts = {(int(r), int(c)): numerals.number(float(z[r, c]), digits) for r, c in np.argwhere(~np.ma.getmaskarray(z))}
    widths = np.diff(_edges(chart.x)) / np.ptp(_edges(chart.x)) * room[0]
    heights = np.diff(_edges(chart.y)) / np.ptp(_edges(chart.y)) * room[1]
    shades, scale = _shades(chart.diverging), _scale(z, chart.diverging)
    for (row, column), text in texts.items():
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
            color=_against(cell),
            bbox={"facecolor": cell, "edgecolor": "none", "pad": 0.8} if hatched[row, column] else None,
        )


def _against(rgb: tuple[float, float, float]) -> str:
    """Dark or light lettering, whichever stands out more from a colour."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
    luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    return _FIXED_LIGHT if luminance < 0.18 else _FIXED_DARK

"""Maps over the test grid as Plotly takes them: cells, lines of equal value, hatching, and the point behind a cell."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_hex

from pmg.pipeline.report import mapgrid
from pmg.pipeline.report.live_axes import axis, layout, numbers, plain
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from pmg.pipeline.report.figure import SpeedMap
    from pmg.pipeline.report.mapgrid import Masked
    from pmg.sim.signals import Array

_COLOURS = 13
"""Colours by which a scale is drawn; between them the page interpolates."""
_ACROSS, _UP = 0.055, 0.05
"""Least distance of labels along an axis, in parts of its length, for a map as wide as the page."""
_BESIDE = 24
"""Most letters of a line next to the scale."""
_OF_SURFACE = ("x", "y", "z", "zmin", "zmax", "colorscale")
"""What a surface has in common with the cells of a map."""
_AWAY = 2.2
"""Distance from which it is seen, in lengths of its box."""
_LETTERED = 160
"""Most cells whose values are written into them."""


def plot(chart: SpeedMap, columns: int) -> dict[str, Any]:
    """The traces and the layout of a map that stands in one of so many columns."""
    z = mapgrid.known(chart)
    if chart.relief:
        return _relief(chart, z)
    hatched = mapgrid.hatched(chart, z)
    traces = [_cells(chart, z)]
    levels = mapgrid.levels(chart, z)
    traces += [_contour(chart, z, level) for level in levels]
    if hatched.any():
        traces.append(_hatching(chart, hatched))
    if np.ma.getmaskarray(z).any():
        traces.append(_key("not measured", {"symbol": "square", "size": 12, "color": "@missing"}))
    of = layout(
        chart.title,
        plot_bgcolor="@missing",
        barmode="overlay",
        xaxis=_speeds(chart.x, chart.x_label, _ACROSS * columns),
        yaxis=_speeds(chart.y, chart.y_label, _UP),
        showlegend=len(traces) > 1 + len(levels),
        legend={"orientation": "h", "yref": "container", "y": 0.0, "yanchor": "bottom", "x": 0.0, "itemclick": False}
        | {"itemdoubleclick": False},
    )
    lines = [[numerals.number(float(value)) if np.isfinite(value) else None for value in row] for row in chart.z]
    return {
        "kind": "map",
        "data": traces,
        "layout": of,
        "x": numbers(chart.x),
        "y": numbers(chart.y),
        "x_edges": numbers(mapgrid.edges(chart.x)),
        "y_edges": numbers(mapgrid.edges(chart.y)),
        "x_label": chart.x_label,
        "y_label": chart.y_label,
        "z_label": chart.z_label,
        "told": lines,
        "points": [list(row) for row in chart.points],
    }


def _relief(chart: SpeedMap, z: Masked) -> dict[str, Any]:
    """The map as a surface that can be turned, a point at each value."""
    rows, columns = np.nonzero(~np.ma.getmaskarray(z))
    hover = "<br>".join(
        f"{plain(label)}: %{{{axis_name}}}"
        for label, axis_name in ((chart.x_label, "x"), (chart.y_label, "y"), (chart.z_label, "z"))
    )
    surface = {name: value for name, value in _cells(chart, z).items() if name in _OF_SURFACE}
    surface |= {"type": "surface", "cmin": surface.pop("zmin"), "cmax": surface.pop("zmax"), "showscale": False}
    points = {
        "type": "scatter3d",
        "mode": "markers",
        "x": numbers(chart.x[columns]),
        "y": numbers(chart.y[rows]),
        "z": numbers(z[rows, columns]),
        "marker": {"size": 2.5, "color": "@ink"},
        "hovertemplate": f"{hover}<extra></extra>",
    }
    if chart.points:
        points["customdata"] = [chart.points[row][column] for row, column in zip(rows, columns, strict=True)]
    labels = {"xaxis": chart.x_label, "yaxis": chart.y_label, "zaxis": chart.z_label}
    scene: dict[str, Any] = {
        name: {
            "title": {"text": plain(label)},
            "gridcolor": "@rule",
            "color": "@ink",
            "nticks": 5,
            "showbackground": False,
        }
        for name, label in labels.items()
    }
    turn, rise = (np.radians(angle) for angle in (mapgrid.VIEW[1], mapgrid.VIEW[0]))
    level = _AWAY * float(np.cos(rise))
    eye = {"x": level * float(np.cos(turn)), "y": level * float(np.sin(turn)), "z": _AWAY * float(np.sin(rise))}
    scene |= {"camera": {"eye": eye, "center": {"x": 0.0, "y": 0.0, "z": -0.15}}}
    scene |= {"aspectmode": "manual", "aspectratio": {"x": 1.0, "y": 1.0, "z": 0.8}}
    of = layout(chart.title, scene=scene, showlegend=False, margin={"l": 0, "r": 0, "t": 34, "b": 0})
    return {"kind": "surface", "data": [surface | {"hoverinfo": "skip"}, points], "layout": of}


def _speeds(values: Array, label: str, apart: float) -> dict[str, Any]:
    """An axis with a tick at each value that was set, labelled where the labels keep their distance."""
    ends = mapgrid.edges(values)[[0, -1]]
    labelled: list[float] = []
    for value in map(float, values):
        if not labelled or value - labelled[-1] >= apart * (ends[1] - ends[0]):
            labelled.append(value)
    return axis(
        label,
        range=[float(end) for end in ends],
        tickvals=labelled,
        tickangle=0,
        showgrid=False,
        minor={"tickvals": numbers(values), "ticks": "outside", "ticklen": 3, "tickcolor": "@muted"},
    )


def _cells(chart: SpeedMap, z: Masked) -> dict[str, Any]:
    low, high = mapgrid.limits(z, chart.diverging)
    shades = mapgrid.shades(chart.diverging)
    scale = [[float(f"{at:.4g}"), to_hex(shades(at))] for at in np.linspace(0.0, 1.0, _COLOURS)]
    trace: dict[str, Any] = {
        "type": "heatmap",
        "x": numbers(chart.x),
        "y": numbers(chart.y),
        "z": [numbers(row) for row in np.ma.filled(z, np.nan)],
        "zmin": low,
        "zmax": high,
        "colorscale": scale,
        "xgap": 1,
        "ygap": 1,
        "hoverongaps": False,
        "hovertemplate": f"{plain(chart.x_label)}: %{{x}}<br>{plain(chart.y_label)}: %{{y}}<br>"
        f"<b>{plain(chart.z_label)}: %{{z}}</b><extra></extra>",
        "colorbar": {
            "title": {"text": "<br>".join(wrap(plain(chart.z_label), _BESIDE)), "side": "right"},
            "outlinewidth": 0,
            "thickness": 14,
        },
    }
    if chart.annotate and z.size <= _LETTERED:
        texts = mapgrid.lettering(z)
        trace["text"] = [[texts.get((row, column), "") for column in range(z.shape[1])] for row in range(z.shape[0])]
        trace["texttemplate"] = "%{text}"
        trace["textfont"] = {"size": 9}
    if chart.points:
        trace["customdata"] = [list(row) for row in chart.points]
    return trace


def _contour(chart: SpeedMap, z: Masked, level: float) -> dict[str, Any]:
    """One line of equal value, in the lettering colour that stands out from the cells it runs over."""
    low, high = mapgrid.limits(z, chart.diverging)
    shade = mapgrid.shades(chart.diverging)((level - low) / (high - low))
    return {
        "type": "contour",
        "x": numbers(chart.x),
        "y": numbers(chart.y),
        "z": [numbers(row) for row in np.ma.filled(z, np.nan)],
        "contours": {
            "coloring": "none",
            "start": level,
            "end": level,
            "size": 1.0,
            "showlabels": not (chart.annotate and z.size <= _LETTERED),
            "labelfont": {"size": 10, "color": mapgrid.against(shade[:3])},
        },
        "line": {"color": mapgrid.against(shade[:3]), "width": 1, "smoothing": 0},
        "connectgaps": False,
        "showscale": False,
        "showlegend": False,
        "hoverinfo": "skip",
    }


def _hatching(chart: SpeedMap, hatched: np.ndarray[Any, np.dtype[np.bool_]]) -> dict[str, Any]:
    """Bars without a colour of their own over the hatched cells."""
    rows, columns = np.nonzero(hatched)
    wide, tall = mapgrid.edges(chart.x), mapgrid.edges(chart.y)
    return {
        "type": "bar",
        "x": numbers((wide[columns] + wide[columns + 1]) / 2),
        "width": numbers(wide[columns + 1] - wide[columns]),
        "base": numbers(tall[rows]),
        "y": numbers(tall[rows + 1] - tall[rows]),
        "marker": {
            "color": "rgba(0,0,0,0)",
            "line": {"width": 0},
            "pattern": {
                "shape": "/",
                "fgcolor": mapgrid.HATCHING,
                "bgcolor": "rgba(0,0,0,0)",
                "size": 7,
                "solidity": 0.16,
            },
        },
        "name": plain(chart.hatch_meaning),
        "showlegend": True,
        "hoverinfo": "skip",
    }


def _key(name: str, marker: dict[str, Any]) -> dict[str, Any]:
    """An entry of the legend alone."""
    return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": name, "marker": marker}

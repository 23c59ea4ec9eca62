"""Charts as Plotly takes them: one colour a name, switched on and off together in all its groups."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.report.figure import stacked
from pmg.pipeline.report.live_axes import axis, layout, numbers, plain
from pmg.pipeline.report.theme import SERIES
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.probability import COVERAGE_FACTOR

if TYPE_CHECKING:
    from pmg.pipeline.report.figure import Chart, Series
    from pmg.sim.signals import Array

_MARKERS = ("circle", "square", "diamond", "triangle-down", "triangle-up", "pentagon", "x", "star")
_DASHES = ("solid", "dash", "dot", "dashdot")


def plot(chart: Chart) -> dict[str, Any]:
    """The traces and the layout of a chart."""
    groups = list(dict.fromkeys(series.group for series in chart.series))
    listed: set[str] = set()
    traces: list[dict[str, Any]] = []
    feet = stacked(chart)
    for place, series in enumerate(chart.series):
        made = _traces(chart, series, groups.index(series.group), first=series.name not in listed)
        traces += [_as_bars(made[-1], *feet[place])] if place in feet else made
        listed.add(series.name)
    heading = _heading(chart.legend_title, chart.series)
    of = layout(
        chart.title,
        xaxis=axis(chart.x_label, **_range(chart.x_limits, chart.x_log)),
        yaxis=axis(chart.y_label, **_range(chart.y_limits, chart.y_log)),
        shapes=[_line(value) for _, value in chart.references_shown],
        annotations=[_note(label, value, chart.y_log) for label, value in chart.references_shown if label],
        showlegend=any(series.name for series in chart.series),
        legend={
            "orientation": "h",
            "yref": "container",
            "y": 0.0,
            "yanchor": "bottom",
            "x": 0.0,
            "groupclick": "togglegroup",
            "title": {"text": heading, "side": "top"},
        },
    )
    if feet:
        of["barmode"] = "overlay"
    return {"kind": "chart", "data": traces, "layout": of}


def _as_bars(trace: dict[str, Any], foot: Array, width: float) -> dict[str, Any]:
    """The trace of a series as bars on their feet."""
    kept = {name: value for name, value in trace.items() if name not in ("mode", "line")}
    bar = {"type": "bar", "textposition": "none", "marker": {"color": trace["marker"]["color"]}}
    return kept | bar | {"base": numbers(foot), "width": width}


def _heading(title: str, series: tuple[Series, ...]) -> str:
    """Heading of the legend and, where there are several groups, what each looks like."""
    styles: dict[str, set[str]] = {}
    for one in series:
        if one.group:
            styles.setdefault(one.group, set()).add(one.style)
    if len(styles) < 2:
        return plain(title)
    looks = [f"{_look(place, found)}: {group}" for place, (group, found) in enumerate(styles.items())]
    return "<br>".join(plain(part) for part in (title, "; ".join(looks)) if part)


def _look(place: int, styles: set[str]) -> str:
    """Styles of the series of a group."""
    line = f"{('solid', 'dashed', 'dotted', 'dash-dotted')[place % len(_DASHES)]} lines"
    markers = "hollow markers" if place else "filled markers"
    return " and ".join(
        part for part, used in ((markers, {"markers", "both"}), (line, {"line", "both"})) if styles & used
    )


def _range(limits: tuple[float, float] | None, logarithmic: bool) -> dict[str, Any]:
    way: dict[str, Any] = {"type": "log", "exponentformat": "power", "minexponent": 5} if logarithmic else {}
    if limits is not None:
        way["range"] = [float(np.log10(limit)) if logarithmic else limit for limit in limits]
    return way


def _line(value: float) -> dict[str, Any]:
    return {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": value,
        "y1": value,
        "line": {"color": "@ink", "width": 1, "dash": "dash"},
    }


def _note(label: str, value: float, logarithmic: bool) -> dict[str, Any]:
    return {
        "text": plain(label),
        "xref": "paper",
        "x": 1,
        "xanchor": "right",
        "y": float(np.log10(value)) if logarithmic else value,
        "yanchor": "bottom",
        "showarrow": False,
    }


def _traces(chart: Chart, series: Series, group: int, *, first: bool) -> list[dict[str, Any]]:
    """The series and, for a band or a line with uncertainty, the area around it."""
    colour = f"@series-{series.colour % SERIES}"
    x, y = _positive(series.x, chart.x_log), _positive(series.y, chart.y_log)
    family = {
        "legendgroup": series.name or f"unnamed {series.colour}",
        "showlegend": bool(series.name) and first,
        "name": plain(series.name),
    }
    reach = None if series.u is None else COVERAGE_FACTOR * np.asarray(series.u, dtype=np.float64)
    traces: list[dict[str, Any]] = []
    if series.style in ("band", "line") and reach is not None:
        known = np.isfinite(x) & np.isfinite(y) & np.isfinite(reach)
        around = np.concatenate([y[known] - reach[known], (y[known] + reach[known])[::-1]])
        traces.append(
            family
            | {
                "type": "scatter",
                "x": numbers(np.concatenate([x[known], x[known][::-1]])),
                "y": numbers(_positive(around, chart.y_log)),
                "fill": "toself",
                "fillcolor": f"{colour}/0.22",
                "line": {"width": 0},
                "mode": "lines",
                "hoverinfo": "skip",
            }
        )
    if series.style == "band":
        return traces
    trace: dict[str, Any] = family | {
        "type": "scatter",
        "mode": {"markers": "markers", "line": "lines", "both": "lines+markers"}.get(series.style, "none"),
        "x": numbers(x),
        "y": numbers(y),
        "line": {"color": colour, "width": 2, "dash": _DASHES[group % len(_DASHES)]},
        "marker": {"color": colour, "size": 7, "symbol": _MARKERS[series.colour % len(_MARKERS)] + _hollow(group)},
        "hovertemplate": _hover(chart, series),
        "text": [
            _point_text(value, u)
            for value, u in zip(y, np.full(len(y), np.nan) if reach is None else reach, strict=True)
        ],
    }
    if traces:
        trace["showlegend"] = False
    if reach is not None and series.style != "line":
        trace["error_y"] = {"array": numbers(reach), "color": colour, "thickness": 1, "width": 2}
    if series.points:
        trace["customdata"] = list(series.points)
        trace["hovertext"] = [plain(name) for name in series.points]
    return [*traces, trace]


def _hollow(group: int) -> str:
    return "-open" if group else ""


def _positive(values: Array, logarithmic: bool) -> Array:
    given = np.asarray(values, dtype=np.float64)
    return np.where(given > 0.0, given, np.nan) if logarithmic else given


def _point_text(value: float, expanded: float) -> str:
    if not np.isfinite(value):
        return ""
    return numerals.measured(float(value), float(expanded)) if expanded > 0.0 else numerals.number(float(value))


def _hover(chart: Chart, series: Series) -> str:
    words = [part for part in (series.group, series.name) if part]
    lines = [f"<b>{plain(' '.join(words))}</b>"] if words else []
    if series.points:
        lines.append("%{hovertext}")
    lines += [f"{plain(chart.x_label)}: %{{x}}", f"{plain(chart.y_label)}: %{{text}}"]
    return "<br>".join(lines) + "<extra></extra>"

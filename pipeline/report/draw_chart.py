"""Charts: points with their uncertainty, lines, bands and reference lines."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogFormatter

from pmg.pipeline.report.axes import axes, fitted
from pmg.pipeline.report.figure import stacked
from pmg.pipeline.report.sheet import text_width
from pmg.pipeline.wording.probability import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.figure import Chart, Series
    from pmg.pipeline.report.sheet import Sheet
    from pmg.sim.signals import Array

_MARKERS = "osD^vPX*"
_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
_HANDLE = 0.62
"""Width of a legend's sample and the space around it [in]."""


def height(chart: Chart, sheet: Sheet) -> float:
    """Height that a chart asks for [in]."""
    entries = _legend_rows(chart, sheet)
    body = 2.3 + 0.12 * sheet.width
    return body + 0.6 + entries * sheet.line + (0.3 if chart.title else 0.0)


def draw(chart: Chart, box: SubFigure, sheet: Sheet) -> None:
    """The chart inside a part of a figure."""
    remark = _remark(chart)
    ax = axes(box, chart.title, chart.x_label, chart.y_label, sheet, remark)
    ax.grid(color=sheet.palette["rule"])
    if chart.x_log:
        ax.set_xscale("log")
        _plain_decades(ax.xaxis, sheet)
    if chart.y_log:
        ax.set_yscale("log")
        _plain_decades(ax.yaxis, sheet)
    if chart.x_limits:
        ax.set_xlim(*chart.x_limits)
    if chart.y_limits:
        ax.set_ylim(*chart.y_limits)
    for label, value in chart.references_shown:
        _reference(ax, chart, label, value, sheet)
    groups, feet = _groups(chart), stacked(chart)
    handles = [
        _bars(ax, series, *feet[place], sheet)
        if place in feet
        else _series(ax, _on_scale(chart, series), groups.index(series.group), sheet)
        for place, series in enumerate(chart.series)
    ]
    _legend(box, chart, handles, sheet)


def _plain_decades(axis: Axis, sheet: Sheet) -> None:
    """Plain numbers at the decades of a logarithmic axis, and between them where there are few."""
    paint = sheet.palette
    axis.set_major_formatter(FuncFormatter(_plain))
    axis.set_minor_formatter(_FewDecades())
    look: dict[str, Any] = {"color": paint["muted"], "labelcolor": paint["ink"], "labelsize": sheet.small}
    axis.set_tick_params(which="minor", **look)


def _plain(value: float, _: object = None) -> str:
    return f"{value:.12g}".replace("-", "−")


class _FewDecades(LogFormatter):
    """Numbers at 2 and 5 between the decades of an axis that shows less than two of them."""

    def __call__(self, value: float, pos: int | None = None) -> str:
        """Text at a minor tick; empty for most."""
        low, high = sorted(self.axis.get_view_interval()) if self.axis is not None else (1.0, 1.0)
        leading = f"{value:.0e}"[0]
        return _plain(value) if high < 100.0 * low and leading in "25" else ""


def _on_scale(chart: Chart, series: Series) -> Series:
    """The series without what a logarithmic axis cannot show."""
    x, y = (
        np.where(values > 0.0, values, np.nan) if logarithmic else values
        for values, logarithmic in ((_finite(series.x), chart.x_log), (_finite(series.y), chart.y_log))
    )
    return replace(series, x=x, y=y)


def _groups(chart: Chart) -> list[str]:
    return list(dict.fromkeys(series.group for series in chart.series))


def _bars(ax: Axes, series: Series, foot: Array, width: float, sheet: Sheet) -> Artist:
    """Bars on their feet; what stands for them in the legend."""
    colour = sheet.palette.series(series.colour)
    bars: list[Artist] = list(ax.bar(series.x, _finite(series.y), width, foot, color=colour, zorder=1.2))
    return bars[0]


def _series(ax: Axes, series: Series, group: int, sheet: Sheet) -> Artist:
    """The series on the axes; what stands for it in the legend."""
    x, y = _finite(series.x), _finite(series.y)
    colour = sheet.palette.series(series.colour)
    reach = None if series.u is None else COVERAGE_FACTOR * _finite(series.u)
    dashes: Any = _DASHES[group % len(_DASHES)]
    if series.style in ("band", "line"):
        sample: Artist
        if reach is not None:
            sample = ax.fill_between(x, y - reach, y + reach, color=colour, alpha=0.22, linewidth=0)
        if series.style == "line":
            (sample,) = ax.plot(x, y, color=colour, linestyle=dashes)
        return sample
    look: dict[str, Any] = {
        "color": colour,
        "marker": _MARKERS[series.colour % len(_MARKERS)],
        "markerfacecolor": sheet.palette["paper"] if group else colour,
        "markeredgewidth": 1.2 if group else 0.0,
        "linestyle": dashes if series.style == "both" else "none",
    }
    if reach is not None:
        # A point whose uncertainty is not stated is drawn without a bar, not left out.
        drawn = ~np.isnan(reach) & ~np.isnan(y) & ~np.isnan(x)
        strokes: dict[str, Any] = {"color": colour, "markerfacecolor": colour, "elinewidth": 1.0, "capthick": 1.0}
        ax.errorbar(x[drawn], y[drawn], reach[drawn], fmt="none", zorder=1.9, **strokes)
    (sample,) = ax.plot(x, y, **look)
    return sample


def _reference(ax: Axes, chart: Chart, label: str, value: float, sheet: Sheet) -> None:
    low, high = sorted(chart.y_limits or (-np.inf, np.inf))
    if not low <= value <= high:
        return
    ax.axhline(value, color=sheet.palette["ink"], linewidth=1.0, linestyle=(0, (6, 3)), zorder=1.5)
    if label:
        ax.annotate(
            fitted(label, 0.18 * sheet.width, sheet.small),
            (1.0, value),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            color=sheet.palette["ink"],
            size=sheet.small,
            annotation_clip=False,
        )


def _remark(chart: Chart) -> str:
    """That nothing is shown, or how many points lie outside the axes."""
    drawn = (_on_scale(chart, series) for series in chart.series)
    points: list[Array] = [np.array([s.x, s.y]) for s in drawn]
    shown = [pair[:, ~np.isnan(pair).any(axis=0)] for pair in points]
    if not sum(pair.shape[1] for pair in shown):
        return "no data"
    outside = 0
    for pair in shown:
        beyond = np.zeros(pair.shape[1], dtype=bool)
        for values, limits in zip(pair, (chart.x_limits, chart.y_limits), strict=True):
            low, high = sorted(limits or (-np.inf, np.inf))
            beyond |= (values < low) | (values > high)
        outside += int(beyond.sum())
    return f"{outside} point{'s' if outside > 1 else ''} beyond the axes" if outside else ""


def _entries(chart: Chart) -> list[list[str]]:
    """Names in the legend, one list per group, its heading first where it has one."""
    return [
        ([group] if group else []) + [s.name for s in chart.series if s.group == group and s.name]
        for group in _groups(chart)
    ]


def _legend_columns(chart: Chart, sheet: Sheet) -> int:
    lists = _entries(chart)
    names = [name for names in lists for name in names]
    widest = max((text_width(name, sheet.small) for name in names), default=1.0) + _HANDLE
    fit = max(1, int((sheet.width - 0.2) / widest))
    if len(lists) > 1:
        return len(lists) if len(lists) <= fit else 1
    return min(fit, len(names)) or 1


def _legend_rows(chart: Chart, sheet: Sheet) -> int:
    lists, columns = _entries(chart), _legend_columns(chart, sheet)
    names = sum(map(len, lists))
    if not names:
        return 0
    rows = max(map(len, lists)) if 1 < columns == len(lists) else -(-names // columns)
    return rows + bool(chart.legend_title)


def _legend(box: SubFigure, chart: Chart, handles: list[Artist], sheet: Sheet) -> None:
    """A legend below the axes; groups stand side by side, each under its name."""
    lists, columns = _entries(chart), _legend_columns(chart, sheet)
    side_by_side = 1 < columns == len(lists)
    longest = max(map(len, lists), default=0)
    shown: list[tuple[Artist, str, bool]] = []
    nothing = Line2D([], [], color=sheet.palette["ink"], linestyle="none")
    for group, names in zip(_groups(chart), lists, strict=True):
        if group:
            shown.append((nothing, group, True))
        pairs = zip(chart.series, handles, strict=True)
        shown += [(handle, s.name, False) for s, handle in pairs if s.group == group and s.name]
        if side_by_side:
            shown += [(nothing, "", False)] * (longest - len(names))
    if not shown:
        return
    legend = box.legend(
        [handle for handle, _, _ in shown],
        [label for _, label, _ in shown],
        loc="outside lower left",
        ncols=columns,
        fontsize=sheet.small,
        labelcolor=sheet.palette["ink"],
        title=fitted(chart.legend_title, sheet.width - 0.4, sheet.small) or None,
        title_fontsize=sheet.small,
        alignment="left",
        handlelength=2.4,
        columnspacing=1.4,
    )
    legend.get_title().set_color(sheet.palette["muted"])
    for text, (_, _, heading) in zip(legend.get_texts(), shown, strict=True):
        if heading:
            text.set_fontweight("bold")


def _finite(values: Array) -> Array:
    """Numbers to draw; anything that is not finite becomes a gap."""
    given = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(given), given, np.nan)

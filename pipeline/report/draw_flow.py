"""Power flows: widths proportional to power, losses branching off downwards, gains coming in from below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.patches import PathPatch
from matplotlib.path import Path

from pmg.pipeline.report.flow_plan import MARGIN, flow_plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.figure import PowerFlow
    from pmg.pipeline.report.flow_plan import FlowArea
    from pmg.pipeline.report.sheet import Sheet

_CODES = {"M": Path.MOVETO, "L": Path.LINETO, "C": Path.CURVE4}


def height(flow: PowerFlow, sheet: Sheet) -> float:
    """Height that a power flow asks for [in]."""
    return flow_plan(flow, sheet).height


def draw(flow: PowerFlow, box: SubFigure, tall: float, sheet: Sheet) -> None:
    """The power flow inside a part of a figure that is ``tall`` inches high."""
    plan = flow_plan(flow, sheet)
    ax = box.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(0.0, sheet.width), ylim=(plan.height - tall, plan.height))
    ax.set_axis_off()
    paint, line = sheet.palette, sheet.line
    for row, words in enumerate(plan.title, 1):
        top = plan.height - row * 1.15 * line
        ax.text(MARGIN, top, words, size=sheet.letters + 1.0, weight="bold", color=paint["ink"])
    for area in plan.areas():
        _fill(ax, area, sheet)
    for arrow in plan.chevrons():
        ax.plot(*zip(*arrow, strict=True), color=paint["paper"], linewidth=1.6)
    for label in plan.labels():
        for row, (words, weight) in enumerate(label.lines):
            look: dict[str, Any] = {"size": sheet.small, "weight": weight, "color": paint[label.role]}
            ax.text(label.x, label.top - row * line, words, ha="center", va="top", **look)


def _fill(ax: Axes, area: FlowArea, sheet: Sheet) -> None:
    points = [point for _, of_step in area.outline for point in of_step]
    codes = [_CODES[step] for step, of_step in area.outline for _ in of_step]
    ax.add_patch(
        PathPatch(
            Path([*points, points[0]], [*codes, Path.CLOSEPOLY]),
            facecolor=sheet.palette[area.role],
            edgecolor=sheet.palette[area.edge],
            hatch="////////" if area.hatched else None,
            linewidth=0.6,
        )
    )

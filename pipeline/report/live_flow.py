"""Power flows as Plotly takes them: the areas and the lettering of the still drawing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.report.flow_plan import flow_plan
from pmg.pipeline.report.live_axes import layout, plain
from pmg.pipeline.report.sheet import PAPER

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.report.figure import PowerFlow
    from pmg.pipeline.report.flow_plan import FlowArea, FlowLabel, Point

LETTERS = 12
"""Size of the letters [px]."""
_PLACES = 3
"""Decimals of a place [in]."""
_LOOK = {
    "shapedefaults": {"type": "path", "layer": "below", "line": {"width": 1}},
    "annotationdefaults": {"showarrow": False, "yanchor": "top", "font": {"size": LETTERS, "color": "@ink"}},
}
"""What all areas and all letterings have in common."""


def plot(flow: PowerFlow) -> dict[str, Any]:
    """The layout of a power flow, which holds all of it; of each, where there are others to choose from."""
    margin = {"l": 12, "r": 12, "t": 34 if flow.title else 14, "b": 14}
    of = layout(flow.title, margin=margin, template={"layout": _LOOK})
    of["xaxis"] = {"visible": False, "fixedrange": True, "range": [0.0, PAPER.width]}
    if not flow.others:
        return {"kind": "flow", "data": [], "layout": of | _drawn(flow)}
    choices = [{"name": name, "caption": other.caption, "layout": _drawn(other)} for name, other in flow.others]
    shown = next((name for name, other in flow.others if other.main == flow.main), flow.others[0][0])
    return {"kind": "flow", "choices": choices, "shown": shown, "layout": of}


def _drawn(flow: PowerFlow) -> dict[str, Any]:
    """Height, areas and lettering."""
    plan = flow_plan(replace(flow, title="", others=()), PAPER)
    arrows = [{"path": " ".join(map(_open, plan.chevrons())), "line": {"color": "@paper", "width": 2.5}}]
    return {
        "yaxis": {
            "visible": False,
            "fixedrange": True,
            "scaleanchor": "x",
            "range": [0.0, round(plan.height, _PLACES)],
        },
        "shapes": [*map(_area, plan.areas()), *(arrow for arrow in arrows if arrow["path"])],
        "annotations": [_label(label) for label in plan.labels() if label.lines],
    }


def _area(area: FlowArea) -> dict[str, Any]:
    fill = f"@{area.role}/0.5" if area.hatched else f"@{area.role}"
    path = "".join(step + _points(points) for step, points in area.outline)
    return {"path": f"{path}Z", "fillcolor": fill, "line": {"color": f"@{area.edge}"}}


def _open(corners: Iterable[Point]) -> str:
    return "M" + "L".join(_points((corner,)) for corner in corners)


def _points(points: Iterable[Point]) -> str:
    return " ".join(f"{round(x, _PLACES):g},{round(y, _PLACES):g}" for x, y in points)


def _label(label: FlowLabel) -> dict[str, Any]:
    lines = (f"<b>{plain(words)}</b>" if weight == "bold" else plain(words) for words, weight in label.lines)
    found = {"x": round(label.x, _PLACES), "y": round(label.top, _PLACES), "text": "<br>".join(lines)}
    return found if label.role == "ink" else found | {"font": {"color": f"@{label.role}"}}

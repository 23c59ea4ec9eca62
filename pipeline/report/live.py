"""Figures for the page's own drawing library: the same specification as plain data that Plotly reads.

A colour is a role of `theme.ROLES` behind an at sign, ``@ink`` or ``@flow/0.5`` with its opacity; the page puts the
colour of its scheme in its place whenever that changes.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pmg.pipeline.report import live_chart, live_flow, live_map
from pmg.pipeline.report.figure import Chart, Figure, Panel, SpeedMap
from pmg.pipeline.wording.safe_text import printable_json

if TYPE_CHECKING:
    from collections.abc import Mapping


def live_json(figure: Figure) -> str:
    """Live drawing of a figure as JSON that no text in it can end early."""
    data = _live_figure(figure)
    text = printable_json(json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _live_figure(figure: Figure) -> Mapping[str, Any]:
    """Live drawing of a figure.

    Parameters
    ----------
    figure : Figure
        The specification, of which `draw.draw_all` makes its still drawings.

    Returns
    -------
    mapping
        ``columns`` and ``panels``; each panel has its ``kind``, and ``data`` and ``layout`` as Plotly takes them, or
        ``choices`` of such, each with its ``name``.
    """
    columns = min(figure.columns, len(figure.panels))
    panels = [_panel(panel, columns) for panel in figure.panels]
    for made, other in zip(panels, figure.switched, strict=False):
        made |= _switch(made, _panel(other, columns))
    return {"columns": columns, "panels": panels, "caption": figure.switched_caption}


KEPT = ("zmin", "zmax", "colorscale")
"""What a switched map shares with the other, so that the two can be compared by eye."""


def _switch(made: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """What of the other drawing differs: of each trace the values, or all traces where they are not the same ones."""
    if made["data"] == other["data"]:
        return {}
    told = {"switched_told": other["told"]} if "told" in other else {}
    old, new = made["data"], other["data"]
    if [(a["type"], a.get("name")) for a in old] != [(b["type"], b.get("name")) for b in new]:
        scale = {name: old[0][name] for name in KEPT if name in old[0]}
        return told | {"switched": [{**trace, **(scale if k == 0 else {})} for k, trace in enumerate(new)]}
    changed = [
        {name: value for name, value in b.items() if name not in KEPT and a.get(name) != value}
        for a, b in zip(old, new, strict=True)
    ]
    return told | {"changed": changed}


def _panel(panel: Panel, columns: int) -> dict[str, Any]:
    if isinstance(panel, Chart):
        return live_chart.plot(panel)
    return live_map.plot(panel, columns) if isinstance(panel, SpeedMap) else live_flow.plot(panel)

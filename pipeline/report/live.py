"""Figures for the page's own drawing library: the same specification as plain data that Plotly reads.

A colour is a role of `theme.ROLES` behind an at sign, ``@ink`` or ``@flow/0.5`` with its opacity; the page puts the
colour of its scheme in its place whenever that changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.report import live_chart, live_flow, live_map
from pmg.pipeline.report.figure import Chart, Figure, Panel, SpeedMap

if TYPE_CHECKING:
    from collections.abc import Mapping


def live_figure(figure: Figure) -> Mapping[str, Any]:
    """Live drawing of a figure.

    Parameters
    ----------
    figure : Figure
        The specification, which `draw.draw_svg` takes as well.

    Returns
    -------
    mapping
        ``columns`` and ``panels``; each panel has its ``kind``, and ``data`` and ``layout`` as Plotly takes them, or
        ``choices`` of such, each with its ``name``.
    """
    columns = min(figure.columns, len(figure.panels))
    return {"columns": columns, "panels": [_panel(panel, columns) for panel in figure.panels]}


def _panel(panel: Panel, columns: int) -> dict[str, Any]:
    if isinstance(panel, Chart):
        return live_chart.plot(panel)
    return live_map.plot(panel, columns) if isinstance(panel, SpeedMap) else live_flow.plot(panel)

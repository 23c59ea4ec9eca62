"""Parts common to all live drawings: numbers as JSON takes them, axes, fonts and margins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.report.theme import FONTS

if TYPE_CHECKING:
    from pmg.sim.signals import Array

AXIS_DIGITS = 6
"""Significant digits of a number on a drawing; tables hold the full precision."""


def numbers(values: Array) -> list[float | None]:
    """Values in a few significant digits; None where one is not finite."""
    given = np.asarray(values, dtype=np.float64)
    return [float(f"{value:.{AXIS_DIGITS}g}") if np.isfinite(value) else None for value in given]


def layout(title: str, **more: Any) -> dict[str, Any]:  # noqa: ANN401 - handed on to Plotly as they are
    """Paper, fonts and margins of a drawing with this heading."""
    of: dict[str, Any] = {
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": FONTS, "size": 12, "color": "@ink"},
        "margin": {"l": 62, "r": 14, "t": 34 if title else 14, "b": 52},
        "hoverlabel": {"bgcolor": "@soft", "bordercolor": "@rule", "font": {"color": "@ink"}, "align": "left"},
        "hovermode": "closest",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "@muted", "activecolor": "@link", "orientation": "h"},
    }
    if title:
        of["title"] = {"text": plain(title), "x": 0.0, "xref": "paper", "font": {"size": 13}}
    return of | more


def axis(label: str, **more: Any) -> dict[str, Any]:  # noqa: ANN401 - handed on to Plotly as they are
    """An axis with its label."""
    return {
        "title": {"text": plain(label), "standoff": 8},
        "gridcolor": "@rule",
        "linecolor": "@muted",
        "tickcolor": "@muted",
        "zeroline": False,
        "showline": True,
        "ticks": "outside",
        "automargin": True,
    } | more


def plain(text: str) -> str:
    """Text that Plotly, which knows a few tags, shows letter by letter."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("$", "&#36;")

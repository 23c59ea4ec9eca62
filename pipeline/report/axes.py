"""Axes in the manner of this report: quiet lines, labels in words, a heading to the left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.report.sheet import POINTS, wrapped

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.sheet import Sheet


def axes(box: SubFigure, title: str, x_label: str, y_label: str, sheet: Sheet, remark: str = "") -> Axes:
    """Empty axes with their labels.

    Parameters
    ----------
    box : SubFigure
        Where they go.
    title, x_label, y_label : str
        Texts, wrapped to the sheet.
    sheet : Sheet
        Size and colours.
    remark : str
        Stands above the axes to the right, below the title.
    """
    paint = sheet.palette
    ax = box.subplots()
    ax.set_facecolor("none")
    for spine in ax.spines.values():
        spine.set_color(paint["muted"])
    ax.tick_params(colors=paint["muted"], labelcolor=paint["ink"], labelsize=sheet.small, width=0.8, length=3.5)
    for axis in (ax.xaxis, ax.yaxis):
        axis.get_offset_text().set(color=paint["ink"], size=sheet.small)
    ax.set_xlabel(fitted(x_label, 0.8 * sheet.width, sheet.letters), size=sheet.letters, color=paint["ink"])
    ax.set_ylabel(fitted(y_label, 2.8, sheet.letters), size=sheet.letters, color=paint["ink"])
    if title:
        size = sheet.letters + 1.0
        text = fitted(title, 0.85 * sheet.width, size, "bold")
        ax.set_title(
            text,
            loc="left",
            size=size,
            color=paint["ink"],
            weight="bold",
            pad=8.0 + (POINTS * sheet.line if remark else 0.0),
        )
    if remark:
        line = ax.text(1.0, 1.01, remark, transform=ax.transAxes, ha="right", va="bottom")
        line.set(color=paint["muted"], size=sheet.small)
    return ax


def fitted(text: str, width: float, size: float, weight: str = "normal") -> str:
    """Text with line breaks so that it fits a width [in]."""
    return "\n".join(wrapped(text, width, size, weight))

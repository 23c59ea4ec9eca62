"""Power flows: widths proportional to power, losses branching off downwards, gains coming in from below."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path

from pmg.pipeline.report.flow import balance
from pmg.pipeline.report.sheet import text_width, wrapped
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.figure import PowerFlow
    from pmg.pipeline.report.flow import Balance, Branch
    from pmg.pipeline.report.sheet import Sheet

_Label: TypeAlias = tuple[tuple[str, str], ...]
"""Lines of a label and their weight."""

_MARGIN = 0.12
_BEND = 0.10
"""Inner radius of a bend [in]."""
_STEM = 0.28
"""Straight part of a branch [in]."""
_TIP = 0.14
"""Depth of an arrow head or tail [in]."""
_DOT = "\N{NO-BREAK SPACE}\N{MIDDLE DOT}\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class _Plan:
    """Where things go, in inches from the lower left corner."""

    balance: Balance
    sheet: Sheet
    pitch: float
    scale: float
    above: tuple[_Label, ...]
    below: tuple[_Label, ...]
    title: tuple[str, ...]

    @property
    def widths(self) -> tuple[float, ...]:
        """Thickness of each stretch of the trunk."""
        return tuple(self.scale * abs(power) for power in self.balance.trunk)

    @property
    def thickness(self) -> float:
        """Thickness of the trunk where it is thickest."""
        return max(self.widths)

    @property
    def height(self) -> float:
        """All of it, from heading to lowest label."""
        line = self.sheet.line
        heading = len(self.title) * 1.15 * line + 0.12 if self.title else 0.0
        return heading + max(map(len, self.above)) * line + 0.2 + self.thickness + self.depth + 0.1

    @property
    def depth(self) -> float:
        """From the lowest edge of the trunk to the end of the lowest label."""
        if not any(self.balance.places):
            return 0.1
        deepest = max(len(label) for label in self.below) * self.sheet.line
        return _BEND + _STEM + _TIP + 0.08 + deepest

    def place(self, index: int) -> float:
        """Middle of a place where something branches off."""
        return _MARGIN + (index + 1) * self.pitch

    def stretch(self, index: int) -> float:
        """Middle of a stretch of the trunk."""
        return _MARGIN + (index + 0.5) * self.pitch


def height(flow: PowerFlow, sheet: Sheet) -> float:
    """Height that a power flow asks for [in]."""
    return _plan(flow, sheet).height


def draw(flow: PowerFlow, box: SubFigure, tall: float, sheet: Sheet) -> None:
    """The power flow inside a part of a figure that is ``tall`` inches high."""
    plan = _plan(flow, sheet)
    ax = box.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(0.0, sheet.width), ylim=(plan.height - tall, plan.height))
    ax.set_axis_off()
    top = plan.height
    for line in plan.title:
        top -= 1.15 * sheet.line
        ax.text(_MARGIN, top, line, size=sheet.letters + 1.0, weight="bold", color=sheet.palette["ink"])
    top -= (0.12 if plan.title else 0.0) + max(map(len, plan.above)) * sheet.line + 0.12
    _trunk(ax, plan, top)
    for index, branch in enumerate(plan.balance.places):
        if branch is not None:
            _branch(ax, plan, index, branch, top)
    for (_, _, stretch), lines in zip(plan.balance.stages, plan.above, strict=True):
        _label(ax, plan, plan.stretch(stretch), top + 0.07 + len(lines) * sheet.line, lines, "ink")


def _plan(flow: PowerFlow, sheet: Sheet) -> _Plan:
    widths = balance(flow)
    pitch = (sheet.width - 2 * _MARGIN) / len(widths.trunk)
    greatest = max(map(abs, widths.trunk)) or 1.0
    widest = max((abs(branch.watts) for branch in widths.places if branch), default=0.0)
    scale = 1.15 / greatest
    if widest:
        scale = min(scale, (pitch - 2 * _BEND - 0.1) / widest)
    above = tuple(
        _lettering(widths, label, (abs(watts), expanded), pitch - 0.06, sheet)
        for (label, watts, _), expanded in zip(widths.stages, widths.expanded, strict=True)
    )
    below = tuple(
        _lettering(widths, branch.label, (branch.watts, branch.expanded), pitch - 0.08, sheet) if branch else ()
        for branch in widths.places
    )
    title = wrapped(flow.title, sheet.width - 0.3, sheet.letters + 1.0, "bold")
    return _Plan(widths, sheet, pitch, scale, above, below, title)


def _lettering(widths: Balance, label: str, power: tuple[float, float], room: float, sheet: Sheet) -> _Label:
    """Name, power with its U where there is room, and share of the supply, in lines; a gain beyond U is called one."""
    watts, expanded = power
    share = f"{numerals.number(100 * widths.share(watts), 1)}\N{NO-BREAK SPACE}%"
    short = f"{numerals.number(watts, 1 if abs(watts) >= 100 else 2)}\N{NO-BREAK SPACE}W"
    ways = [[_DOT.join((short, share))], [short, share]]
    if math.isfinite(expanded) and expanded > 0.0:
        words = numerals.measured(watts, expanded).replace(" ", "\N{NO-BREAK SPACE}") + "\N{NO-BREAK SPACE}W"
        value, spread = words.split("\N{NO-BREAK SPACE}", 1)
        ways = [[_DOT.join((words, share))], [words, share], [value, spread, share], *ways]
    fitting = (way for way in ways if all(text_width(line, sheet.small) <= room for line in way))
    plain = next(fitting, ways[-1])
    if watts < 0 and not abs(watts) <= expanded:
        plain = [*plain, "a gain, not a loss"]
    return (
        *((line, "bold") for line in wrapped(label, room, sheet.small, "bold")),
        *((line, "normal") for text in plain for line in wrapped(text, room, sheet.small)),
    )


def _trunk(ax: Axes, plan: _Plan, top: float) -> None:
    """The trunk with a straight upper edge, and chevrons that tell which way the power goes.

    It is one shape as long as anything passes by its branches, and parts where nothing does.
    """
    paint, trunk, width = plan.sheet.palette, plan.balance.trunk, plan.widths
    edge: list[tuple[float, float]] = []
    for index, thick in enumerate(width):
        if not edge:
            edge = _end(plan, index, -1, top) if index == 0 else [(_start(plan, index), top)]
        edge += [(_start(plan, index), top - thick), (_stop(plan, index), top - thick)]
        last = index == len(trunk) - 1
        branch = None if last else plan.balance.places[index]
        if last or (branch and not branch.through):
            edge += _end(plan, index, 1, top) if last else [(_stop(plan, index), top)]
            ax.add_patch(Polygon(edge, facecolor=paint["flow"], edgecolor=paint["flow"], linewidth=0.6))
            edge = []
        elif branch:
            through = top - plan.scale * branch.through
            edge += [(_stop(plan, index), through), (_start(plan, index + 1), through)]
    for index, power in enumerate(trunk):
        tall = min(0.11, 0.28 * width[index])
        if tall > 0.02:
            x, y = (_start(plan, index) + _stop(plan, index)) / 2, top - width[index] / 2
            back = x - np.sign(power) * 0.6 * tall
            ax.plot([back, x, back], [y - tall, y, y + tall], color=paint["paper"], linewidth=1.6)


def _end(plan: _Plan, index: int, side: int, top: float) -> list[tuple[float, float]]:
    """The upper corner and the head or tail at one end of the trunk, anticlockwise."""
    thick = plan.widths[index]
    x = _stop(plan, index) if side > 0 else _start(plan, index)
    point = (x + float(np.sign(plan.balance.trunk[index])) * _tip(thick), top - thick / 2)
    return [point, (x, top)] if side > 0 else [(x, top), point]


def _start(plan: _Plan, index: int) -> float:
    """Where a stretch of the trunk begins with its full width."""
    if index == 0:
        return _MARGIN + _TIP
    branch = plan.balance.places[index - 1]
    if branch is None or not branch.right:
        return plan.place(index - 1)
    return plan.place(index - 1) + _BEND + plan.scale * abs(branch.watts) / 2


def _stop(plan: _Plan, index: int) -> float:
    """Where a stretch of the trunk ends with its full width."""
    if index == len(plan.balance.trunk) - 1:
        return plan.sheet.width - _MARGIN - _TIP
    branch = plan.balance.places[index]
    if branch is None or not branch.left:
        return plan.place(index)
    return plan.place(index) - _BEND - plan.scale * abs(branch.watts) / 2


def _branch(ax: Axes, plan: _Plan, index: int, branch: Branch, top: float) -> None:
    """Bends from the trunk, a common stem, its arrow and its label."""
    paint, scale = plan.sheet.palette, plan.scale
    role = "gain" if branch.gain else "unexplained" if branch.unexplained else "loss"
    floor = top - plan.thickness - _BEND - _STEM
    middle, half = plan.place(index), scale * abs(branch.watts) / 2
    meet = middle - half + scale * branch.left
    sides = []
    if branch.left:
        sides.append((meet, -1.0, scale * branch.left, top - scale * abs(plan.balance.trunk[index])))
    if branch.right:
        sides.append((meet, 1.0, scale * branch.right, top - scale * abs(plan.balance.trunk[index + 1])))
    look: dict[str, Any] = {
        "facecolor": paint[role],
        "edgecolor": paint["muted"] if branch.unexplained else paint[role],
        "hatch": "////////" if branch.unexplained else None,
        "linewidth": 0.6,
    }
    for inner_edge, side, width, base in sides:
        ax.add_patch(PathPatch(_bend(inner_edge, side, width, base, floor), **look))
    if branch.gain:
        look.update(facecolor=paint["paper"], edgecolor=paint["paper"], hatch=None)
    point = (middle, floor + _tip(2 * half) * (1 if branch.gain else -1))
    ax.add_patch(Polygon([(middle - half, floor), point, (middle + half, floor)], **look))
    lowest = floor - (0.0 if branch.gain else _TIP) - 0.08
    ink = "attention" if branch.gain else "ink"
    _label(ax, plan, middle, lowest, plan.below[index], ink)


def _bend(edge: float, side: float, width: float, base: float, floor: float) -> Path:
    """A quarter turn from the trunk's lower edge into a stem that ends at ``floor``.

    ``edge`` is the side of the stem away from the stretch of trunk it belongs to, ``side`` is -1 where that
    stretch lies to the left, and ``base`` is the stretch's lower edge.
    """
    near = edge + side * width
    centre = near + side * _BEND
    k = 4 / 3 * (np.sqrt(2) - 1)
    outer, inner, turn = _BEND + width, _BEND, base - _BEND
    points = [
        (centre, turn + outer),
        (centre - side * k * outer, turn + outer),
        (edge, turn + k * outer),
        (edge, turn),
        (edge, floor),
        (near, floor),
        (near, turn),
        (near, turn + k * inner),
        (centre - side * k * inner, base),
        (centre, base),
        (centre, turn + outer),
    ]
    line, curve = Path.LINETO, Path.CURVE4
    return Path(points, [Path.MOVETO, curve, curve, curve, line, line, line, curve, curve, curve, Path.CLOSEPOLY])


def _tip(width: float) -> float:
    """Depth of an arrow head on a ribbon of this width [in]."""
    return float(min(_TIP, 0.5 * width + 0.03))


def _label(ax: Axes, plan: _Plan, x: float, y: float, lines: _Label, role: str) -> None:
    """Lines below each other; ``y`` is their upper edge."""
    for index, (line, weight) in enumerate(lines):
        ax.text(
            x,
            y - index * plan.sheet.line,
            line,
            size=plan.sheet.small,
            weight=weight,
            color=plan.sheet.palette[role],
            ha="center",
            va="top",
        )

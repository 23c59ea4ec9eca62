"""Where everything of a power flow stands: areas, arrows and lettering, in inches, before any library draws them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from pmg.pipeline.report.flow import balance
from pmg.pipeline.report.sheet import text_width, wrapped
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.report.figure import PowerFlow
    from pmg.pipeline.report.flow import Balance, Branch
    from pmg.pipeline.report.sheet import Sheet

Point: TypeAlias = tuple[float, float]
Outline: TypeAlias = tuple[tuple[str, tuple[Point, ...]], ...]
"""As SVG writes it: ``M``, ``L`` and ``C`` with their points [in], closed at the end."""
Lettering: TypeAlias = tuple[tuple[str, str], ...]
"""Lines and the weight of each."""

MARGIN = 0.12
"""Beside and above what is drawn [in]."""
_BEND = 0.10
"""Inner radius of a bend [in]."""
_STEM = 0.28
"""Straight part of a branch [in]."""
_TIP = 0.14
"""Depth of an arrow head or tail [in]."""
_DOT = "\N{NO-BREAK SPACE}\N{MIDDLE DOT}\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class FlowArea:
    """An area of one colour.

    Parameters
    ----------
    role : str
        Colour of the page that it has; of a way in, that of the paper.
    edge : str
        Colour of its outline.
    outline : Outline
        Its steps.
    hatched : bool
        Whether it is hatched.
    """

    role: str
    edge: str
    outline: Outline
    hatched: bool = False


@dataclass(frozen=True)
class FlowLabel:
    """Lines below each other, centred; ``top`` is their upper edge [in]."""

    x: float
    top: float
    lines: Lettering
    role: str


@dataclass(frozen=True)
class FlowPlan:
    """Where things go, in inches from the lower left corner."""

    balance: Balance
    sheet: Sheet
    pitch: float
    scale: float
    above: tuple[Lettering, ...]
    below: tuple[Lettering, ...]
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
    def heading(self) -> float:
        """Height of the title."""
        return len(self.title) * 1.15 * self.sheet.line + 0.12 if self.title else 0.0

    @property
    def height(self) -> float:
        """All of it, from heading to lowest label."""
        above = max(map(len, self.above)) * self.sheet.line
        return self.heading + above + 0.2 + self.thickness + self.depth + 0.1

    @property
    def depth(self) -> float:
        """From the lowest edge of the trunk to the end of the lowest label."""
        if not any(self.balance.places):
            return 0.1
        deepest = max(len(label) for label in self.below) * self.sheet.line
        return _BEND + _STEM + _TIP + 0.08 + deepest

    def place(self, index: int) -> float:
        """Middle of a place where something branches off."""
        return MARGIN + (index + 1) * self.pitch

    def stretch(self, index: int) -> float:
        """Middle of a stretch of the trunk."""
        return MARGIN + (index + 0.5) * self.pitch

    @property
    def top(self) -> float:
        """Upper edge of the trunk."""
        return self.height - self.heading - max(map(len, self.above)) * self.sheet.line - 0.12

    def areas(self) -> Iterator[FlowArea]:
        """The trunk, and every branch with its arrow."""
        yield from _trunk(self)
        for index, branch in enumerate(self.balance.places):
            if branch is not None:
                yield from _branch(self, index, branch)

    def chevrons(self) -> Iterator[tuple[Point, Point, Point]]:
        """Open arrows on the trunk that tell which way the power goes."""
        for index, power in enumerate(self.balance.trunk):
            tall = min(0.11, 0.28 * self.widths[index])
            if tall > 0.02:
                x, y = (_start(self, index) + _stop(self, index)) / 2, self.top - self.widths[index] / 2
                back = x - float(np.sign(power)) * 0.6 * tall
                yield (back, y - tall), (x, y), (back, y + tall)

    def labels(self) -> Iterator[FlowLabel]:
        """Lettering of the branches, below, and of the stages, above."""
        for index, branch in enumerate(self.balance.places):
            if branch is not None:
                lowest = _floor(self) - (0.0 if branch.gain else _TIP) - 0.08
                ink = "attention" if branch.gain else "ink"
                yield FlowLabel(self.place(index), lowest, self.below[index], ink)
        for (_, _, stretch), lines in zip(self.balance.stages, self.above, strict=True):
            above = self.top + 0.07 + len(lines) * self.sheet.line
            yield FlowLabel(self.stretch(stretch), above, lines, "ink")


def flow_plan(flow: PowerFlow, sheet: Sheet) -> FlowPlan:
    """The plan of a power flow on a sheet."""
    widths = balance(flow)
    pitch = (sheet.width - 2 * MARGIN) / len(widths.trunk)
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
    return FlowPlan(widths, sheet, pitch, scale, above, below, title)


def _lettering(widths: Balance, label: str, power: tuple[float, float], room: float, sheet: Sheet) -> Lettering:
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


def _trunk(plan: FlowPlan) -> Iterator[FlowArea]:
    """The trunk with a straight upper edge: one area as long as anything passes by its branches."""
    trunk, width, top = plan.balance.trunk, plan.widths, plan.top
    edge: list[Point] = []
    for index, thick in enumerate(width):
        if not edge:
            edge = _end(plan, index, -1) if index == 0 else [(_start(plan, index), top)]
        edge += [(_start(plan, index), top - thick), (_stop(plan, index), top - thick)]
        last = index == len(trunk) - 1
        branch = None if last else plan.balance.places[index]
        if last or (branch and not branch.through):
            edge += _end(plan, index, 1) if last else [(_stop(plan, index), top)]
            yield FlowArea("flow", "flow", _polygon(edge))
            edge = []
        elif branch:
            through = top - plan.scale * branch.through
            edge += [(_stop(plan, index), through), (_start(plan, index + 1), through)]


def _polygon(corners: list[Point]) -> Outline:
    return ("M", (corners[0],)), *(("L", (corner,)) for corner in corners[1:])


def _end(plan: FlowPlan, index: int, side: int) -> list[Point]:
    """The upper corner and the head or tail at one end of the trunk, anticlockwise."""
    thick, top = plan.widths[index], plan.top
    x = _stop(plan, index) if side > 0 else _start(plan, index)
    point = (x + float(np.sign(plan.balance.trunk[index])) * _tip(thick), top - thick / 2)
    return [point, (x, top)] if side > 0 else [(x, top), point]


def _start(plan: FlowPlan, index: int) -> float:
    """Where a stretch of the trunk begins with its full width."""
    if index == 0:
        return MARGIN + _TIP
    branch = plan.balance.places[index - 1]
    if branch is None or not branch.right:
        return plan.place(index - 1)
    return plan.place(index - 1) + _BEND + plan.scale * abs(branch.watts) / 2


def _stop(plan: FlowPlan, index: int) -> float:
    """Where a stretch of the trunk ends with its full width."""
    if index == len(plan.balance.trunk) - 1:
        return plan.sheet.width - MARGIN - _TIP
    branch = plan.balance.places[index]
    if branch is None or not branch.left:
        return plan.place(index)
    return plan.place(index) - _BEND - plan.scale * abs(branch.watts) / 2


def _floor(plan: FlowPlan) -> float:
    """Where the stems of the branches end."""
    return plan.top - plan.thickness - _BEND - _STEM


def _branch(plan: FlowPlan, index: int, branch: Branch) -> Iterator[FlowArea]:
    """Bends from the trunk, a common stem and its arrow."""
    scale, top, floor = plan.scale, plan.top, _floor(plan)
    role = "gain" if branch.gain else "unexplained" if branch.unexplained else "loss"
    edge = "muted" if branch.unexplained else role
    middle, half = plan.place(index), scale * abs(branch.watts) / 2
    meet = middle - half + scale * branch.left
    for side, width, stretch in ((-1.0, branch.left, index), (1.0, branch.right, index + 1)):
        if width:
            base = top - scale * abs(plan.balance.trunk[stretch])
            yield FlowArea(role, edge, _bend(meet, side, scale * width, base, floor), branch.unexplained)
    tip = (middle, floor + _tip(2 * half) * (1 if branch.gain else -1))
    arrow = _polygon([(middle - half, floor), tip, (middle + half, floor)])
    if branch.gain:
        yield FlowArea("paper", "paper", arrow)
    else:
        yield FlowArea(role, edge, arrow, branch.unexplained)


def _bend(edge: float, side: float, width: float, base: float, floor: float) -> Outline:
    """A quarter turn from the trunk's lower edge into a stem that ends at ``floor``.

    ``edge`` is the side of the stem away from the stretch of trunk it belongs to, ``side`` is -1 where that
    stretch lies to the left, and ``base`` is the stretch's lower edge.
    """
    near = edge + side * width
    centre = near + side * _BEND
    k = 4 / 3 * (math.sqrt(2) - 1)
    outer, inner, turn = _BEND + width, _BEND, base - _BEND
    return (
        ("M", ((centre, turn + outer),)),
        ("C", ((centre - side * k * outer, turn + outer), (edge, turn + k * outer), (edge, turn))),
        ("L", ((edge, floor),)),
        ("L", ((near, floor),)),
        ("L", ((near, turn),)),
        ("C", ((near, turn + k * inner), (centre - side * k * inner, base), (centre, base))),
    )


def _tip(width: float) -> float:
    """Depth of an arrow head on a ribbon of this width [in]."""
    return float(min(_TIP, 0.5 * width + 0.03))

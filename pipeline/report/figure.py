"""Figures as plain data: the one specification that every drawing starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from pmg.pipeline.report.names import checked_id

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask

Style = Literal["markers", "line", "both", "band", "bars"]


UNEXPLAINED = "unexplained"
"""A loss whose label starts with this word closes a balance instead of naming a cause."""

BAR = 0.7
"""Width of a bar, in parts of the least distance of two."""


@dataclass(frozen=True)
class Series:
    """Points or a line of a chart.

    Parameters
    ----------
    name : str
        Entry in the legend; none when empty.
    x, y : (n,) array
        Values in display units; NaN leaves a gap.
    u : (n,) array, optional
        Standard uncertainty of ``y``. Bars (or a band, for lines and bands) of twice this are drawn.
    style : str
        ``markers``, ``line``, ``both``, ``band`` or ``bars``; the bars of a chart stand on each other, those below zero
        hang from it.
    colour : int
        Place in the palette; chooses the marker as well.
    group : str
        Series of one group stand under its name in the legend. The first group of a chart is drawn solid
        and filled, later ones dashed and hollow.
    points : tuple of str
        Name of the test point behind each value, where the page can open it; empty: none.
    """

    name: str
    x: Array
    y: Array
    u: Array | None = None
    style: Style = "markers"
    colour: int = 0
    group: str = ""
    points: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given = (self.x, self.y, self.y if self.u is None else self.u, self.points or self.y)
        lengths = {len(values) for values in given}
        if len(lengths) > 1:
            raise ValueError(f"Series {self.name!r}: x, y, u and points have lengths {sorted(lengths)}")
        if self.style == "band" and self.u is None:
            raise ValueError(f"Series {self.name!r}: a band needs u")


@dataclass(frozen=True)
class Chart:
    """Series over a common axis.

    Parameters
    ----------
    x_label, y_label : str
        Axis labels with display unit.
    series : tuple of Series
        Drawn in this order.
    references : tuple of (label, value)
        Horizontal lines to compare with.
    legend_title : str
        Heading of the legend.
    title : str
        Heading of the panel.
    x_limits, y_limits : (low, high), optional
        Axis range; points outside are counted on the drawing.
    x_log, y_log : bool
        Whether that axis is logarithmic; what is not positive there is a gap.
    """

    x_label: str
    y_label: str
    series: tuple[Series, ...]
    references: tuple[tuple[str, float], ...] = ()
    legend_title: str = ""
    title: str = ""
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    x_log: bool = False
    y_log: bool = False

    @property
    def references_shown(self) -> list[tuple[str, float]]:
        """The references that the axis can show."""
        return [one for one in self.references if np.isfinite(one[1]) and not (self.y_log and one[1] <= 0.0)]


@dataclass(frozen=True)
class SpeedMap:
    """A quantity over the test grid; each cell is one test point.

    Parameters
    ----------
    x, y : (n,) and (m,) array
        Values that were set, rising, not necessarily evenly spaced.
    z : (m, n) array
        The quantity; a cell that is not finite is drawn as not measured.
    x_label, y_label, z_label : str
        Labels with display unit.
    hatch : (m, n) array of bool, optional
        Cells to be hatched.
    hatch_meaning : str
        What the hatching says.
    diverging : bool
        Whether zero is the neutral middle of a symmetric colour scale.
    annotate : bool
        Whether the value is written into the cell, where it fits.
    contours : tuple of float
        Levels of lines of equal value.
    title : str
        Heading of the panel.
    points : (m, n) nested tuples of str
        Name of the test point behind each cell, empty where there is none or where no page can open it; empty: none.
    relief : bool
        Whether it is drawn as a surface in three dimensions, its values as height, instead of as cells.
    """

    x: Array
    y: Array
    z: Array
    x_label: str
    y_label: str
    z_label: str
    hatch: Mask | None = None
    hatch_meaning: str = "difference within uncertainty"
    diverging: bool = False
    annotate: bool = False
    contours: tuple[float, ...] = ()
    title: str = ""
    points: tuple[tuple[str, ...], ...] = ()
    relief: bool = False

    def __post_init__(self) -> None:
        shape = (len(self.y), len(self.x))
        if self.points and {(len(self.points), len(row)) for row in self.points} != {shape}:
            raise ValueError(f"SpeedMap of {self.z_label!r}: expected points of shape {shape}")
        if self.z.shape != shape or (self.hatch is not None and self.hatch.shape != shape):
            raise ValueError(f"SpeedMap of {self.z_label!r}: expected z and hatch of shape {shape}")
        if 0 in shape or not all((np.diff(axis) > 0).all() for axis in (self.x, self.y)):
            raise ValueError(f"SpeedMap of {self.z_label!r}: x and y must hold rising values")


@dataclass(frozen=True)
class PowerFlow:
    """Power along a chain of stages, and what leaves it between them.

    Power from left to right is positive. When the flow is reversed the stages keep their place and their
    powers are negative. A loss is positive where power leaves the chain; a negative one is a gain.

    Parameters
    ----------
    title : str
        Heading of the panel.
    main : tuple of (label, watts)
        At least two stages, left to right.
    losses : tuple of (label, watts, index)
        What branches off between stage ``index`` and the next one.
    expanded : tuple of float
        Expanded uncertainty U of each power, in the order of `watts`; NaN where none is stated. Empty: of none.
    others : tuple of (name, PowerFlow)
        The same chain elsewhere, this one among them; the page lets a reader choose, a drawing shows this one.
    caption : str
        The finding of the figure where this one is chosen; empty: the figure's own.
    """

    title: str
    main: tuple[tuple[str, float], ...]
    losses: tuple[tuple[str, float, int], ...]
    expanded: tuple[float, ...] = ()
    others: tuple[tuple[str, PowerFlow], ...] = ()
    caption: str = ""

    def __post_init__(self) -> None:
        if len(self.main) < 2:
            raise ValueError(f"PowerFlow {self.title!r}: a chain has at least two stages")
        if any(not 0 <= after < len(self.main) - 1 for _, _, after in self.losses):
            raise ValueError(f"PowerFlow {self.title!r}: a loss lies between two stages")
        if not np.isfinite(self.watts).all():
            raise ValueError(f"PowerFlow {self.title!r}: every power must be a finite number")
        if self.expanded and (len(self.expanded) != len(self.watts) or any(u < 0.0 for u in self.expanded)):
            raise ValueError(f"PowerFlow {self.title!r}: one uncertainty for each power, zero or more")

    @property
    def watts(self) -> tuple[float, ...]:
        """Every power stated, stages first."""
        return (*(watts for _, watts in self.main), *(watts for _, watts, _ in self.losses))

    @property
    def uncertainties(self) -> tuple[float, ...]:
        """U of every power, in the order of `watts`; NaN where none is stated."""
        return self.expanded or (float("nan"),) * len(self.watts)


def stacked(chart: Chart) -> dict[int, tuple[Array, float]]:
    """Foot of each bar of a chart, and the width of all of them, by the place of their series."""
    bars = {place: series for place, series in enumerate(chart.series) if series.style == "bars"}
    at = np.unique(np.concatenate([series.x for series in bars.values()])) if bars else np.zeros(0)
    width = BAR * float(np.diff(at).min()) if len(at) > 1 else 1.0
    above, below = np.zeros(len(at)), np.zeros(len(at))
    found = {}
    for place, series in bars.items():
        rows, height = np.searchsorted(at, series.x), np.nan_to_num(series.y)
        found[place] = np.where(height < 0.0, below[rows], above[rows]), width
        above[rows] += np.maximum(height, 0.0)
        below[rows] += np.minimum(height, 0.0)
    return found


Panel: TypeAlias = Chart | SpeedMap | PowerFlow


@dataclass(frozen=True)
class Figure:
    """Panels under one caption that states the finding.

    Parameters
    ----------
    id : str
        Anchor and file name, unique in the report.
    title : str
        Short name.
    caption : str
        The finding, as a sentence; read aloud in place of the drawing.
    panels : tuple of Panel
        At least one.
    columns : int
        Panels side by side where the page is wide enough.
    narrow : bool
        Whether it stands beside text, in half the width of a page.
    switched : tuple of Panel
        The same panels with the cause of a difference in the simulation, which the page can switch to; empty: none.
    switched_caption : str
        The finding then.
    """

    id: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1
    narrow: bool = False
    switched: tuple[Panel, ...] = ()
    switched_caption: str = ""

    def __post_init__(self) -> None:
        checked_id("Figure", self.id)
        if self.switched and [type(panel) for panel in self.switched] != [type(panel) for panel in self.panels]:
            raise ValueError(f"Figure {self.id!r}: expected the switched panels to be those panels with other values")
        if not self.panels or self.columns < 1:
            raise ValueError(f"Figure {self.id!r}: expected at least one panel and one column")

    @property
    def file(self) -> str:
        """Path of the PNG file inside the report's folder."""
        return f"figures/{self.id}.png"

    @property
    def vector_file(self) -> str:
        """Path of the SVG file inside the report's folder."""
        return f"figures/{self.id}.svg"

"""Chapter on the published figures: each next to what the published grids give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.studies.transient import transient_section
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Section, Series, Table, Text
from pmg.pipeline.thesis_figures.compared import compared_figures
from pmg.pipeline.thesis_figures.figures import MANY
from pmg.pipeline.thesis_figures.listing import failed_draws, summary
from pmg.pipeline.thesis_figures.rounding import DRAWS
from pmg.pipeline.thesis_figures.tables import printed
from pmg.pipeline.thesis_figures.verdict import FigureVerdict, JudgedFigure, count
from pmg.sim import sources
from pmg.sim.errors import GridError

if TYPE_CHECKING:
    from pmg.pipeline.report.table import Cell
    from pmg.pipeline.thesis_figures.compared import ComparedFigures
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SHOWN = 5.0
"""Half-widths that the drawing reaches to; what lies beyond is counted on it."""


def published_sections(grid: Grid, bench: BenchParameters, draws: int = DRAWS) -> tuple[Section, ...]:
    """The chapters for a campaign of published grids; none where they are not the thesis's."""
    if grid.origin != "published":
        return ()
    try:
        printed(grid)
    except GridError:
        return ()
    return sections_of(compared_figures(grid, bench, draws))


def sections_of(figures: ComparedFigures) -> tuple[Section, ...]:
    """The figures, and the run in time under each choice."""
    return _figures_section(figures), transient_section(figures.runs)


def _figures_section(figures: ComparedFigures) -> Section:
    """The table of all figures, and how far each lies from what is printed."""
    judged = figures.judged
    return Section(
        "published-figures",
        "Published figures",
        (
            Text(
                "Every figure of the thesis that its tables determine, computed anew by its own method: polynomial "
                "loss curves of degree three and four through all neutral points, bisquare weights in the damping fit, "
                "K_corr = 0.80, the eddy constant as printed, and once more with the one that its power chain implies. "
                "Nothing is adjusted.\n\n"
                "The tables are rounded to 0.01 N m, the ring torques of the engaged points to 0.0001. Each torque was "
                "drawn anew within half a unit of its last digit and everything computed again; where a shaft prints "
                "one value at all points of one of its speeds (the sun at 1404, 1716 and 1872 rpm), these share one "
                "error. The interval is ours, give or take what 95 % of the draws stay within "
                "and half a unit of the last digit of the printed figure. A figure that is printed inside it is "
                "reproduced, or not determined where the interval is wider than a fifth of the figure. Where the "
                "source states a figure twice, differently, that is said instead; likewise where a figure comes out "
                "only with the eddy constant of its power chain."
            ),
            Facts(
                (
                    *((str(verdict), float(n)) for verdict, n in count(judged).items()),
                    ("Draws within the rounding", float(figures.draws)),
                    *((("Left out", failed),) if (failed := failed_draws(judged)) else ()),
                    ("Seed of the draws", str(figures.seed)),
                )
            ),
            _drawing(judged),
            _table(judged),
            _places(judged),
        ),
        tuple(dict.fromkeys((sources.THESIS, *(j.figure.source for j in judged)))),
    )


def _drawing(judged: tuple[JudgedFigure, ...]) -> Figure:
    numbered = list(enumerate(judged, 1))
    single = [(n, j) for n, j in numbered if j.figure.group not in MANY]
    many = [(n, j) for n, j in numbered if j.figure.group in MANY]
    panels = (_chart(single, "Single figures"), _chart(many, "Sun torques of the 48 simulated points, twice"))
    outside = sum(abs(j.distance) > 1.0 for j in judged)
    return Figure(
        "published-distances",
        "Distance from the published figures",
        f"{summary(judged)}. Ours minus published in half-widths of the interval: {outside} lie outside their "
        "interval, whose ends are at 1 and -1. The number is that of the table.",
        panels,
    )


def _chart(numbered: list[tuple[int, JudgedFigure]], title: str) -> Chart:
    series = []
    for colour, verdict in enumerate(FigureVerdict):
        chosen = [(n, j) for n, j in numbered if j.verdict is verdict]
        if chosen:
            x = np.array([n for n, _ in chosen], dtype=np.float64)
            y = np.array([j.distance for _, j in chosen])
            series.append(Series(str(verdict), x, y, np.full(len(x), 0.5), "markers", colour))
    return Chart(
        "number in the table",
        "distance [half-widths]",
        tuple(series),
        references=(("", 0.0),),
        title=title,
        y_limits=(-SHOWN, SHOWN),
    )


def _table(judged: tuple[JudgedFigure, ...]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (n, f"{j.figure.what}{_in(j)}", j.figure.text, j.ours, j.low, j.high, str(j.verdict))
        for n, j in enumerate(judged, 1)
    ]
    return Table(
        "published-figures-table",
        "Published figures and ours",
        f"{summary(judged)}. In the unit as printed.",
        (
            Column("number", "No."),
            Column("figure", "Figure"),
            Column("published", "Published"),
            Column("ours", "Ours", format=".5g"),
            Column("low", "from", format=".5g"),
            Column("high", "to", format=".5g"),
            Column("verdict", "Verdict"),
        ),
        tuple(rows),
    )


def _in(j: JudgedFigure) -> str:
    """The unit of a figure, in brackets."""
    return f" [{j.figure.unit.name}]" if j.figure.unit.name else ""


def _places(judged: tuple[JudgedFigure, ...]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for n, j in enumerate(judged, 1):
        figure = j.figure
        also = "" if figure.other is None else f"{figure.other.value:g} ({figure.other.place})"
        rows.append((n, figure.id, figure.unit.name, figure.place, also, j.distance, " ".join(j.remarks)))
    remarked = sum(bool(j.remarks) for j in judged)
    return Table(
        "published-figures-places",
        "Where they are printed, and remarks",
        f"{remarked} of {len(judged)} figures have a known reason for what comes out. The distance is ours minus "
        "published, in half-widths.",
        (
            Column("number", "No."),
            Column("id", "Id"),
            Column("unit", "Unit"),
            Column("place", "Place"),
            Column("also", "Also stated as"),
            Column("distance", "Distance", digits=2),
            Column("remark", "Remark"),
        ),
        tuple(rows),
    )

"""Comparison of published figures with the published tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from pmg.pipeline.thesis_figures.figures import FIGURES
from pmg.pipeline.thesis_figures.remarks import GEAR_CONSTANT, remarks_on
from pmg.pipeline.thesis_figures.rounding import RoundingSpread, spreads
from pmg.pipeline.thesis_figures.tables import printed

if TYPE_CHECKING:
    import numpy as np

    from pmg.pipeline.thesis_figures.claim import PublishedFigure
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

WIDE = 0.20
"""Width of an interval, as part of the figure, above which the tables do not determine it."""


class FigureVerdict(StrEnum):
    """Verdict on a figure.

    ``REPRODUCED``: what is printed lies in our interval. ``NOT_EXPLAINED``: it lies outside. ``NOT_DETERMINED``: it
    lies inside, but the interval is wider than a fifth of it, or reaches over the limit that is claimed.
    ``INCONSISTENT``: the source states it twice, differently. ``OTHER_CONSTANT``: it lies outside with the eddy
    constant that the source prints, and inside with the one that its power chain implies: the source used two.
    """

    REPRODUCED = "reproduced"
    NOT_EXPLAINED = "rounding does not explain"
    NOT_DETERMINED = "not determined by the rounded tables"
    INCONSISTENT = "inconsistent in the source"
    OTHER_CONSTANT = "explained by the eddy constant of the source's power chain"


@dataclass(frozen=True)
class JudgedFigure:
    """A published figure next to ours, in the unit it is printed in.

    Parameters
    ----------
    figure : PublishedFigure
        As printed.
    ours : float
        From the rounded tables.
    reach : float
        Half-width of the interval about ours: what the tables' rounding moves it by, and the figure's own rounding.
    distance : float
        Ours minus published, in half-widths; 0 within a range.
    verdict : Verdict
        What follows.
    failed : int
        Draws that gave no figures and are not in the interval.
    """

    figure: PublishedFigure
    ours: float
    reach: float
    distance: float
    verdict: FigureVerdict
    failed: int = 0

    @property
    def low(self) -> float:
        """Lower end of the interval."""
        return self.ours - self.reach

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return self.ours + self.reach

    @property
    def remarks(self) -> tuple[str, ...]:
        """Known remarks on the figure."""
        if self.verdict is FigureVerdict.OTHER_CONSTANT:
            return (*remarks_on(self.figure.id, differs=False), GEAR_CONSTANT)
        return remarks_on(self.figure.id, differs=self.verdict is not FigureVerdict.REPRODUCED)


def _judge(figure: PublishedFigure, spread: RoundingSpread) -> JudgedFigure:
    """The verdict on a figure."""
    ours, shift = spread.ours / figure.unit.scale, spread.shift / figure.unit.scale
    value, upper, reach = figure.value, figure.upper, shift + figure.rounding
    gap = ours - value if ours < value else max(ours - upper, 0.0)
    if not figure.consistent:
        verdict = FigureVerdict.INCONSISTENT
    elif math.isnan(ours) or abs(gap) > reach * (1.0 + 1e-9):
        verdict = FigureVerdict.NOT_EXPLAINED
    elif math.isinf(value) or math.isinf(upper):
        clear = ours - shift >= value - figure.rounding and ours + shift <= upper + figure.rounding
        verdict = FigureVerdict.REPRODUCED if clear else FigureVerdict.NOT_DETERMINED
    else:
        size = abs(value) if figure.size is None else figure.size
        verdict = FigureVerdict.NOT_DETERMINED if 2.0 * shift > WIDE * size else FigureVerdict.REPRODUCED
    return JudgedFigure(figure, ours, reach, gap / reach, verdict, spread.failed)


def validate(
    grid: Grid,
    bench: BenchParameters,
    draws: int,
    rng: np.random.Generator,
    figures: tuple[PublishedFigure, ...] = FIGURES,
) -> tuple[JudgedFigure, ...]:
    """Every published figure next to what the published grid gives.

    Parameters
    ----------
    grid : Grid
        The published grid.
    bench : BenchParameters
        Numbers of the bench.
    draws : int
        Draws within the rounding of the tables.
    rng : Generator
        Their source.
    figures : tuple of PublishedFigure
        Which figures.

    Raises
    ------
    GridError
        The grid is not the thesis's.
    FitError
        Too few draws.
    """
    found = spreads(printed(grid), bench, draws, rng)
    judged = {figure.id: _judge(figure, found[figure.id]) for figure in figures}
    return tuple(_with_other_constant(j, judged) for j in judged.values())


def _with_other_constant(j: JudgedFigure, judged: dict[str, JudgedFigure]) -> JudgedFigure:
    """The figure with its final verdict, which hangs on whether it comes out with the other eddy constant."""
    twin = judged.get(f"{j.figure.group}-implied.{j.figure.id.partition('.')[2]}")
    comes_out = (FigureVerdict.REPRODUCED, FigureVerdict.NOT_DETERMINED)
    if j.verdict is FigureVerdict.NOT_EXPLAINED and twin is not None and twin.verdict in comes_out:
        return replace(j, verdict=FigureVerdict.OTHER_CONSTANT)
    return j


def count(judged: tuple[JudgedFigure, ...]) -> dict[FigureVerdict, int]:
    """Counts of figures by verdict."""
    return {verdict: sum(j.verdict is verdict for j in judged) for verdict in FigureVerdict}

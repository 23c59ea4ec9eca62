"""Prediction of withheld rows by named candidates: parts withheld before anything is chosen."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Generic

import numpy as np

from pmg.pipeline.diagnosis.engine.free_form import BEND
from pmg.pipeline.diagnosis.engine.held_out import (
    LEAST_SIZE,
    HeldOut,
    compared,
    touched_blocks,
    training_rows,
    unpredicted,
    withheld_left,
)
from pmg.pipeline.diagnosis.engine.problem import F, P
from pmg.pipeline.fit.span import lengths

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.sim.signals import Array, Mask

BLOCKS = 48
"""Blocks of neighbours that are dealt to the folds, where rows follow one another in time."""

FOLDS = 4
"""Parts withheld in turn; for each the whole choice is made anew without it."""

FARTHEST = 2.0
"""Standard deviation of a withheld prediction, in noise of the row, beyond which the row is not looked at: a fit is not
asked to reach beyond its data."""

UNSEEN_PART = 1e-4
"""Part of a row along directions that training rows do not show, from which on it cannot be predicted."""

FEWEST_BLOCKS = 2
"""Blocks in which an effect must act for one to be withheld."""

LOST = 0.1
"""Part of the rows that may be beyond the reach of what the other folds name; where more are, all count."""

STEADY = 0.6
"""Part of the choices in the folds that must agree with the choice on all rows, for it to be called the cause."""

PLACEBOS = 20
"""Placebos tried, each another shuffle."""


@dataclass(frozen=True)
class Withholding(ABC, Generic[F, P]):
    """Rows as they are withheld and predicted, not whitened.

    Parameters
    ----------
    y : (m,) array
        Measured less what the fixed baseline predicts.
    columns : (m, k) array
        What the baseline may use.
    scale : (m,) array
        Standard deviation of each row.
    block, fold : (m,) array of int
        Block of neighbours, and the fold it is dealt to; rows of fold `folds` always train.
    groups : list of (g,) array of int
        Rows among which a placebo is shuffled.
    what : str
        The blocks, in words.
    """

    y: Array
    columns: Array
    scale: Array
    block: npt.NDArray[np.int64]
    fold: npt.NDArray[np.int64]
    groups: list[npt.NDArray[np.intp]]
    what: str

    noun: ClassVar[str]
    """The chosen kind, with its verb: ``mechanism was``."""

    @property
    def for_one(self) -> float:
        """Rows that tell a mean of squares as well as one whose noise is its own."""
        return 1.0

    folds: ClassVar[int] = FOLDS
    """Parts withheld in turn."""

    @abstractmethod
    def part(self, rows: Mask) -> P:
        """The problem of some of the rows."""

    @abstractmethod
    def effect(self, fits: tuple[F, ...]) -> Array:
        """Joint effect of fits on each row."""

    @abstractmethod
    def predictors(self, fits: tuple[F, ...]) -> tuple[Array, Array, Array]:
        """Predictions of fits for every row as they are, columns refitted with the baseline, and all their slopes."""

    def free_form(self, fits: tuple[F, ...]) -> Array:
        """Columns (m, k) along which the laws of fits may bend; none here."""
        del fits
        return self.columns[:, :0]

    def beside_each_other(self, chosen: tuple[F, ...], named: tuple[F, ...]) -> tuple[F, ...]:
        """Fits that predict in place of those chosen without a part of the rows, which stand one after the other."""
        del named
        return chosen

    def touched(self, fits: tuple[F, ...]) -> Mask:
        """Rows that fits act on, of those in a fold."""
        effect = self.effect(fits)
        return np.asarray((np.abs(effect) > 0.1 * np.sqrt(np.mean(effect**2))) & (self.fold < self.folds))


def withhold(
    rows: Withholding[F, P],
    catalogue: CandidateCatalogue[F, P],
    fits: tuple[F, ...],
    rng: np.random.Generator,
    placebo_rng: np.random.Generator | None = None,
    *,
    bent: bool = False,
) -> HeldOut | None:
    """Errors on withheld blocks, with the baseline alone and with what the rest of the rows would name.

    None where what is named acts in fewer than two blocks that the rest of the rows determines.

    Parameters
    ----------
    rows : Withholding
        All rows.
    catalogue : Catalogue
        What may be named.
    fits : tuple of Fit
        What was named on all rows; it decides only which rows are looked at, and how many candidates are chosen from
        the rest.
    rng, placebo_rng : numpy.random.Generator
        Resamples the blocks; shuffles the placebo, the same where not given.
    bent : bool
        Whether the laws of what is chosen may bend along their own covariates.

    Notes
    -----
    For every fold the candidates are chosen among the whole catalogue, and baseline and candidates are fitted, on the
    other folds only.
    """
    y, columns, scale = rows.y, rows.columns, rows.scale
    touched = rows.touched(fits)
    before, after = withheld_left(y, columns, scale, rows.fold, rows.folds), y.copy()
    reach_before, reach_after = np.zeros_like(y), np.zeros_like(y)
    sets: list[tuple[F, ...]] = []
    for k in np.unique(rows.fold[rows.fold < rows.folds]):
        train, test = rows.fold != k, rows.fold == k
        reach_before[test] = _reach(columns, scale, train, test)
        found = _choose_all(rows.part(train), catalogue, len(fits))
        sets.append(found)
        found = rows.beside_each_other(found, fits)
        fixed, moving, slopes = rows.predictors(found)
        free = rows.free_form(found) if bent else columns[:, :0]
        used, uncertain = (np.hstack([columns, own, free]) for own in (moving, slopes))
        after[test] = unpredicted(y - fixed, used, scale, train, _spread(used, free))[test]
        reach_after[test] = _reach(uncertain, scale, train, test, _spread(uncertain, free))
    touched &= reach_before <= FARTHEST
    reached, of = touched & (reach_after <= FARTHEST), int(touched.sum())
    touched = reached if reached.sum() >= (1.0 - LOST) * of else touched
    blocks = touched_blocks(rows.block, touched)
    if len(blocks) < FEWEST_BLOCKS:
        return None
    named = {fit.identifier for fit in fits}
    kept, tries = sum(fit.identifier in named for found in sets for fit in found), len(sets) * len(fits)
    split = _split(rows, len(sets), f"{kept} of {tries}", of - int(touched.sum()), of)
    return replace(
        compared(split, (before, after), scale, (rows.block, touched), rng),
        placebo_gain=_placebo_gain(rows, rows.effect(fits), before, touched, placebo_rng or rng),
        expected_before=_expected(scale, reach_before, touched),
        expected_after=_expected(scale, reach_after, touched),
        for_one=rows.for_one,
        kept=kept / tries,
        in_every_part=frozenset.intersection(*(frozenset(fit.identifier for fit in found) for found in sets)),
        elsewhere=() if kept >= STEADY * tries else _elsewhere(sets, named),
    )


def _spread(columns: Array, free: Array) -> Array:
    """Standard deviation of each coefficient beforehand: `BEND` for the last ones, along which laws bend."""
    return np.repeat([np.inf, BEND], [columns.shape[1] - free.shape[1], free.shape[1]])


def _split(rows: Withholding[F, P], parts: int, kept: str, aside: int, of: int) -> str:
    lost = f"; {aside} of {of} readings, which the rest does not determine, left out of the count" if aside else ""
    withheld = f"{rows.what}, in {parts} parts, each withheld before the choice"
    return f"{withheld}: the same {rows.noun} chosen in {kept}{lost}"


def _elsewhere(sets: list[tuple[F, ...]], named: set[str]) -> tuple[tuple[Any, ...], ...]:
    """Sets of other candidates than those named, each once, most frequent first."""
    identified = [frozenset(fit.identifier for fit in fits) for fits in sets]
    candidates = [tuple(fit.candidate for fit in fits) for fits in sets]
    first = dict(zip(identified[::-1], candidates[::-1], strict=True))
    return tuple(first[identifiers] for identifiers, _ in Counter(identified).most_common() if identifiers != named)


def _placebo_gain(
    rows: Withholding[F, P], effect: Array, before: Array, touched: Mask, rng: np.random.Generator
) -> float:
    """Mean fall of the withheld error by the effect shuffled over the rows of a group.

    `before` is the withheld error of each row without it.
    """
    without = math.sqrt((before[touched] ** 2).mean())
    gains = []
    for _ in range(PLACEBOS):
        shuffled = effect.copy()
        for group in rows.groups:
            shuffled[group] = effect[rng.permutation(group)]
        columns = np.column_stack([rows.columns, shuffled])
        after = withheld_left(rows.y, columns, rows.scale, rows.fold, rows.folds)
        gains.append(without - math.sqrt((after[touched] ** 2).mean()))
    return float(np.mean(gains))


def _reach(columns: Array, scale: Array, train: Mask, test: Mask, spread: Array | None = None) -> Array:
    """Standard deviation with which the training rows predict the baseline of the test rows, over their noise.

    Infinite where a test row lies along a direction of which the training rows hold as good as nothing.
    """
    length = lengths(columns / scale[:, None])
    _, size, along = np.linalg.svd(training_rows(columns, scale, train, spread) / length, full_matrices=False)
    along, size = (each[size > LEAST_SIZE * size[0]] for each in (along, size))
    rows = columns[test] / length
    reach = np.linalg.norm(rows @ (along.T / size), axis=1) / scale[test]
    unseen = np.linalg.norm(rows - rows @ along.T @ along, axis=1) > UNSEEN_PART * np.linalg.norm(rows, axis=1)
    return np.where(unseen, np.inf, reach)


def _expected(scale: Array, reach: Array, touched: Mask) -> float:
    """Withheld error that noise alone gives: that of the row and that of the fit which predicts it."""
    return math.sqrt(float(np.mean((scale[touched] ** 2) * (1.0 + np.minimum(reach[touched], FARTHEST) ** 2))))


def _choose_all(problem: P, catalogue: CandidateCatalogue[F, P], count: int) -> tuple[F, ...]:
    """That many candidates: one after the other, then each once more beside the others."""
    found: tuple[F, ...] = ()
    for _ in range(count):
        found = (*found, _beside(problem, catalogue, found))
    for _ in range(count if count > 1 else 0):
        found = (*found[1:], _beside(problem, catalogue, found[1:]))
    return found


def _beside(problem: P, catalogue: CandidateCatalogue[F, P], others: tuple[F, ...]) -> F:
    """The best candidate beside others."""
    for fit in others:
        problem = problem.take_out(fit)
    return catalogue.choose(problem, [fit.identifier for fit in others])

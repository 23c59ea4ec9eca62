"""The withheld proof: does a named mechanism help on recordings withheld before anything is chosen."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.grid.explanation import take_out
from pmg.pipeline.diagnose.grid.holdout import HeldOut, deal, gain_interval, solve, touched_blocks
from pmg.pipeline.diagnose.grid.ranking import choose
from pmg.pipeline.diagnose.grid.traces import tangents
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.fit.whitening import Whitener
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnose.grid.candidates import Candidate, Stage
    from pmg.pipeline.diagnose.grid.fitting import CandidateFit
    from pmg.sim.signals import Array, Mask

FARTHEST = 2.0
"""Standard deviation of a withheld prediction, in noise of the reading, beyond which the reading is not looked at: a
fit is not asked to reach beyond its data."""

LOST = 0.1
"""Part of the readings that may be beyond the reach of what the other folds name; where more are, all count."""

STEADY = 0.6
"""Part of the choices in the folds that must agree with the choice on all readings, for it to be called the cause."""

PLACEBOS = 20
"""Placebos tried, each another shuffle."""

FOLDS = 4
"""Parts withheld in turn; for each the whole choice is made anew without it."""


def withhold(stage: Stage, fits: tuple[CandidateFit, ...], rng: np.random.Generator) -> HeldOut:
    """Errors on withheld blocks, with the baseline alone and with what the rest of the readings would name.

    Parameters
    ----------
    stage : Stage
        All readings.
    fits : tuple of CandidateFit
        What was named on all of them; it decides only which readings are looked at, and how many mechanisms are
        chosen from the rest.
    rng : numpy.random.Generator
        Resamples the blocks.

    Notes
    -----
    Blocks of neighbours in the order of the test, or whole inner rows of sun speed where the order is not known. For
    every fold the mechanism is chosen among the whole catalogue, and baseline and mechanism are fitted, on the other
    folds only. What was run before a point is known without its reading, so mechanisms with a memory see the whole
    run history.
    """
    readings, at = stage.readings, stage.readings.grid.points
    block, fold = deal(readings, FOLDS)
    effect = np.sum([fit.effect for fit in fits], axis=0)
    touched = (np.abs(effect) > 0.1 * np.sqrt(np.mean(effect**2))) & (fold < FOLDS)
    y = readings.torque - stage.predicted
    columns = stage.columns
    before, after = y.copy(), y.copy()
    within = np.ones(len(y), dtype=bool)
    reach_before, reach_after = np.zeros_like(y), np.zeros_like(y)
    chosen: Counter[str] = Counter()
    sets: list[tuple[Candidate, ...]] = []
    for k in range(FOLDS):
        train, test = fold != k, fold == k
        scale = stage.white.scale
        reach_before[test] = _reach(columns, scale, train, test)
        within[test] = reach_before[test] <= FARTHEST
        before[test] = _left(y, columns, scale, train)[test]
        found = _choose_all(_part(stage, train), len(fits))
        effects = np.sum([stage.effect(fit.candidate, fit.values) for fit in found], axis=0)
        free = [columns, *(_free_tangents(stage, fit) for fit in found)]
        sets.append(tuple(fit.candidate for fit in found))
        chosen.update(fit.candidate.identifier for fit in found)
        moving = np.hstack(free if len(found) > 1 else [columns])
        after[test] = _left(y - effects, moving, scale, train)[test]
        reach_after[test] = _reach(np.hstack(free), scale, train, test)
    squares = before**2, after**2
    touched &= within
    reached, of = touched & (reach_after <= FARTHEST), int(touched.sum())
    touched = reached if reached.sum() >= (1.0 - LOST) * of else touched
    aside = of - int(touched.sum())
    blocks = touched_blocks(block, touched)
    if len(blocks) < 2:
        where, came = "held-out proof", f"{len(blocks)} blocks of readings"
        raise FitError(where, came, "two or more", "Measure more speeds, or record when each point was run.")
    named = {fit.candidate.identifier for fit in fits}
    kept = sum(count for name, count in chosen.items() if name in named)
    what = "blocks of neighbouring points in the order of the test" if at.ordered else "inner rows of sun speed"
    return HeldOut(
        split=f"{what}, a quarter at a time, withheld before the choice: the same mechanism was chosen in {kept} of "
        f"{FOLDS * len(fits)}"
        + (f"; {aside} of {of} readings, which the rest does not determine, left out of the count" if aside else ""),
        rmse_before=math.sqrt(squares[0][touched].mean()),
        rmse_after=math.sqrt(squares[1][touched].mean()),
        noise_floor=math.sqrt(float(np.mean(stage.white.scale[touched] ** 2))),
        gain_interval=gain_interval(*squares, blocks, rng),
        placebo_gain=_placebo_gain(stage, effect, before, fold, touched, rng),
        expected_before=_expected(stage.white.scale, reach_before, touched),
        expected_after=_expected(stage.white.scale, reach_after, touched),
        count=int(touched.sum()),
        kept=kept / (FOLDS * len(fits)),
        elsewhere=() if kept >= STEADY * FOLDS * len(fits) else _elsewhere(sets, named),
    )


def _elsewhere(sets: list[tuple[Candidate, ...]], named: set[str]) -> tuple[tuple[Candidate, ...], ...]:
    """Sets of other mechanisms than those named, each once, most frequent first."""
    told = [frozenset(candidate.identifier for candidate in candidates) for candidates in sets]
    first = dict(zip(told[::-1], sets[::-1], strict=True))
    return tuple(first[identifiers] for identifiers, _ in Counter(told).most_common() if identifiers != named)


def _placebo_gain(
    stage: Stage,
    effect: Array,
    before: Array,
    fold: npt.NDArray[np.int64],
    touched: Mask,
    rng: np.random.Generator,
) -> float:
    """Mean fall of the withheld error by the effect shuffled over the readings of a shaft and configuration [N m].

    `before` is the withheld error of each reading without it [N m].
    """
    y, scale = stage.readings.torque - stage.predicted, stage.white.scale
    places = np.char.add(np.where(stage.readings.sun, "sun ", "ring "), stage.readings.configuration)
    groups = [np.flatnonzero(places == place) for place in np.unique(places)]
    without = math.sqrt((before[touched] ** 2).mean())
    gains = []
    for _ in range(PLACEBOS):
        shuffled = effect.copy()
        for rows in groups:
            shuffled[rows] = effect[rng.permutation(rows)]
        after = y.copy()
        columns = np.column_stack([stage.columns, shuffled])
        for k in range(FOLDS):
            train, test = fold != k, fold == k
            after[test] = _left(y, columns, scale, train)[test]
        gains.append(without - math.sqrt((after[touched] ** 2).mean()))
    return float(np.mean(gains))


def _reach(columns: Array, scale: Array, train: Mask, test: Mask) -> Array:
    """Standard deviation with which the training rows predict the baseline of the test rows, over their noise."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(length > 0.0, length, 1.0)
    inverse = np.linalg.pinv(unit[train] / scale[train, None], rcond=1e-8)
    return np.asarray(np.linalg.norm(unit[test] @ inverse, axis=1) / scale[test])


def _expected(scale: Array, reach: Array, touched: Mask) -> float:
    """Withheld error that noise alone gives [N m]: that of the reading and that of the fit which predicts it."""
    return math.sqrt(float(np.mean((scale[touched] ** 2) * (1.0 + np.minimum(reach[touched], FARTHEST) ** 2))))


def _left(y: Array, columns: Array, scale: Array, train: Mask) -> Array:
    """Readings less the baseline that the training rows determine."""
    solution = solve(columns[train] / scale[train, None], y[train] / scale[train])
    return np.asarray(y - columns @ solution)


def _part(stage: Stage, rows: Mask) -> Stage:
    """The stage of some of the readings; neighbours are no longer neighbours, so the noise is taken as white."""
    readings = stage.readings[rows]
    white = Whitener(stage.white.scale[rows], ())
    columns = stage.columns[rows]
    basis = orthonormal(white(columns))
    y = white((readings.torque - stage.predicted[rows])[:, None])[:, 0]
    left = y - basis @ (basis.T @ y)
    predicted, ideal = stage.predicted[rows], stage.ideal[rows]
    return replace(
        stage,
        readings=readings,
        white=white,
        baseline=basis,
        left=left,
        predicted=predicted,
        ideal=ideal,
        columns=columns,
    )


def _choose_all(stage: Stage, count: int) -> list[CandidateFit]:
    """That many mechanisms: one after the other, then each once more beside the others."""
    found: list[CandidateFit] = []
    for _ in range(count):
        found.append(_beside(stage, found))
    for _ in range(count if count > 1 else 0):
        found = [*found[1:], _beside(stage, found[1:])]
    return found


def _beside(stage: Stage, others: list[CandidateFit]) -> CandidateFit:
    """The best mechanism beside others."""
    for fit in others:
        stage = take_out(stage, fit)
    return choose(stage, [fit.candidate.identifier for fit in others])


def _free_tangents(stage: Stage, fit: CandidateFit) -> Array:
    """Slopes of a candidate's parameters that are not on a bound (m, k) [N m per unit]."""
    inside = [parameter.name not in fit.on_bound for parameter in fit.candidate.parameters]
    return tangents(stage, fit)[:, inside]

"""Does naming terms help on recordings it has not seen: blocks withheld, a whole record withheld, and decoys."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnose.balance.estimate import design_of
from pmg.pipeline.diagnose.balance.fitting import Tabled, fit_term
from pmg.pipeline.diagnose.engine.catalogue import ENTRY
from pmg.pipeline.diagnose.grid.holdout import BLOCKS, HeldOut, gain_interval, solve
from pmg.pipeline.diagnose.grid.withheld import FOLDS

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnose.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnose.balance.recorded import Recorded
    from pmg.pipeline.diagnose.balance.serial import SerialNoise
    from pmg.pipeline.diagnose.balance.term import Term
    from pmg.sim.signals import Array, Mask

DECOYS = 40
"""Decoy terms that are tried."""


def blocks_of(samples: int) -> npt.NDArray[np.int64]:
    """Block of neighbours of each sample."""
    return (np.arange(samples) * BLOCKS) // samples


def withhold(
    recorded: Recorded,
    problem: TermProblem,
    noise: SerialNoise,
    baseline: tuple[Term, ...],
    fits: tuple[TermFit, ...],
    rng: np.random.Generator,
) -> HeldOut:
    """Error on withheld blocks of neighbours without and with what the other blocks would name.

    Parameters
    ----------
    recorded : Recorded
        The recording that the fits are made to.
    problem : TermProblem
        Beside the baseline alone.
    noise : SerialNoise
        Its noise.
    baseline : tuple of Term
        Free terms of the baseline.
    fits : tuple of TermFit
        What was named on all of it; decides only how many terms are chosen from the rest.
    rng : numpy.random.Generator
        Resamples the blocks.

    Notes
    -----
    The whole choice is made anew for each part, on the other parts only.
    """
    y = recorded.force
    block = blocks_of(len(y))
    fold = block % FOLDS
    plain = design_of(recorded, baseline, ())
    before, after = y.copy(), y.copy()
    chosen: Counter[str] = Counter()
    for k in range(FOLDS):
        train, test = fold != k, fold == k
        part = problem.of(train[noise.lags :])
        picked: list[TermFit] = []
        for _ in fits:
            best = TermCatalogue(refine=False).rank(part, [f.identifier for f in picked])[0]
            part = part.take_out(best)
            picked.append(best)
        chosen.update(f.identifier for f in picked)
        before[test] = _left(plain, y, train)[test]
        after[test] = _left(design_of(recorded, baseline, tuple(picked)), y, train)[test]
    kept = sum(chosen[f.identifier] for f in fits)
    return held_out(
        f"{BLOCKS} blocks of neighbouring samples, a quarter at a time, withheld before the choice: the same terms "
        f"were chosen in {kept} of {FOLDS * len(fits)}",
        before,
        after,
        noise,
        rng,
    )


def held_out(split: str, before: Array, after: Array, noise: SerialNoise, rng: np.random.Generator) -> HeldOut:
    """Errors before and after, with the interval of their difference from resampled blocks."""
    block = blocks_of(len(before))
    rows = [np.flatnonzero(block == k) for k in np.unique(block)]
    squares = before**2, after**2
    return HeldOut(
        split,
        math.sqrt(squares[0].mean()),
        math.sqrt(squares[1].mean()),
        noise.standard_deviation,
        gain_interval(*squares, rows, rng),
    )


def _left(design: Array, y: Array, train: Mask) -> Array:
    return np.asarray(y - design @ solve(design[train], y[train]))


def set_against(
    recorded: Recorded,
    noise: SerialNoise,
    baseline: tuple[Term, ...],
    sets: tuple[tuple[TermFit, ...], tuple[TermFit, ...]],
    rng: np.random.Generator,
) -> HeldOut:
    """Error on withheld blocks with one set of terms and with another, amplitudes fitted on the other blocks."""
    y = recorded.force
    fold = blocks_of(len(y)) % FOLDS
    errors = []
    for fits in sets:
        design = design_of(recorded, baseline, fits)
        left = np.zeros_like(y)
        for k in range(FOLDS):
            left[fold == k] = _left(design, y, fold != k)[fold == k]
        errors.append(left)
    return held_out("blocks of neighbouring samples, a quarter at a time", errors[0], errors[1], noise, rng)


@dataclass(frozen=True)
class Decoys:
    """Terms without a meaning, put to the same test.

    Parameters
    ----------
    tried, entered : int
        How many, and how many had the evidence to enter.
    most_evidence : float
        The largest evidence among them.
    gains : tuple of float
        Fall of the relative error on the withheld record by each, as part of 1; empty without such a record.
    """

    tried: int
    entered: int
    most_evidence: float
    gains: tuple[float, ...]


def try_decoys(
    problem: TermProblem,
    noise: SerialNoise,
    design: Array,
    recorded: Recorded,
    withheld: tuple[Recorded, Array] | None,
    rng: np.random.Generator,
) -> Decoys:
    """Columns of the library with their phases drawn at random, offered to the same problem.

    Parameters
    ----------
    problem : TermProblem
        With the named terms taken out.
    noise : SerialNoise
        The noise.
    design : (n, k) array
        Thinned columns of baseline and named terms.
    recorded : Recorded
        The recording that is fitted.
    withheld : (Recorded, (w, k) array), optional
        The withheld recording and the same columns there.
    rng : numpy.random.Generator
        Draws the phases.

    Notes
    -----
    A decoy has the spectrum of a true column, so it is as smooth, and no meaning; another draw of it stands in the
    withheld record. What it gains there is luck.
    """
    tables = [t for t in problem.tables.values() if t.term.shape is None and _moves(recorded.columns(t.term))]
    evidence, gains = [], []
    for i in range(DECOYS):
        term = tables[i % len(tables)].term
        column = _surrogate(recorded.columns(term), rng)
        white = noise.whiten(column)
        wide = replace(term, amplitudes=tuple(replace(q, bounds=(-1e12, 1e12)) for q in term.amplitudes))
        table = Tabled(wide, np.array([math.nan]), white[:, None, :])
        fit = fit_term(replace(problem, tables={term.identifier: table}), wide)
        evidence.append(problem.score(fit))
        if withheld is not None:
            other, there = withheld
            values = solve(np.c_[design, column], recorded.force)
            plain = solve(design, recorded.force)
            whole = float(np.linalg.norm(other.force + other.known))
            after = other.force - np.c_[there, _surrogate(other.columns(term), rng)] @ values
            before = other.force - there @ plain
            gains.append(float(np.linalg.norm(before) - np.linalg.norm(after)) / whole)
    return Decoys(DECOYS, sum(e > ENTRY for e in evidence), max(evidence), tuple(gains))


def _moves(columns: Array) -> bool:
    """Whether columns vary; a constant has no phases to draw."""
    return float(np.std(columns)) > 0.1 * float(np.sqrt(np.mean(columns**2)))


def _surrogate(columns: Array, rng: np.random.Generator) -> Array:
    """Columns of the same spectrum, without their mean, with random phases."""
    spectrum = np.fft.rfft(columns - columns.mean(axis=0), axis=0)
    phases = np.exp(2j * np.pi * rng.random((len(spectrum), 1)))
    return np.asarray(np.fft.irfft(np.abs(spectrum) * phases, n=len(columns), axis=0))

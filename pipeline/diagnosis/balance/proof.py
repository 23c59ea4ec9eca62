"""Prediction of recordings not used for the fit: blocks withheld, a whole record withheld, and decoys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.estimate import design_of
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.decoys import gains_of
from pmg.pipeline.diagnosis.engine.held_out import HeldOut, compared, solve, withheld_left
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS, FOLDS, Withholding

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array, Mask

UNTELLING = 3.0
"""Noise of a sample, over that which all share, from which on an error there tells nothing."""

DECOYS = 40
"""Decoy terms that are tried."""


def _blocks_of(samples: int) -> npt.NDArray[np.int64]:
    """Block of neighbours of each sample."""
    return (np.arange(samples) * BLOCKS) // samples


@dataclass(frozen=True)
class WithheldSamples(Withholding[TermFit, TermProblem]):
    """Samples of a record as they are withheld; whitening has lost the first `lags` of them."""

    recorded: Recorded
    problem: TermProblem
    noise: SerialNoise
    noun = "terms were"

    def part(self, rows: Mask) -> TermProblem:
        """The problem of some samples."""
        return self.problem.of(rows[self.noise.lags :])

    @property
    def for_one(self) -> float:
        """Neighbours are alike."""
        return self.noise.for_one

    def effect(self, fits: tuple[TermFit, ...]) -> Array:
        """Force of fitted terms [N]."""
        return np.asarray(design_of(self.recorded, (), fits) @ np.concatenate([fit.amplitudes for fit in fits]))

    def touched(self, fits: tuple[TermFit, ...]) -> Mask:
        """Every sample that tells: a record is continuous."""
        return telling(self.scale, self.noise)

    def predictors(self, fits: tuple[TermFit, ...]) -> tuple[Array, Array, Array]:
        """Columns of the terms at their shapes, refitted with the baseline."""
        columns = design_of(self.recorded, (), fits)
        return np.zeros(len(self.y)), columns, columns


def withheld_samples(recorded: Recorded, problem: TermProblem, noise: SerialNoise, plain: Array) -> WithheldSamples:
    """The samples of a record next to the free columns (n, k) of its baseline, dealt to the folds of the proof."""
    n = len(recorded.force)
    block = _blocks_of(n)
    return WithheldSamples(
        y=recorded.force,
        columns=plain,
        scale=recorded.noise_of_rows(noise.standard_deviation),
        block=block,
        fold=block % FOLDS,
        groups=[np.arange(n)],
        what=f"{BLOCKS} blocks of neighbouring samples",
        recorded=recorded,
        problem=problem,
        noise=noise,
    )


def held_out(
    split: str, errors: tuple[Array, Array], noise: SerialNoise, recorded: Recorded, rng: np.random.Generator
) -> HeldOut:
    """Errors of the samples of recordings (n,) before and after, with the interval of their difference from blocks."""
    scale = recorded.noise_of_rows(noise.standard_deviation)
    return compared(split, errors, scale, (_blocks_of(len(scale)), telling(scale, noise)), rng)


def telling(scale: Array, noise: SerialNoise) -> Mask:
    """Samples (n,) whose noise is not far above that which all share; every one where that is so everywhere."""
    found = scale < UNTELLING * noise.standard_deviation
    return found if found.any() else ~found


def set_against(
    recorded: Recorded,
    noise: SerialNoise,
    baseline: tuple[Term[Motion], ...],
    sets: tuple[tuple[TermFit, ...], tuple[TermFit, ...]],
    rng: np.random.Generator,
) -> HeldOut:
    """Error on withheld blocks with one set of terms and with another, amplitudes fitted on the other blocks."""
    y, scale = recorded.force, recorded.noise_of_rows(noise.standard_deviation)
    fold = _blocks_of(len(y)) % FOLDS
    before, after = (withheld_left(y, design_of(recorded, baseline, fits), scale, fold, FOLDS) for fits in sets)
    return held_out("blocks of neighbouring samples, a quarter at a time", (before, after), noise, recorded, rng)


@dataclass(frozen=True)
class FurtherDecoys:
    """Terms without a meaning, offered to what the named ones leave.

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
) -> FurtherDecoys:
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
    terms, columns, gains = _decoy_terms(problem, recorded), [], []
    for term in terms:
        column = _surrogate(recorded.columns(term), rng)
        columns.append(noise.whiten(column))
        if withheld is not None:
            other, there = withheld
            values = solve(np.c_[design, column], recorded.force)
            plain = solve(design, recorded.force)
            whole = other.size
            after = other.force - np.c_[there, _surrogate(other.columns(term), rng)] @ values
            before = other.force - there @ plain
            gains.append(float(np.linalg.norm(before) - np.linalg.norm(after)) / whole)
    evidence = gains_of(problem, columns)[1]
    return FurtherDecoys(DECOYS, int(np.sum(evidence > ENTRY)), float(evidence.max()), tuple(gains))


def surrogate_decoys(
    problem: TermProblem, recorded: Recorded, noise: SerialNoise, rng: np.random.Generator
) -> Iterator[Array]:
    """Whitened decoys with the spectrum of the library's columns."""
    for term in _decoy_terms(problem, recorded):
        yield noise.whiten(_surrogate(recorded.columns(term), rng))


def _decoy_terms(problem: TermProblem, recorded: Recorded) -> list[Term[Motion]]:
    """Terms whose columns decoys are drawn from, in turn."""
    terms = [table.term for table in problem.tables.values()]
    varying = [term for term in terms if term.shape is None and _moves(recorded.columns(term))]
    return [varying[i % len(varying)] for i in range(DECOYS)]


def _moves(columns: Array) -> bool:
    """Whether columns vary; a constant has no phases to draw."""
    return float(np.std(columns)) > 0.1 * float(np.sqrt(np.mean(columns**2)))


def _surrogate(columns: Array, rng: np.random.Generator) -> Array:
    """Columns of the same spectrum, without their mean, with random phases."""
    spectrum = np.fft.rfft(columns - columns.mean(axis=0), axis=0)
    phases = np.exp(2j * np.pi * rng.random((len(spectrum), 1)))
    return np.asarray(np.fft.irfft(np.abs(spectrum) * phases, n=len(columns), axis=0))

"""Terms fitted together with a free baseline: amplitudes in closed form inside their bounds, the shape searched."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import Term
from pmg.pipeline.diagnosis.balance.periods import periods
from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem, bounded_sizes
from pmg.pipeline.diagnosis.engine.scan import ABSORBED
from pmg.pipeline.diagnosis.engine.shape_search import best_shape, hills
from pmg.pipeline.fit.span import freed, orthonormal

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.serial import SerialNoise
    from pmg.sim.signals import Array, Mask

SHAPES = 24
"""Values of a shape, evenly spaced on a logarithm, from which its fit starts."""

FINELY = 96
"""The same of a term whose columns change with a small part of it."""

AT_ONCE = 32
"""Values of a shape whose columns are filtered at once."""


@dataclass(frozen=True)
class Tabled:
    """A term at many values of its shape.

    Parameters
    ----------
    term : Term
        The term.
    shapes : (g,) array
        Values of the shape; one NaN where the term has none.
    columns : (n, g, a) array
        Columns at each of them.
    """

    term: Term[Any]
    shapes: Array
    columns: Array


def _shape_grid(term: Term[Any], recorded: Recorded, *, coarse: bool = False) -> Array:
    """Values of the shape at which a term is looked at first; four of them where it is only to be allowed for."""
    if term.shape is None:
        return np.array([math.nan])
    low, high = term.shape.bounds
    if coarse:
        return np.geomspace(low, high, 6)[1:-1]
    return (
        periods(recorded, (low, high)) if term.even_grid else np.geomspace(low, high, FINELY if term.sharp else SHAPES)
    )


def tabulate(recorded: Recorded, terms: tuple[Term[Any], ...], *, coarse: bool = False) -> dict[str, Tabled]:
    """Thinned columns of every term over its shapes."""
    tables = {}
    for term in terms:
        shapes = _shape_grid(term, recorded, coarse=coarse)
        if not len(shapes):
            continue  # no period that these samples could show
        parts = []
        for first in range(0, len(shapes), AT_ONCE):
            some = shapes[first : first + AT_ONCE]
            whole = np.stack([term.columns(recorded.motion, float(s)) for s in some], axis=1)
            thinned = recorded.thin(whole.reshape(len(whole), -1))
            parts.append(thinned.reshape(len(thinned), *whole.shape[1:]))
        tables[term.key] = Tabled(term, shapes, np.concatenate(parts, axis=1))
    return tables


@dataclass(frozen=True)
class TermFit(Fit[Term[Any]]):
    """A term fitted together with the baseline.

    Parameters
    ----------
    amplitudes : (a,) array
        Best amplitudes inside their bounds.
    shape : float
        Best shape; NaN without one.
    """

    amplitudes: Array
    shape: float

    @property
    def place(self) -> str:
        """Where it acts."""
        return self.candidate.place

    @property
    def admissible(self) -> bool:
        """Whether no parameter ran to a bound: a term that did is absent, or bends to anything."""
        return self.gain > 0.0 and not self.on_bound


@dataclass(frozen=True)
class TermProblem(WhitenedProblem[TermFit]):
    """The whitened problem of a record: its force and the free terms of the baseline.

    Parameters
    ----------
    columns_of : callable
        Whitened columns of a term at a value of its shape.
    tables : mapping of str to Tabled
        Whitened columns over the shapes.
    absorbed : float
        Part of a term's columns that must survive the baseline for it to be seen.
    """

    columns_of: Callable[[Term[Any], float], Array]
    tables: Mapping[str, Tabled]
    absorbed: float = ABSORBED

    def of(self, rows: Mask) -> TermProblem:
        """The problem of some rows, before anything was taken out; the baseline is made orthonormal anew."""
        tables = {k: replace(t, columns=t.columns[rows]) for k, t in self.tables.items()}
        basis, left = freed(self.baseline[rows], self.left[rows])
        return TermProblem(basis, left, lambda term, shape: self.columns_of(term, shape)[rows], tables, self.absorbed)

    def slopes(self, fit: TermFit) -> Array:
        """Whitened columns of a fitted term, also of an amplitude that is known, and the derivative to its shape."""
        columns = self.columns_of(fit.candidate, fit.shape)
        if fit.candidate.shape is None:
            return columns
        if fit.candidate.one_of:
            return np.hstack([columns, np.zeros((len(columns), 1))])
        low, high = shape_step(fit.candidate, fit.shape)
        slope = (self.columns_of(fit.candidate, high) - self.columns_of(fit.candidate, low)) / (high - low)
        return np.hstack([columns, (slope @ fit.amplitudes)[:, None]])


def term_problem(recorded: Recorded, tables: dict[str, Tabled], noise: SerialNoise, baseline: Array) -> TermProblem:
    """The problem of a recording for noise that is known.

    Parameters
    ----------
    recorded : Recorded
        The recording.
    tables : dict of str to Tabled
        Its terms, not whitened.
    noise : SerialNoise
        Its noise.
    baseline : (n, k) array
        Thinned columns of the free baseline.
    """

    def columns_of(term: Term[Any], shape: float) -> Array:
        return noise.whiten(recorded.columns(term, shape))

    white = {key: replace(table, columns=noise.whiten(table.columns)) for key, table in tables.items()}
    force = noise.whiten(recorded.force[:, None])[:, 0]
    return TermProblem(*freed(noise.whiten(baseline), force), columns_of, white)


FLAT = 2.0
"""Fall of the sum of squares [noise variances] from a shape at its bound to the one before it, up to which the data do
not tell it from that one."""


def fit_term(problem: TermProblem, term: Term[Any], *, refine: bool = True) -> TermFit:
    """Best amplitudes and shape of one term with the baseline free to move."""
    table = problem.tables[term.key]
    m, g, a = table.columns.shape
    seen = problem.project(table.columns.reshape(m, g * a)).reshape(m, g, a)
    gains = _gains(seen, problem.left, term)
    best = int(np.argmax(gains))
    inner = min(max(best, 1), g - 2) if g > 2 and not term.one_of else best
    untold = best != inner and bool(gains[best] - gains[inner] < FLAT)
    tops = hills(seen[:, :, 0], problem.left, table.shapes) if term.whole and refine else []
    untold = untold and all(gain - gains[inner] < FLAT for _, gain in tops)
    best = inner if untold else best
    shape = float(table.shapes[best])
    if term.shape is not None and refine and not untold and not term.one_of:

        def gain_of(shape: float) -> float:
            own = problem.project(problem.columns_of(term, shape))
            return float(_gains(own[:, None, :], problem.left, term)[0])

        starts = [start for start, _ in tops] or [shape]
        climbed = (best_shape(gain_of, table.shapes, gains, start, even=term.even_grid) for start in starts)
        shape = max(climbed, key=lambda reached: reached[1])[0]
        best = int(np.argmin(np.abs(table.shapes - shape)))
    tabled = term.shape is None or shape == table.shapes[best]
    whole = table.columns[:, best] if tabled else problem.columns_of(term, shape)
    seen = problem.project(whole)
    size = float(np.linalg.norm(whole))
    survives = float(np.linalg.norm(seen)) / size if size > 0.0 else 0.0
    bounds = np.array([q.bounds for q in term.amplitudes]).T
    shape_cost = 0.0 if term.shape is None else term.shape.cost
    if survives < problem.absorbed:
        none = tuple(q.name for q in term.amplitudes)
        return TermFit(term, 0.0, shape_cost, np.zeros(len(seen)), none, np.zeros(len(term.amplitudes)), shape)
    _, amplitudes = bounded_sizes(seen, problem.left, bounds)
    at_end = [np.isclose(amplitudes, end, rtol=1e-9, atol=0.0) for end in bounds]
    low = at_end[0] & (at_end[0].all() or not term.of_parts)
    at = (low | at_end[1]) & term.free
    on_bound = [q.name for q, hit in zip(term.amplitudes, at, strict=True) if hit]
    if (
        term.shape is not None
        and not term.one_of
        and not 1.001 * term.shape.bounds[0] < shape < 0.999 * term.shape.bounds[1]
    ):
        on_bound.append(term.shape.name)
    effect = seen @ amplitudes
    gain = float(problem.left @ problem.left - np.sum((problem.left - effect) ** 2))
    cost = float(orthonormal(seen[:, term.free], 1e-2).shape[1])
    return TermFit(term, gain, cost + shape_cost, effect, tuple(on_bound), amplitudes, shape)


def promised(problem: TermProblem, term: Term[Any]) -> float:
    """Gain of a term of known size between its tabled shapes, as far as these tell [noise variances]."""
    table = problem.tables[term.key]
    tops = hills(problem.project(table.columns[:, :, 0]), problem.left, table.shapes)
    return max((gain for _, gain in tops), default=0.0)


def _gains(seen: Array, left: Array, term: Term[Any]) -> Array:
    """Fall of the sum of squares at each shape (g,); a single amplitude keeps to its bounds."""
    if seen.shape[2] == 1:
        column = seen[:, :, 0]
        along, square = column.T @ left, np.maximum(np.sum(column**2, axis=0), 1e-300)
        amplitude = np.clip(along / square, *term.amplitudes[0].bounds)
        return np.asarray(2.0 * amplitude * along - amplitude**2 * square)
    along = np.einsum("mga,m->ga", seen, left)
    by_shape = seen.transpose(1, 0, 2)
    square = by_shape.transpose(0, 2, 1) @ by_shape
    ridge = np.maximum(1e-9 * np.trace(square, axis1=1, axis2=2), 1e-300)[:, None, None] * np.eye(seen.shape[2])
    return np.asarray(np.einsum("ga,ga->g", along, np.linalg.solve(square + ridge, along[:, :, None])[:, :, 0]))


def shape_step(term: Term[Any], shape: float) -> tuple[float, float]:
    """Two values about a shape, inside its bounds, for its derivative."""
    assert term.shape is not None
    low, high = term.shape.bounds
    step = 1e-3 * shape if not term.even_grid else 1e-4 * shape
    return max(shape - step, low), min(shape + step, high)

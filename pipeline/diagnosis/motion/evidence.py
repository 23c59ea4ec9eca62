"""Runs in motion as evidence: rows whitened and compressed, with all that they may follow."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermProblem
from pmg.pipeline.diagnosis.balance.mismatch import DRAWS
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.problem import freed
from pmg.pipeline.diagnosis.motion.constants import (
    MAP_WAVES,
    RIPPLE,
    dry_name,
    eccentricity_names,
    form_names,
    map_name,
    ripple_names,
)
from pmg.pipeline.diagnosis.motion.families import spans_of, structures
from pmg.pipeline.diagnosis.motion.view import RotorView, views_of
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.noise import RowNoise
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.diagnosis.motion.terms import MotionTerm
    from pmg.sim.signals import Array, Mask

OFF_SHEET = "data sheet"
"""Configuration of a place that is a constant far from its data sheet."""

OF_SHEET = {
    **{f"{name}_{side}": (f"{name}_{side}",) for side in SIDES for name in ("inertia", "compliance", "skew", "zero")},
    "pull_out": ("pull_out",),
    **{f"drag_{side}": form_names(side) for side in SIDES},
    **{dry_name(side): (dry_name(side),) for side in SIDES},
    "map": tuple(map(map_name, MAP_WAVES)),
    **{f"eccentricity_{side}": eccentricity_names(side) for side in SIDES},
    **{f"ripple_{side}_{order}": ripple_names(side, order) for side in SIDES for order in RIPPLE},
}
"""Constants whose distance from the data sheet is a finding, together where they are of one curve."""

SHAPES = 8
"""Values of a shape, evenly spaced on a logarithm, at which a candidate is tabled."""

ABSORBED_BY_SHEET = 1e-4
"""Part of a candidate's columns that must survive the constants: their data sheet holds back what they would take up,
and that is a small part of a column that thousands of samples tell."""

REMEMBERED = 128
"""Columns of terms at values of their shape that are kept: the same are asked for beside every other term."""

SIGNATURE = 200
"""Fine samples by which columns are told to be the same."""

KEPT = 1e-2
"""Length of a direction, over the longest, from which on it is kept: what all columns of a stretch span."""


@dataclass(frozen=True)
class Family:
    """A kind of structure that was looked for.

    Parameters
    ----------
    side, configuration : str
        Whose rows.
    follows : str
        What it follows.
    """

    side: str
    configuration: str
    follows: str


@dataclass(frozen=True)
class MotionEvidence:
    """Rows of a campaign in motion, whitened and compressed.

    Every column that is looked at lies in the span of a stretch's columns; rows are the coordinates of it, so that
    noise stays white and nothing is lost but what no column follows.

    Parameters
    ----------
    evidence : Evidence
        For the mismatch test.
    problem : TermProblem
        For candidates.
    families : tuple of Family
        What each family of the evidence is.
    block : (m,) array of int
        RotorRows of each row; the rows of the data sheet have the last number.
    baseline : MotionBaseline
        What it was linearised about.
    columns : (m, k) array
        Of the constants of the baseline.
    y : (m,) array
        Measured less predicted.
    scatter : float
        Standard deviation of the rows about everything that is looked for, in units of the noise that sensors make;
        1 at least. Rows are in units of it.
    unexplained : (s,) array
        Mean square of what no column of a stretch follows, in noise variances: 1 where the noise is what it was
        thought to be.
    """

    evidence: Evidence
    problem: TermProblem
    families: tuple[Family, ...]
    block: npt.NDArray[np.int64]
    baseline: MotionBaseline
    columns: Array
    y: Array
    scatter: float
    unexplained: Array

    @property
    def of_sheet(self) -> Mask:
        """Rows of the data sheet."""
        return np.asarray(self.block == len(self.baseline.stretches))

    def torque_of(self, family: Family, seen: Array) -> float:
        """Root mean square [N m] of a structure, whitened (m,), over the stretches that a family may follow."""
        count, power = 0, 0.0
        for place, stretch in enumerate(self.baseline.stretches):
            if (stretch.side, str(stretch.run.run.configuration)) == (family.side, family.configuration):
                count += len(stretch)
                power += float(np.sum(seen[self.block == place] ** 2)) * self.scatter**2 * stretch.shaft.density * BAND
        return math.sqrt(power / max(count, 1))


@dataclass(frozen=True)
class _Compressed:
    """One stretch in the coordinates of its columns: rows, constants, structures, and candidates by key.

    `reading` (n, k) gives the coordinates of what is not whitened yet.
    """

    y: Array
    left: Array
    constants: Array
    structures: dict[Family, Array]
    candidates: dict[str, Array]
    reading: Array
    unexplained: float


def _shapes_of(term: MotionTerm) -> Array:
    """Values of the shape at which a term is tabled."""
    if term.shape is None:
        return np.array([math.nan])
    return np.array(term.one_of) if term.one_of else np.geomspace(*term.shape.bounds, SHAPES)


def motion_evidence(
    baseline: MotionBaseline, noise: list[RowNoise], terms: tuple[MotionTerm, ...], rng: np.random.Generator
) -> MotionEvidence:
    """The evidence of a campaign about a fitted baseline, with the terms that may be named."""
    views = views_of(baseline.clean)
    kinds = itertools.product(SIDES, (False, True))
    spans = {kind: spans_of([view for view in views if (view.side, view.coupled) == kind]) for kind in kinds}
    parts = [
        _compress(baseline, place, noise[place], view, terms, spans[view.side, view.coupled])
        for place, view in enumerate(views)
    ]
    sizes = [len(part.y) for part in parts]
    known = np.flatnonzero(np.isfinite(baseline.sheet.spread))
    sheet = np.zeros((len(known), len(baseline.sheet)))
    sheet[np.arange(len(known)), known] = 1.0 / baseline.sheet.spread[known]
    off = (baseline.sheet.expected - baseline.values)[known] / baseline.sheet.spread[known]
    y = np.concatenate([*(part.y for part in parts), off])
    columns = np.vstack([*(part.constants for part in parts), sheet])
    block = np.repeat(np.arange(len(parts) + 1, dtype=np.int64), [*sizes, len(known)])

    def stacked(of_part: list[Array | None], width: int) -> Array:
        blocks = [np.zeros((n, width)) if b is None else b for n, b in zip(sizes, of_part, strict=True)]
        return np.vstack([*blocks, np.zeros((len(known), width))])

    families = tuple(dict.fromkeys(family for part in parts for family in part.structures))
    found = []
    for family in families:
        of_part = [part.structures.get(family) for part in parts]
        found.append(stacked(of_part, next(b.shape[1] for b in of_part if b is not None)))
    scatter = _scatter(np.concatenate([*(part.left for part in parts), off]), [columns, *found])
    unit = np.where(block < len(parts), 1.0 / scatter, 1.0)
    y, columns, found = unit * y, unit[:, None] * columns, [unit[:, None] * each for each in found]
    for name, names in OF_SHEET.items():
        families = (*families, Family("both", OFF_SHEET, name))
        found.append(_units_of_sheet(baseline.sheet, names, len(y)))
    tables = {}
    for term in terms:
        shapes, a = _shapes_of(term), len(term.amplitudes)
        whole = stacked([part.candidates.get(term.key) for part in parts], len(shapes) * a)
        if term.constants:
            whole = _of_sheet(baseline.sheet, term.constants, len(y))
        if whole.any():
            tables[term.key] = Tabled(term, shapes, (unit[:, None] * whole).reshape(len(whole), len(shapes), a))

    @lru_cache(maxsize=REMEMBERED)
    def columns_of(term: MotionTerm, shape: float) -> Array:
        if term.constants:
            return _of_sheet(baseline.sheet, term.constants, len(y))
        if term.shape is None and term.key in tables and tables[term.key].term is term:
            return tables[term.key].columns[:, 0]
        of_part = [
            part.reading.T @ _of_term(view, term, np.array([shape])) if term.acts(view) else None
            for part, view in zip(parts, views, strict=True)
        ]
        return unit[:, None] * stacked(of_part, len(term.amplitudes))

    problem = TermProblem(*freed(columns, y), columns_of, tables, ABSORBED_BY_SHEET)
    draws, unexplained = rng.standard_normal((len(y), DRAWS)), np.array([part.unexplained for part in parts])
    evidence = Evidence(problem.left, problem.baseline, found, (np.ones(len(y), dtype=np.bool_),), draws)
    return MotionEvidence(evidence, problem, families, block, baseline, columns, y, scatter, unexplained)


def _scatter(left: Array, looked: list[Array]) -> float:
    everything = orthonormal(np.hstack(looked))
    rest = left - everything @ (everything.T @ left)
    return max(1.0, float(np.sqrt(rest @ rest / max(len(left) - everything.shape[1], 1))))


def _of_sheet(sheet: DataSheet, names: tuple[str, ...], rows: int) -> Array:
    """Columns (m, k) of constants that are off their data sheet: they move what the sheet says of them."""
    known = np.flatnonzero(np.isfinite(sheet.spread)).tolist()
    columns = np.zeros((rows, len(names)))
    for column, place in enumerate(sheet.at(name) for name in names):
        columns[rows - len(known) + known.index(place), column] = -1.0 / sheet.spread[place]
    return columns


def _units_of_sheet(sheet: DataSheet, names: tuple[str, ...], rows: int) -> Array:
    """The same per standard uncertainty of its data sheet."""
    return np.asarray(sheet.spread[[sheet.at(name) for name in names]] * _of_sheet(sheet, names, rows))


def _of_term(view: RotorView, term: MotionTerm, shapes: Array) -> Array:
    """Rows (r, g a) of a term at several values of its shape."""
    return np.asarray(view.state.stretch.of_rows(np.hstack([term.columns(view, float(shape)) for shape in shapes])))


def _compress(
    baseline: MotionBaseline,
    place: int,
    noise: RowNoise,
    view: RotorView,
    terms: tuple[MotionTerm, ...],
    spans: dict[str, float],
) -> _Compressed:
    """A stretch in the coordinates of all that is looked for in it."""
    stretch: RotorRows = view.state.stretch
    looked = {
        Family(view.side, str(stretch.run.run.configuration), name): columns
        for name, columns in structures(view, spans).items()
    }
    acting = [term for term in terms if term.acts(view)]
    tried = {term.key: np.hstack([term.columns(view, float(shape)) for shape in _shapes_of(term)]) for term in acting}
    constants = baseline.clean.columns(place)
    fine, at = _distinct([*looked.values(), *tried.values()])
    rows = np.hstack([constants, stretch.of_rows(fine)])
    readings = np.stack([baseline.missing(place), baseline.left(place)], 1)
    white = noise.white(np.hstack([rows, readings]))
    y, left = white[:, -2:].T
    basis = _span(white[:, :-2])
    rest = left - basis @ (basis.T @ left)
    inside = basis.T @ white[:, :-2]
    inside = np.hstack([inside[:, : len(baseline.sheet)], inside[:, len(baseline.sheet) + at]])
    blocks = [constants, *looked.values(), *tried.values()]
    split = np.split(inside, np.cumsum([block.shape[1] for block in blocks])[:-1], axis=1)
    return _Compressed(
        basis.T @ y,
        basis.T @ left,
        split[0],
        dict(zip(looked, split[1 : 1 + len(looked)], strict=True)),
        dict(zip(tried, split[1 + len(looked) :], strict=True)),
        noise.adjoint(basis),
        float(rest @ rest) / max(len(left) - basis.shape[1], 1),
    )


def _distinct(blocks: list[Array]) -> tuple[Array, npt.NDArray[np.intp]]:
    """Columns (n, u) of blocks, each once, and which of them each column is (k,): terms share waves of a turn."""
    samples = np.linspace(0, len(blocks[0]) - 1, SIGNATURE, dtype=np.intp) if blocks else np.zeros(0, dtype=np.intp)
    found: dict[bytes, int] = {}
    columns: list[Array] = []
    at: list[int] = []
    for block in blocks:
        for column, signature in zip(block.T, block[samples].T, strict=True):
            key = signature.tobytes()
            if key not in found:
                found[key] = len(columns)
                columns.append(column)
            at.append(found[key])
    return np.stack(columns, 1), np.array(at, dtype=np.intp)


def _span(columns: Array) -> Array:
    """Orthonormal basis of columns (n, k), each of unit length, by the eigenvectors of their products."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns[:, length > 0.0] / length[length > 0.0]
    squares, vectors = np.linalg.eigh(unit.T @ unit)
    kept = squares > KEPT**2 * squares[-1]
    return np.asarray(unit @ (vectors[:, kept] / np.sqrt(squares[kept])))

"""A stretch of a run in motion compressed: in the coordinates of all that is looked for in it, whitened."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from pmg.pipeline.diagnosis.motion.families import SWINGING, spans_by_kind, structures, swinging
from pmg.pipeline.diagnosis.motion.noise.hum import hums_of
from pmg.pipeline.diagnosis.motion.noise.steps_anew import off_by_steps
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.fit.span import taken_out
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array

SHAPES = 8
"""Values of a shape, evenly spaced on a logarithm, at which a candidate is tabled."""

SIGNATURE = 200
"""Fine samples by which columns that may be the same are found."""

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
    by_run : bool
        Whether every run follows it in its own way, as in its own phase.
    """

    side: str
    configuration: str
    follows: str
    by_run: bool = False


@dataclass(frozen=True)
class Compressed:
    """One stretch of a run in the coordinates of its columns: rows, constants, structures, and candidates by key.

    `run` is its file; `row_weights` (n, k) give the coordinates of rows that are not whitened: their products with
    them; `of_wander` (k, q) are the coordinates of the wander at each of its knots; `of_angles` (k, k) is the
    covariance that noise of the angles is thought to make, `of_steps` (k, d) what steps of the encoders make, counted
    anew d times; `unexplained` is the mean square of what no column follows, in noise variances: 1 where the noise is
    what it was thought to be.
    """

    run: str
    y: Array
    left: Array
    constants: Array
    structures: dict[Family, Array]
    candidates: dict[str, Array]
    row_weights: Array
    of_wander: Array
    of_angles: Array
    of_steps: Array
    unexplained: float


def shapes_of(term: MotionTerm) -> Array:
    """Values of the shape at which a term is tabled."""
    if term.shape is None:
        return np.array([math.nan])
    return np.array(term.one_of) if term.one_of else np.geomspace(*term.shape.bounds, SHAPES)


def compressed(baseline: MotionBaseline, noise: list[RowNoise], terms: tuple[MotionTerm, ...]) -> list[Compressed]:
    """Every stretch of a baseline."""
    views = views_of(baseline.clean)
    spans = spans_by_kind(views)
    left = [each.white(baseline.left(place)[:, None])[:, 0] for place, each in enumerate(noise)]
    hums, steps = hums_of(baseline.stretches, left), off_by_steps(baseline, jitters=True)
    return [
        _compress(baseline, place, noise[place], view, terms, spans[view.side, view.coupled], hums, steps[place])
        for place, view in enumerate(views)
    ]


def _compress(
    baseline: MotionBaseline,
    place: int,
    noise: RowNoise,
    view: RotorView,
    terms: tuple[MotionTerm, ...],
    spans: dict[str, float],
    hums: dict[str, float],
    steps: Array,
) -> Compressed:
    """A stretch in the coordinates of all that is looked for in it.

    `hums` are frequencies [Hz] by transducer, `steps` what the encoders make of its rows (n, d) [N m].
    """
    stretch = view.state.stretch
    configuration = str(stretch.run.run.configuration)
    looked = {Family(view.side, configuration, name): columns for name, columns in structures(view, spans).items()}
    if view.side in hums and not view.at_rest:
        frequency = hums[view.side]
        phase = REVOLUTION * frequency * stretch.run.time
        follows = f"frequency of {frequency:.1f} Hz"
        looked[Family(view.side, configuration, follows, by_run=True)] = np.stack([np.cos(phase), np.sin(phase)], 1)
    acting = [term for term in terms if term.acts(view)]
    tried = {term.key: np.hstack([term.columns(view, float(shape)) for shape in shapes_of(term)]) for term in acting}
    constants = baseline.clean.columns(place)
    fine, at = _distinct([*looked.values(), *tried.values()])
    rows = np.hstack([constants, stretch.of_rows(fine)])
    unsmoothed = stretch.of_rows(swinging(view, smoothed=False))  # mostly noise, which is no direction to look along
    white = noise.white(np.column_stack([rows, unsmoothed, baseline.missing(place), baseline.left(place)]))
    y, left = white[:, -2:].T
    basis = _span(white[:, :-3])
    rest = left - basis @ (basis.T @ left)
    inside, unsmoothed = basis.T @ white[:, :-3], basis.T @ white[:, -3:-2]
    inside = np.hstack([inside[:, : len(baseline.sheet)], inside[:, len(baseline.sheet) + at]])
    blocks = [constants, *looked.values(), *tried.values()]
    split = np.split(inside, np.cumsum([block.shape[1] for block in blocks])[:-1], axis=1)
    found = dict(zip(looked, split[1 : 1 + len(looked)], strict=True))
    for family in (each for each in found if each.follows == SWINGING):
        found[family] = np.hstack([found[family], unsmoothed])
    return Compressed(
        stretch.run.run.name,
        basis.T @ y,
        basis.T @ left,
        split[0],
        found,
        dict(zip(tried, split[1 + len(looked) :], strict=True)),
        (weights := noise.adjoint(basis)),
        weights.T @ noise.lines,
        noise.covariance_of_angles(weights),
        weights.T @ steps,
        float(rest @ rest) / max(len(left) - basis.shape[1], 1),
    )


def _distinct(blocks: list[Array]) -> tuple[Array, npt.NDArray[np.intp]]:
    """Columns (n, u) of blocks, each once, and which of them each column is (k,): terms share waves of a turn."""
    samples = np.linspace(0, len(blocks[0]) - 1, SIGNATURE, dtype=np.intp) if blocks else np.zeros(0, dtype=np.intp)
    found: dict[bytes, list[int]] = {}
    columns: list[Array] = []
    at: list[int] = []
    for block in blocks:
        for column, signature in zip(block.T, block[samples].T, strict=True):
            alike = found.setdefault(signature.tobytes(), [])
            same = next((k for k in alike if np.array_equal(columns[k], column)), len(columns))
            if same == len(columns):
                alike.append(same)
                columns.append(column)
            at.append(same)
    return np.stack(columns, 1), np.array(at, dtype=np.intp)


def _span(columns: Array) -> Array:
    """Orthonormal basis of columns (n, k), each of unit length, by the eigenvectors of their products."""
    length = np.linalg.norm(columns, axis=0)
    unit = columns[:, length > 0.0] / length[length > 0.0]
    squares, vectors = np.linalg.eigh(unit.T @ unit)
    kept = squares > KEPT**2 * squares[-1]
    return np.asarray(unit @ (vectors[:, kept] / np.sqrt(squares[kept])))


def scatter_beyond(left: Array, looked: Array) -> float:
    """Standard deviation of rows (m,) about all that columns (m, k) span."""
    rest, spanned = taken_out(looked, left)
    return float(np.sqrt(rest @ rest / max(len(left) - spanned, 1)))


def looked_for(
    parts: list[Compressed], stacked: Callable[[list[Array | None], int], Array]
) -> tuple[dict[Family, Array], dict[str, Array]]:
    """Columns of every family that is looked for, and of what a mass on a spring adds, by shaft."""
    looked: dict[Family, Array] = {}
    swinging: dict[str, Array] = {}
    for family in dict.fromkeys(family for part in parts for family in part.structures):
        of_part = [part.structures.get(family) for part in parts]
        alone = _run_by_run(of_part) if family.by_run else of_part
        whole = stacked(alone, next(b.shape[1] for b in alone if b is not None))
        if family.follows == SWINGING:
            swinging[family.side] = whole + swinging.get(family.side, 0.0)
        else:
            looked[family] = whole
    return looked, swinging


def _run_by_run(of_part: list[Array | None]) -> list[Array | None]:
    """Columns of each stretch that no other one shares."""
    whole = block_diag(*(np.zeros((0, 0)) if columns is None else columns for columns in of_part))
    rows = np.cumsum([0 if columns is None else len(columns) for columns in of_part])[:-1]
    return [None if columns is None else own for columns, own in zip(of_part, np.split(whole, rows), strict=True)]

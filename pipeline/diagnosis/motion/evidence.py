"""Runs in motion as evidence: rows whitened and compressed, with all that they may follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermProblem
from pmg.pipeline.diagnosis.balance.mismatch import DRAWS
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.motion.compressed import (
    Compressed,
    Family,
    compressed,
    looked_for,
    scatter_beyond,
    shapes_of,
)
from pmg.pipeline.diagnosis.motion.constants import (
    MAP_WAVES,
    RIPPLE,
    dry_name,
    eccentricity_names,
    form_names,
    map_name,
    passage_names,
    ripple_names,
)
from pmg.pipeline.diagnosis.motion.noise.row_noise import between_runs, row_noise
from pmg.pipeline.diagnosis.motion.noise.synthetic import synthetic_noise
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.fit.span import freed
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array, Mask

OFF_SHEET = "data sheet"
"""Configuration of a place that is a constant far from its data sheet."""

OF_SHEET = {
    **{f"{name}_{side}": (f"{name}_{side}",) for side in SIDES for name in ("inertia", "compliance", "skew", "zero")},
    "pull_out": ("pull_out",),
    **{f"drag_{side}": form_names(side) for side in SIDES},
    **{dry_name(side): (dry_name(side),) for side in SIDES},
    **{f"passage_{side}": passage_names(side) for side in SIDES},
    "map": tuple(map(map_name, MAP_WAVES)),
    **{f"eccentricity_{side}": eccentricity_names(side) for side in SIDES},
    **{f"ripple_{side}_{order}": ripple_names(side, order) for side in SIDES for order in RIPPLE},
}
"""Constants whose distance from the data sheet is a finding, together where they are of one curve."""

ABSORBED_BY_SHEET = 1e-4
"""Part of a candidate's columns that must survive the constants: their data sheet holds back what they would take up,
and that is a small part of a column that thousands of samples tell."""

REMEMBERED = 128
"""Columns of terms at values of their shape that are kept: the same are asked for beside every other term."""


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
    stretches : tuple of RotorRows
        Those of the baseline, then the readings of the shafts that their drives held meanwhile.
    block : (m,) array of int
        Stretch of each row; the rows of the data sheet have the last number.
    baseline : MotionBaseline
        What it was linearised about.
    columns : (m, k) array
        Of the constants of the baseline.
    granted : (m, g) array
        Of what any machine may have, which is free beside them.
    swinging : dict of str to (m, 2) array
        By shaft, what the torque of a mass on a spring follows beyond its inertia, smoothed and as it is. It is not
        looked for in itself: the noise of an acceleration follows it, too.
    y : (m,) array
        Measured less predicted.
    scatter : float
        Standard deviation of the rows about everything that is looked for, and about the faults of transducers whose
        columns hold their noise, in units of the noise that sensors make; 1 at least. Rows are in units of it.
    noise : tuple of RowNoise
        Of each stretch.
    of_wander : tuple of (r, q) array
        What the rows of each stretch show of the wander at its knots.
    """

    evidence: Evidence
    problem: TermProblem
    families: tuple[Family, ...]
    stretches: tuple[RotorRows, ...]
    block: npt.NDArray[np.int64]
    baseline: MotionBaseline
    columns: Array
    granted: Array
    swinging: dict[str, Array]
    y: Array
    scatter: float
    noise: tuple[RowNoise, ...]
    of_wander: tuple[Array, ...]

    @property
    def of_sheet(self) -> Mask:
        """Rows of the data sheet."""
        return np.asarray(self.block == len(self.stretches))

    @property
    def of_held(self) -> Mask:
        """Readings of shafts that are held, which are not searched for a difference."""
        return np.asarray((self.block >= len(self.baseline.stretches)) & ~self.of_sheet)

    def covariance_of(self, weights: Array) -> Array:
        """Covariance (p, p) of p numbers that are sums of the rows with `weights` (p, m).

        Rows of one run are white; those of different ones are not, as the wander of a reading goes on.
        """
        seen = [weights[:, self.block == place] @ shown for place, shown in enumerate(self.of_wander)]
        return np.asarray(weights @ weights.T + between_runs(self.noise, seen))

    def torque_of(self, family: Family, seen: Array) -> float:
        """Root mean square [N m] of a structure, whitened (m,), over the stretches that a family may follow."""
        count, power = 0, 0.0
        for place, stretch in enumerate(self.baseline.stretches):
            if (stretch.side, str(stretch.run.run.configuration)) == (family.side, family.configuration):
                count += len(stretch)
                power += float(np.sum(seen[self.block == place] ** 2)) * self.scatter**2 * stretch.shaft.density * BAND
        return math.sqrt(power / max(count, 1))


def motion_evidence(
    baseline: MotionBaseline, noise: list[RowNoise], terms: tuple[MotionTerm, ...], rng: np.random.Generator
) -> MotionEvidence:
    """The evidence of a campaign about a fitted baseline, with the terms that may be named.

    Readings of held shafts bear on what they show, and are not searched for a difference: what the frame passes on to
    them would be one.
    """
    turning, held = len(baseline.stretches), baseline.held
    noise = [*noise, *(row_noise(held, place, noise[0].slow_noise) for place in range(len(held.stretches)))]
    parts = [*compressed(baseline, noise[:turning], terms), *compressed(held, noise[turning:], terms)]
    off = baseline.sheet.off(baseline.values)
    y = np.concatenate([*(part.y for part in parts), off])
    columns = np.vstack([*(part.constants for part in parts), baseline.sheet.rows])
    block = np.repeat(np.arange(len(parts) + 1, dtype=np.int64), [*(len(part.y) for part in parts), len(off)])

    def stacked(of_part: list[Array | None], width: int) -> Array:
        blocks = [np.zeros((len(p.y), width)) if b is None else b for p, b in zip(parts, of_part, strict=True)]
        return np.vstack([*blocks, np.zeros((len(off), width))])

    tried = partial(_tried, parts, stacked)
    looked, swinging = looked_for(parts, stacked)
    looked |= _off_sheet(baseline.sheet, len(y))
    searched = (block < turning) | (block == len(parts))
    left = np.concatenate([*(part.left for part in parts), off])[searched]
    stretches = (*baseline.stretches, *held.stretches)
    sides = np.array([*(stretch.side for stretch in stretches), ""])[block]
    excluded = _of_transducers(tried, terms, sides)
    scatter = max(scatter_beyond(left, np.hstack([columns, *looked.values(), excluded])[searched]), 1.0)
    rough = (math.sqrt(max(part.unexplained, 1.0)) if k >= turning else 1.0 for k, part in enumerate(parts))
    unit = 1.0 / np.array([*(scatter * each for each in rough), 1.0])[block]
    y, columns = unit * y, unit[:, None] * columns
    looked = {family: unit[:, None] * each for family, each in looked.items()}
    swinging = {side: unit[:, None] * each for side, each in swinging.items()}
    tables = _tabled(terms, tried, baseline.sheet, unit, sides)
    views = [*views_of(baseline.clean), *views_of(held)]  # those before hold all that was worked out for the tables

    def worked_out(term: MotionTerm, shape: float) -> Array:
        if term.constants:
            return baseline.sheet.columns_of(term.constants, len(y))
        acting = zip(parts, views, strict=True)
        of_part = [p.row_weights.T @ term.rows_on(view, shape) if term.acts(view) else None for p, view in acting]
        return unit[:, None] * stacked(of_part, len(term.amplitudes))

    given = np.hstack([columns[:, :0], *(worked_out(t, t.granted) for t in terms if t.granted is not None)])
    free = freed(np.hstack([columns, given]), y)
    problem = TermProblem(*free, _remembered(worked_out, tables), tables, ABSORBED_BY_SHEET)
    draws = np.vstack([synthetic_noise(parts, noise, rng), rng.standard_normal((len(off), DRAWS))])
    all_rows, own = (np.ones(len(y), np.bool_),), unit[:, None] * excluded
    evidence = Evidence(problem.left, problem.baseline, list(looked.values()), all_rows, draws, excluded=own)
    return MotionEvidence(
        evidence=evidence,
        problem=problem,
        families=tuple(looked),
        stretches=stretches,
        block=block,
        baseline=baseline,
        columns=columns,
        granted=given,
        swinging=swinging,
        y=y,
        scatter=scatter,
        noise=tuple(noise),
        of_wander=tuple(part.of_wander for part in parts),
    )


def _tried(parts: list[Compressed], stacked: Callable[[list[Array | None], int], Array], term: MotionTerm) -> Array:
    """Whitened columns of a term at each of its shapes."""
    return stacked([part.candidates.get(term.key) for part in parts], shapes_of(term).size * len(term.amplitudes))


def _off_sheet(sheet: DataSheet, rows: int) -> dict[Family, Array]:
    """What is looked for of constants and sums of them off their data sheet, per standard uncertainty of it."""
    spreads = {name: sheet.spread[[sheet.at(each) for each in names]] for name, names in OF_SHEET.items()}
    found = {name: spreads[name] * sheet.columns_of(of, rows) for name, of in OF_SHEET.items()}
    return {Family("both", OFF_SHEET, name): each for name, each in (found | sheet.columns_of_sums(rows)).items()}


def _of_transducers(
    tried: Callable[[MotionTerm], Array], terms: tuple[MotionTerm, ...], side: npt.NDArray[Any]
) -> Array:
    """The columns (m, k) of faults of one transducer: gains, lags and delays, which hold the noise of a torque."""
    faults = (term for term in terms if term.hears is not None or term.comes_late)
    own = {(term.identifier, term.variant, at): (term, side == at) for term in faults for at in term.sides}
    return np.hstack([np.zeros((len(side), 0)), *(tried(term) * rows[:, None] for term, rows in own.values())])


def _tabled(
    terms: tuple[MotionTerm, ...],
    tried: Callable[[MotionTerm], Array],
    sheet: DataSheet,
    unit: Array,
    side: npt.NDArray[Any],
) -> dict[str, Tabled]:
    """Whitened columns of each term that acts, over its shapes, in the `unit` (m,) of the rows of a `side` (m,).

    What both transducers do alike is a term of its own where both shafts show it.
    """
    tables = {}
    for term in terms:
        shapes, a = shapes_of(term), len(term.amplitudes)
        whole = sheet.columns_of(term.constants, len(unit)) if term.constants else tried(term)
        shown = [whole[side == at].any() for at in term.sides] if term.comes_late else [whole.any()]
        if all(shown):
            tables[term.key] = Tabled(term, shapes, (unit[:, None] * whole).reshape(len(whole), len(shapes), a))
    return tables


def _remembered(
    worked_out: Callable[[MotionTerm, float], Array], tables: dict[str, Tabled]
) -> Callable[[Term[Any], float], Array]:
    """Columns of a term at a value of its shape; those of terms that are tabled are kept for a while."""

    @lru_cache(maxsize=REMEMBERED)
    def kept(term: MotionTerm, shape: float) -> Array:
        found = worked_out(term, shape)
        found.flags.writeable = False
        return found

    def columns_of(term: Term[Any], shape: float) -> Array:
        motion = cast("MotionTerm", term)
        if term.key not in tables or tables[term.key].term is not term:
            return worked_out(motion, shape)
        return tables[term.key].columns[:, 0] if term.shape is None else kept(motion, shape)

    return columns_of

"""Kinds of run withheld, and what is proved on them: fitted to ramps and steps, proved on the sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.engine.withheld import Withholding
from pmg.pipeline.diagnosis.motion.constants import start_name
from pmg.pipeline.diagnosis.motion.free_form import bent_columns
from pmg.pipeline.recording.run_records import Manoeuvre

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array, Mask

KINDS = ((Manoeuvre.RAMP, Manoeuvre.COAST), (Manoeuvre.STEPS,), (Manoeuvre.SWEEP,), (Manoeuvre.DITHER,))
"""Kinds of run that are withheld one after the other."""

NEVER = len(KINDS)
"""Fold of rows that are never withheld: zero runs and the data sheet."""


QUIETEST = 0.8
"""Noise of the rows, over what sensors and filters were thought to make, below which it is not believed."""


@dataclass(frozen=True)
class Starts:
    """Rows freed from the pole angle at which each engaged run begins, which no other run tells.

    Parameters
    ----------
    rows : tuple of (r,) array of int
        Rows of each engaged run.
    normals : tuple of (r,) array
        Unit normals of reflections, each of which brings what the angle does into the first of its rows.
    """

    rows: tuple[npt.NDArray[np.int64], ...]
    normals: tuple[Array, ...]

    @classmethod
    def of(cls, columns: Array) -> Starts:
        """Of what each angle does (m, r)."""
        rows, normals = [], []
        for column in columns.T:
            at = np.flatnonzero(column)
            if not len(at):
                continue
            along = column[at] / np.linalg.norm(column[at])
            along[0] += math.copysign(1.0, along[0])
            rows.append(at)
            normals.append(along / np.linalg.norm(along))
        return cls(tuple(rows), tuple(normals))

    @property
    def first(self) -> npt.NDArray[np.int64]:
        """Row of each run that holds the angle and nothing else (e,)."""
        return np.array([at[0] for at in self.rows], dtype=np.int64)

    def freed(self, columns: Array) -> Array:
        """Columns (m, ...) reflected; zero where the angles are."""
        found = columns.copy()
        for at, normal in zip(self.rows, self.normals, strict=True):
            found[at] -= 2.0 * np.multiply.outer(normal, normal @ found[at])
        found[self.first] = 0.0
        return found


@dataclass(frozen=True)
class WithheldRuns(Withholding[TermFit, TermProblem]):
    """Rows of a campaign as they are withheld, by kind of run, freed from the `starts` of each run."""

    problem: TermProblem
    constants: Array
    of_sheet: Mask
    held: Mask
    sheet: DataSheet
    starts: Starts
    noun = "mechanism was"
    folds: ClassVar[int] = NEVER

    def part(self, rows: Mask) -> TermProblem:
        """The problem of some rows."""
        return self.problem.of(rows)

    def effect(self, fits: tuple[TermFit, ...]) -> Array:
        """Whitened torque of fitted mechanisms."""
        return np.asarray(sum(self._columns(fit) @ fit.amplitudes for fit in fits))

    def predictors(self, fits: tuple[TermFit, ...]) -> tuple[Array, Array, Array]:
        """Columns of the mechanisms at their shapes, refitted with the baseline."""
        columns = np.hstack([self._columns(fit) for fit in fits])
        return np.zeros(len(self.y)), columns, columns

    def free_form(self, fits: tuple[TermFit, ...]) -> Array:
        """Columns (m, k) along which the laws of fits may bend."""
        return self.starts.freed(np.hstack([bent_columns(self.problem, fit) for fit in fits]))

    def _columns(self, fit: TermFit) -> Array:
        """Columns of a mechanism; of one that a data sheet is wrong about, the constants' own, free of the sheet."""
        names = cast("MotionTerm", fit.candidate).constants
        if names:
            columns = self.constants[:, [self.sheet.at(name) for name in names]]
            return self.starts.freed(np.where(self.of_sheet[:, None], 0.0, columns))
        return self.starts.freed(self.problem.columns_of(fit.candidate, fit.shape))

    def touched(self, fits: tuple[TermFit, ...]) -> Mask:
        """Rows of every run that may be withheld; the reading of a held shaft, where a mechanism moves it."""
        moved = np.hstack([self._columns(fit) for fit in fits]).any(axis=1)
        return np.asarray((self.fold < self.folds) & (moved | ~self.held))


def by_kind(found: MotionEvidence, fits: tuple[TermFit, ...], scatter: float) -> WithheldRuns:
    """The rows of a campaign, dealt to folds by kind of run; `scatter` is that of their noise."""
    folds = [_kind(stretch) for stretch in found.stretches]
    return _withheld(found, fits, scatter, folds, "kinds of run (ramps and coast-downs, steps, sweeps, dithers)")


def by_run(found: MotionEvidence, fits: tuple[TermFit, ...], scatter: float) -> WithheldRuns:
    """The same, dealt run by run, for what one kind of run alone can show: each fold has some of every kind."""
    seen: dict[int, list[str]] = {}
    folds = []
    for stretch in found.stretches:
        kind, name = _kind(stretch), stretch.run.run.name
        names = seen.setdefault(kind, [])
        if name not in names:
            names.append(name)
        folds.append(NEVER if kind == NEVER else (names.index(name) + kind) % NEVER)
    return _withheld(found, fits, scatter, folds, "runs, some of every kind at a time")


def _withheld(
    found: MotionEvidence, fits: tuple[TermFit, ...], scatter: float, folds: list[int], what: str
) -> WithheldRuns:
    """Rows with the folds of their stretches.

    A constant of which `fits` say that the data sheet is wrong, or that would take up what they do, has its value from
    there without them.
    """
    sheet = found.baseline.sheet
    terms = [cast("MotionTerm", fit.candidate) for fit in fits]
    named = (name for term in terms for name in (*term.constants, *term.mimicked_by))
    wrong = sorted({sheet.at(name) for name in named})
    y = found.y + found.columns[:, wrong] @ (found.baseline.values - sheet.expected)[wrong]
    angles = sorted({sheet.at(start_name(s.run.run.name)) for s in found.stretches if s.coupled})
    starts = Starts.of(found.columns[:, angles])
    fold = np.array([*folds, NEVER])[found.block]
    fold[starts.first] = NEVER
    columns = np.hstack([np.delete(found.columns, [*wrong, *angles], axis=1), found.granted])
    return WithheldRuns(
        y=starts.freed(y),
        columns=starts.freed(columns),
        constants=found.columns,
        of_sheet=found.of_sheet,
        held=found.of_held,
        sheet=sheet,
        scale=np.where(found.of_sheet, 1.0, max(scatter, QUIETEST)),
        block=found.block,
        fold=fold,
        groups=[np.flatnonzero(found.block == k) for k in np.unique(found.block)],
        what=what,
        problem=found.problem,
        starts=starts,
    )


def _kind(stretch: RotorRows) -> int:
    return next((fold for fold, kinds in enumerate(KINDS) if stretch.run.run.manoeuvre in kinds), NEVER)

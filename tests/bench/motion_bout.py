"""A concealed campaign of runs in motion as the contestants of `./pmgw bench rivals --track motion` see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import FOLDS
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.evidence import motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.sim.bench import load_bench
from pmg.sim.errors import FitError
from tests.bench.bout import BESIDE, AnyBout, Library, of_unit_size

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.trials.score.case_list import MotionLot
    from pmg.sim.signals import Array

ABSORBED = 1e-2
"""Part of a column that the baseline must leave where it is projected out."""


@dataclass(frozen=True)
class MotionBout(AnyBout):
    """Balances of the rotors in weak form, low-passed and whitened, about the fitted constants of the bench.

    Parameters
    ----------
    found : MotionEvidence
        What the diagnosis works on too.
    traces : tuple of (n,) array
        Missing torque of each stretch, row by row [noise].
    row_rate : float
        Rows a second [1/s].
    """

    found: MotionEvidence
    traces: tuple[Array, ...]
    row_rate: float

    @cached_property
    def fold(self) -> npt.NDArray[np.int64]:  # type: ignore[override]
        """A fold for every few runs; the rows of the data sheet are never withheld."""
        names = [stretch.run.run.name for stretch in self.found.baseline.stretches]
        of_run = {name: place % FOLDS for place, name in enumerate(dict.fromkeys(names))}
        return np.array([*(of_run[name] for name in names), FOLDS])[self.found.block]

    @cached_property
    def scale(self) -> Array:  # type: ignore[override]
        """Rows are in units of their noise."""
        return np.ones(len(self.found.y))

    @property
    def residual(self) -> Array:  # type: ignore[override]
        """Measured less predicted torque (m,)."""
        return self.found.y

    @property
    def free(self) -> Array:  # type: ignore[override]
        """Columns of the constants (m, k)."""
        return self.found.columns

    def library(self, kind: str) -> Library:
        """What each mechanism makes, at a middle value of its shape."""
        columns, owners = [], []
        for table in self.found.problem.tables.values():
            columns.append(table.columns[:, len(table.shapes) // 2])
            owners += [(table.term.identifier, table.term.place)] * columns[-1].shape[1]
        theta, names = of_unit_size(np.hstack(columns), owners)
        if kind != BESIDE:
            return Library(theta, names)
        left = np.sqrt(np.mean(self.beside(theta, np.ones(len(theta), dtype=np.bool_)) ** 2, axis=0))
        kept = left > ABSORBED
        return Library(
            theta[:, kept] / left[kept], tuple(n for n, k in zip(names, kept, strict=True) if k), beside=True
        )


def enter_in_motion(lot: MotionLot) -> MotionBout | None:
    """A campaign measured as `pmg prove --track motion` measures it; None where no baseline can be fitted."""
    runs = tuple(measure_motion_case(lot.draw(), lot.rng("measure")))
    try:
        baseline, _, noise = fit_constants(runs, load_bench())
    except FitError:
        return None
    found = motion_evidence(baseline, noise, library(), np.random.default_rng(0))
    traces = tuple(noise[k].white(baseline.left(k)[:, None])[:, 0] for k in range(len(baseline.stretches)))
    return MotionBout(found, traces, baseline.stretches[0].run.row_rate)

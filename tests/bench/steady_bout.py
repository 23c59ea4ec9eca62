"""A concealed campaign of steady points as the contestants of `./pmgw bench rivals` see it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.withheld import FOLDS
from pmg.pipeline.diagnosis.grid.candidates import candidates, grid_problem
from pmg.pipeline.diagnosis.grid.fitting import _signature
from pmg.pipeline.diagnosis.grid.withheld import deal
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import measure_case
from pmg.sim.bench import load_bench
from tests.bench.bout import BESIDE, GENERIC, AnyBout, Library, of_unit_size

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.trials.score.case_list import Lot
    from pmg.sim.signals import Array, Mask

DEGREE, FREQUENCIES = 2, 2
"""Of PySINDy's polynomial and Fourier libraries."""
ABSORBED = 1e-2
"""Part of a column that the baseline must leave where it is projected out."""


@dataclass(frozen=True)
class Bout(AnyBout):
    """A measured campaign of steady points about its calibrated baseline.

    Parameters
    ----------
    stage : GridProblem
        Readings, baseline, noise: what the diagnosis works on too.
    fold : (m,) array of int
        Fold of each reading.
    """

    stage: GridProblem
    fold: npt.NDArray[np.int64]

    @cached_property
    def scale(self) -> Array:  # type: ignore[override]
        """Noise of each reading [N m]."""
        return np.asarray(self.stage.white.scale)

    @cached_property
    def residual(self) -> Array:  # type: ignore[override]
        """Residual of the frozen baseline, in units of the noise."""
        return np.asarray((self.stage.readings.torque - self.stage.predicted) / self.scale)

    @cached_property
    def free(self) -> Array:  # type: ignore[override]
        """Columns of the baseline, in units of the noise."""
        return np.asarray(self.stage.columns / self.scale[:, None])

    @cached_property
    def covariates(self) -> Array:
        """Speed of sun and ring [rad/s], ring torque asked for [N m], time since the first point [s]: (m, 4)."""
        row, at = self.stage.readings.row, self.stage.readings.grid.points
        time = at.started_at - at.started_at.min()
        return np.stack([at.speed_sun[row], at.speed_ring[row], at.load_set[row], time[row]], axis=1)

    @property
    def shafts(self) -> tuple[tuple[str, Mask], ...]:
        """Readings of each transducer."""
        return ("sun", self.stage.readings.sun), ("ring", ~self.stage.readings.sun)

    def library(self, kind: str) -> Library:
        """PySINDy's own functions of the covariates, or what each mechanism does to each reading."""
        return generic_library(self) if kind == GENERIC else physical_library(self, beside=kind == BESIDE)


def enter(lot: Lot) -> Bout | None:
    """A campaign measured as `pmg prove` measures it; None where no baseline can be fitted."""
    bench = load_bench()
    analysis = analyse(measure_case(lot.draw(), lot.rng("measure")), AnalysisOptions(), bench)
    if analysis.calibration is None or analysis.fits is None or analysis.floor is None:
        return None
    readings = take_readings(analysis.grid, bench)
    stage = grid_problem(readings, bench, analysis.calibration.model, whitener(readings, bench, analysis.floor))
    return Bout(stage, deal(readings, FOLDS)[1])


def generic_library(bout: Bout) -> Library:
    """PySINDy's polynomials and Fourier terms of the four covariates, for each transducer."""
    import pysindy  # type: ignore[import-not-found, unused-ignore]

    low, high = bout.covariates.min(axis=0), bout.covariates.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    scaled = math.pi * (2.0 * (bout.covariates - low) / span - 1.0)
    library = pysindy.PolynomialLibrary(degree=DEGREE) + pysindy.FourierLibrary(n_frequencies=FREQUENCIES)
    whole = np.asarray(library.fit_transform(scaled))
    theta = np.hstack([whole * rows[:, None] for _, rows in bout.shafts])
    return Library(*of_unit_size(theta, [None] * theta.shape[1]))


def physical_library(bout: Bout, *, beside: bool = False) -> Library:
    """What each mechanism of the catalogue does to each reading, at the typical value of its shape.

    `beside` gives the regression what pmg's diagnosis works with: columns, and residual, less all that the baseline
    can take up.
    """
    columns, owners = [], []
    for candidate in candidates():
        if candidate.shaft == "both" and candidate.kind.both_at_once:
            continue
        shape = np.array([parameter.typical for parameter in candidate.parameters[len(candidate.sizes) :]])
        found = _signature(bout.stage, candidate, shape)
        columns.append(found / bout.scale[:, None])
        owners += [(candidate.identifier, candidate.shaft)] * found.shape[1]
    theta, names = of_unit_size(np.hstack(columns), owners)
    if beside:
        left = np.sqrt(np.mean(bout.beside(theta, np.ones(len(theta), dtype=bool)) ** 2, axis=0))
        kept = left > ABSORBED
        theta, names = theta[:, kept] / left[kept], tuple(name for name, keep in zip(names, kept, strict=True) if keep)
    return Library(theta, names, beside)

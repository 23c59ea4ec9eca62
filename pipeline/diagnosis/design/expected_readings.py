"""Readings to be expected at points not yet run, under each cause that is open, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.next_test import longer_problem
from pmg.pipeline.diagnosis.grid.candidates import predict_with
from pmg.pipeline.diagnosis.grid.refit import refit
from pmg.pipeline.fit.calibration import jacobian
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.wording.probability import COVERAGE_FACTOR

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.design.plans import Plan
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
    from pmg.pipeline.diagnosis.grid.refit import Refit
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array, Mask

STEP = 1e-3
"""Step of the differences behind a slope, in the size of a parameter."""


@dataclass(frozen=True)
class ExpectedReadings:
    """Readings to be expected of a plan.

    Parameters
    ----------
    point : (m,) array of int
        Point of the plan that each reading is of.
    sun : (m,) array of bool
        Whether it is the sun's torque; the ring's otherwise.
    value, u : mapping of str to (m,) array
        By cause: the reading to be expected [N m], and the standard uncertainty of one reading about it: that of the
        fit and the noise floor.
    """

    point: npt.NDArray[np.int64]
    sun: Mask
    value: Mapping[str, Array]
    u: Mapping[str, Array]

    def low(self, cause: str) -> Array:
        """Lower end of the band of a cause, at U = 2u [N m]."""
        return self.value[cause] - COVERAGE_FACTOR * self.u[cause]

    def high(self, cause: str) -> Array:
        """Upper end of the band of a cause, at U = 2u [N m]."""
        return self.value[cause] + COVERAGE_FACTOR * self.u[cause]

    @property
    def apart(self) -> Array:
        """Least distance of two bands, (m,) [N m]: above 0 where a reading speaks for one cause alone."""
        causes = list(self.value)
        gaps = [
            np.maximum(self.low(one) - self.high(other), self.low(other) - self.high(one))
            for i, one in enumerate(causes)
            for other in causes[:i]
        ]
        return np.min(gaps, axis=0) if gaps else np.full(len(self.point), -np.inf)


def expected_readings(
    problem: GridProblem, plan: Plan, causes: Mapping[str, tuple[CandidateFit, ...]], floor: NoiseFloor
) -> ExpectedReadings:
    """Readings of a plan under each cause, its baseline fitted anew together with it.

    Parameters
    ----------
    problem : GridProblem
        The readings of the campaign so far.
    plan : Plan
        Points to run.
    causes : mapping of str to tuple of CandidateFit
        What may be there, by its words; empty for the baseline alone.
    floor : NoiseFloor
        Scatter of a single reading.
    """
    readings = longer_problem(problem, plan, floor).readings
    measured = len(problem.readings.grid)
    new = readings.row >= measured
    noise = np.where(readings.sun, floor.sun.u, floor.ring.u)
    value: dict[str, Array] = {}
    u: dict[str, Array] = {}
    for words, fits in causes.items():
        found = refit(problem, fits)
        predicted = predict_with(readings, problem.bench, found.model, found.mechanisms(problem))
        slopes = _slopes(readings, problem, found)
        variance = _predicted_variance(slopes[~new], slopes[new], problem)
        value[words] = predicted[new]
        u[words] = np.sqrt(variance + noise[new] ** 2)
    return ExpectedReadings(readings.row[new] - measured, readings.sun[new], value, u)


def _slopes(readings: Readings, problem: GridProblem, found: Refit) -> Array:
    """Slopes of the readings against the baseline's constants and the parameters of the mechanisms, (m, k)."""
    columns = [jacobian(readings, problem.bench, found.model, BASELINE_FREE)]
    base = predict_with(readings, problem.bench, found.model, found.mechanisms(problem))
    for i, candidate in enumerate(found.candidates):
        for j, parameter in enumerate(candidate.parameters):
            low, high = parameter.bounds
            values = [np.array(each, dtype=np.float64) for each in found.values]
            step = STEP * abs(parameter.typical)
            step = step if values[i][j] + step <= high else -step
            values[i][j] = min(max(values[i][j] + step, low), high)
            moved = replace(found, values=tuple(values)).mechanisms(problem)
            change = predict_with(readings, problem.bench, found.model, moved) - base
            columns.append((change / step)[:, None])
    return np.hstack(columns)


def _predicted_variance(old: Array, new: Array, problem: GridProblem) -> Array:
    """Variance of predictions (m,) by the law of propagation, from the whitened readings that fixed the constants."""
    size = np.linalg.norm(old, axis=0)
    size[size == 0.0] = 1.0
    white = problem.white(old / size)
    covariance = np.linalg.pinv(white.T @ white, rcond=1e-12, hermitian=True)
    scaled = new / size
    return np.asarray(np.einsum("ij,jk,ik->i", scaled, covariance, scaled))

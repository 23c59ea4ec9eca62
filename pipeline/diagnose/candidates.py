"""What may have been left out, fitted beside the baseline: each mechanism of the catalogue, shaft by shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares, lsq_linear, minimize_scalar

from pmg.pipeline.calibrate import jacobian
from pmg.pipeline.diagnose.noise import BASELINE_FREE, orthonormal
from pmg.pipeline.readings import Readings, predict
from pmg.sim.gearbox import Gearbox
from pmg.sim.mechanisms import CANDIDATES, Instrument
from pmg.sim.solve import steady

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnose.whiten import Whitener
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism, Parameter
    from pmg.sim.signals import Array

SHAPE_STARTS = 4
"""Values of the first shape parameter, evenly spaced on a logarithm inside its bounds, from which a fit starts."""


@dataclass(frozen=True)
class Candidate:
    """A mechanism on one of the shafts it may sit on.

    Parameters
    ----------
    kind : type of Mechanism
        From the catalogue.
    shaft : str
        ``sun``, ``ring``, or ``both``.
    sizes : tuple of str
        Its parameters that vanish at the null, free here.
    """

    kind: type[Mechanism]
    shaft: str
    sizes: tuple[str, ...]

    @property
    def identifier(self) -> str:
        """Id of the mechanism."""
        return self.kind.identifier

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Free parameters: sizes, then shapes."""
        known = {p.name: p for p in self.kind.parameters()}
        return tuple(known[name] for name in (*self.sizes, *self.kind.shape))

    def mechanism(self, bench: BenchParameters, model: LossModel, values: Array) -> Mechanism:
        """The mechanism with these values of its free parameters."""
        named = {p.name: float(v) for p, v in zip(self.parameters, values, strict=True)}
        return replace(self.kind.of(bench, model), **named)


def candidates() -> tuple[Candidate, ...]:
    """Every mechanism of the catalogue that shows in mean torques, shaft by shaft, and on both where it may."""
    found = []
    for kind in CANDIDATES:
        found += [Candidate(kind, shaft, sizes) for shaft, sizes in kind.by_shaft.items()]
        if kind.both_at_once:
            found.append(Candidate(kind, "both", tuple(name for sizes in kind.by_shaft.values() for name in sizes)))
    return tuple(found)


def refinement(candidate: Candidate) -> Candidate | None:
    """The same mechanism on the same shaft in more detail; None where there is none."""
    kind = candidate.kind.refined
    if kind is None:
        return None
    groups = kind.by_shaft.values() if candidate.shaft == "both" else [kind.by_shaft[candidate.shaft]]
    return Candidate(kind, candidate.shaft, tuple(dict.fromkeys(name for group in groups for name in group)))


def predict_with(readings: Readings, bench: BenchParameters, model: LossModel, extra: tuple[Mechanism, ...]) -> Array:
    """What the simulator gives for each reading with further mechanisms in [N m]."""
    gearbox = Gearbox(bench, (*model.mechanisms(bench), *extra))
    return readings.of(steady(gearbox, readings.grid.points))


@dataclass(frozen=True)
class Stage:
    """Readings made white and freed from the baseline: where candidates are compared.

    Parameters
    ----------
    readings : Readings
        The m readings.
    bench : BenchParameters
        The bench.
    model : LossModel
        The calibrated baseline; candidates act beside it.
    white : Whitener
        Makes the noise white.
    baseline : (m, k) array
        Orthonormal basis of what the baseline's parameters can absorb, whitened.
    left : (m,) array
        Whitened readings less the prediction, with that taken out.
    predicted, ideal : (m,) array
        What the baseline, and a gear without any mechanism, give for each reading [N m].
    columns : (m, k) array
        What the baseline may use, before whitening [N m per unit]: slopes of its constants, and whatever else it is
        allowed to follow.
    """

    readings: Readings
    bench: BenchParameters
    model: LossModel
    white: Whitener
    baseline: Array
    left: Array
    predicted: Array
    ideal: Array
    columns: Array

    def project(self, values: Array) -> Array:
        """What of an effect [N m] the baseline cannot absorb, whitened."""
        column = self.white(values[:, None])[:, 0]
        return np.asarray(column - self.baseline @ (self.baseline.T @ column))

    def effect(self, candidate: Candidate, values: Array) -> Array:
        """Change of each reading by a candidate [N m].

        Torques on the rotors add up, so one of them is seen beside nothing else; a fault of an instrument distorts
        what the whole baseline gives.
        """
        extra = candidate.mechanism(self.bench, self.model, values)
        if isinstance(extra, Instrument):
            return predict_with(self.readings, self.bench, self.model, (extra,)) - self.predicted
        alone = steady(Gearbox(self.bench, (extra,)), self.readings.grid.points)
        return self.readings.of(alone) - self.ideal


def set_stage(
    readings: Readings, bench: BenchParameters, model: LossModel, white: Whitener, allowed: Array | None = None
) -> Stage:
    """The stage of a campaign, about a calibrated baseline that may follow some `allowed` columns (m, k) besides."""
    columns = jacobian(readings, bench, model, BASELINE_FREE)
    if allowed is not None:
        columns = np.hstack([columns, allowed])
    baseline = orthonormal(white(columns))
    predicted = predict(readings, bench, model)
    ideal = readings.of(steady(Gearbox(bench, ()), readings.grid.points))
    y = white((readings.torque - predicted)[:, None])[:, 0]
    left = y - baseline @ (baseline.T @ y)
    return Stage(readings, bench, model, white, baseline, left, predicted, ideal, columns)


@dataclass(frozen=True)
class CandidateFit:
    """A candidate fitted beside the baseline.

    Parameters
    ----------
    candidate : Candidate
        What was fitted.
    values : (k,) array
        Its parameters: sizes, then shapes.
    gain : float
        Fall of the whitened sum of squares; in units of the noise variance.
    effect : (m,) array
        Change of each reading [N m], before anything is absorbed.
    seen : (m,) array
        The same whitened, with what the baseline absorbs taken out.
    on_bound : tuple of str
        Parameters on a bound.
    """

    candidate: Candidate
    values: Array
    gain: float
    effect: Array
    seen: Array
    on_bound: tuple[str, ...]

    @property
    def cost(self) -> int:
        """Free parameters."""
        return len(self.values)


def fit_candidate(stage: Stage, candidate: Candidate) -> CandidateFit:
    """Best values of one candidate with the baseline free to move.

    Notes
    -----
    The baseline enters linearised, as a projection, so that only the candidate's own parameters are searched, inside
    their physical bounds: sizes in closed form where the effect is proportional to them, shapes from several values.
    """
    parameters = candidate.parameters
    low, high = (np.array([p.bounds[side] for p in parameters]) for side in (0, 1))
    fit = _by_proportion if candidate.kind.linear else _by_search
    cost, values = fit(stage, candidate)
    margin = 1e-6 * (high - low)
    at_bound = (values - low < margin) | (high - values < margin)
    effect = stage.effect(candidate, values)
    return CandidateFit(
        candidate,
        values,
        float(stage.left @ stage.left) - cost,
        effect,
        stage.project(effect),
        tuple(p.name for p, at in zip(parameters, at_bound, strict=True) if at),
    )


def shapes(candidate: Candidate) -> Iterator[Array]:
    """Values of the shape parameters from which a fit starts."""
    parameters = candidate.parameters[len(candidate.sizes) :]
    axes = [[p.typical] for p in parameters]
    if parameters:
        axes[0] = np.geomspace(*parameters[0].bounds, SHAPE_STARTS + 2)[1:-1].tolist()
    return (np.array(shape) for shape in product(*axes))


def _sizes(stage: Stage, candidate: Candidate, shape: Array) -> tuple[float, Array]:
    """Sum of squares and sizes inside their bounds, for an effect proportional to them."""
    columns = signature(stage, candidate, shape)
    seen = np.stack([stage.project(column) for column in columns.T], axis=1)
    length = np.linalg.norm(seen, axis=0)
    length[length == 0.0] = 1.0
    bounds = np.array([p.bounds for p in candidate.parameters[: len(candidate.sizes)]]).T * length
    found = lsq_linear(seen / length, stage.left, bounds=(bounds[0], bounds[1]), method="bvls")
    return 2.0 * float(found.cost), np.clip(found.x / length, *(bounds / length))


def _by_proportion(stage: Stage, candidate: Candidate) -> tuple[float, Array]:
    """Sum of squares and values; the only search is over one shape, on a logarithm."""
    starts = [(*_sizes(stage, candidate, shape), shape) for shape in shapes(candidate)]
    cost, sizes, shape = min(starts, key=lambda start: start[0])
    if len(shape) == 1:
        (parameter,) = candidate.parameters[len(candidate.sizes) :]
        around = math.log(parameter.bounds[1] / parameter.bounds[0]) / (SHAPE_STARTS + 1)
        bounds = (math.log(shape[0]) - around, math.log(shape[0]) + around)

        def costs(logarithm: float) -> float:
            return _sizes(stage, candidate, np.array([math.exp(logarithm)]))[0]

        found = minimize_scalar(costs, bounds=bounds, method="bounded", options={"xatol": 1e-3})
        if found.fun < cost:
            shape = np.array([math.exp(found.x)])
            cost, sizes = _sizes(stage, candidate, shape)
    return cost, np.r_[sizes, shape]


def _by_search(stage: Stage, candidate: Candidate) -> tuple[float, Array]:
    """Sum of squares and values by nonlinear least squares."""
    parameters = candidate.parameters
    typical = np.array([p.typical for p in parameters])
    low, high = (np.array([p.bounds[side] for p in parameters]) for side in (0, 1))
    best: tuple[float, Array] | None = None

    def residuals(scaled: Array) -> Array:
        return stage.left - stage.project(stage.effect(candidate, scaled * typical))

    for shape in shapes(candidate):
        start = np.r_[_sizes(stage, candidate, shape)[1], shape]
        inside = np.clip(start, low + 1e-9 * typical, high - 1e-9 * typical)
        found = least_squares(
            residuals, inside / typical, bounds=(low / typical, high / typical), x_scale="jac", xtol=1e-5, ftol=1e-7
        )
        if best is None or 2.0 * found.cost < best[0]:
            best = 2.0 * float(found.cost), found.x * typical
    assert best is not None
    return best


SMALL = 0.05
"""Part of a parameter's typical value at which its signature is taken."""


def signature(stage: Stage, candidate: Candidate, shape: Array) -> Array:
    """Effect on each reading per unit of each size (m, sizes), at small size and a given shape [N m per unit]."""
    columns = []
    for i, parameter in enumerate(candidate.parameters[: len(candidate.sizes)]):
        sizes = np.zeros(len(candidate.sizes))
        sizes[i] = SMALL * parameter.typical
        columns.append(stage.effect(candidate, np.r_[sizes, shape]) / sizes[i])
    return np.stack(columns, axis=1)

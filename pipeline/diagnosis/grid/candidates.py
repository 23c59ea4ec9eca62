"""Candidates for the cause, fitted with the baseline: each mechanism of the catalogue, shaft by shaft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem
from pmg.pipeline.fit.calibration import jacobian, parameter_names
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.fit.span import freed
from pmg.pipeline.fit.whitening import undo
from pmg.pipeline.grid.readings import Readings, change, predict
from pmg.sim.mechanisms import CANDIDATES, Instrument
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import holding_torques

if TYPE_CHECKING:
    from pmg.pipeline.fit.whitening import Whitener
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism, Parameter
    from pmg.sim.mechanisms.base import Torques
    from pmg.sim.signals import Array


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

    @property
    def powers(self) -> tuple[str, ...]:
        """Names of the shapes that are powers with which the law goes."""
        return tuple(name for name in self.kind.shape if name.endswith("power"))

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


def _rms(values: Array) -> float:
    """Root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


@dataclass(frozen=True)
class CandidateFit(Fit[Candidate]):
    """A mechanism fitted beside the baseline.

    Parameters
    ----------
    values : (k,) array
        Its parameters: sizes, then shapes.
    effect : (m,) array
        Change of each reading [N m], before anything is absorbed.
    strays : bool
        Whether a power of its law lies at the end of the range that its source gives, and would clearly go on.
    """

    values: Array
    effect: Array
    strays: bool = False

    @property
    def place(self) -> str:
        """Shaft on which it sits."""
        return self.candidate.shaft

    @property
    def needed(self) -> bool:
        """Whether not all sizes are on a bound: it would be absent, or as large as can be."""
        return not set(self.candidate.sizes) <= set(self.on_bound)

    @property
    def bends_to_anything(self) -> bool:
        """Whether its law strays, or is without a scale and not proportional to its sizes either."""
        return self.strays or (self.without_scale and not self.candidate.kind.linear)

    @property
    def size(self) -> float:
        """Root mean square of the effect over the readings it touches [N m], before anything is absorbed."""
        return _rms(self.effect[self.effect != 0.0])

    @property
    def without_scale(self) -> bool:
        """Whether every time or speed that gives it a scale ran to a bound: it then bends to anything slow."""
        shape = self.candidate.parameters[len(self.candidate.sizes) :]
        scales = [p.name for p in shape if p.unit != "1"] or [p.name for p in shape[:1]]
        return bool(scales) and set(scales) <= set(self.on_bound)


def predict_with(readings: Readings, bench: BenchParameters, model: LossModel, extra: tuple[Mechanism, ...]) -> Array:
    """Simulated value of each reading with further mechanisms in [N m]."""
    gearbox = Gearbox(bench, (*baseline_mechanisms(model, bench), *extra))
    return readings.of(holding_torques(gearbox, readings.grid.points))


class Known(Protocol):
    """Fits to all readings of a campaign, where those to a part of them start."""

    def fit(self, candidate: Candidate) -> CandidateFit:
        """The fit of a candidate to all readings."""

    def about(self, candidate: Candidate) -> tuple[Array, Array]:
        """Effect (m,) and slopes (m, k) of that fit at the m readings of the part."""

    def beside(self, candidate: Candidate) -> Known:
        """Fits next to a candidate, which is taken out."""


@dataclass(frozen=True)
class GridProblem(WhitenedProblem[CandidateFit]):
    """The whitened problem of a campaign: its readings about the calibrated baseline.

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
    predicted, ideal : (m,) array
        What the baseline, and a gear without any mechanism, give for each reading [N m].
    columns : (m, k) array
        What the baseline may use, before whitening [N m per unit]: slopes of its constants, and whatever else it is
        allowed to follow.
    drag : Torques
        What the baseline puts on the rotors at each point; it follows from the speeds alone [N m].
    whole : Known, optional
        Fits to all readings, where these are a part of them.
    """

    readings: Readings
    bench: BenchParameters
    model: LossModel
    white: Whitener
    predicted: Array
    ideal: Array
    columns: Array
    drag: Torques
    whole: Known | None = None

    @property
    def allowed(self) -> Array:
        """Columns that the baseline may follow besides its constants (m, j)."""
        return self.columns[:, len(parameter_names(self.model, BASELINE_FREE)) :]

    def take_out(self, fit: CandidateFit) -> GridProblem:
        """The problem with a fitted candidate taken out and its parameters free to move with the baseline's."""
        whole = None if self.whole is None else self.whole.beside(fit.candidate)
        return replace(super().take_out(fit), whole=whole)

    def beyond_baseline(self, effect: Array) -> Array:
        """The part of an effect [N m] that the baseline cannot absorb, whitened."""
        return self.project(self.white(effect[:, None])[:, 0])

    def unabsorbed(self, fit: CandidateFit) -> Array:
        """Effect of a fit on each reading, less the part that the baseline absorbs [N m]."""
        return undo(self.white, fit.seen)

    def visible(self, fit: CandidateFit) -> float:
        """Root mean square of the part that the baseline cannot absorb, over the readings the fit touches [N m]."""
        return _rms(self.unabsorbed(fit)[fit.effect != 0.0])

    def effect(self, candidate: Candidate, values: Array) -> Array:
        """Change of each reading by a candidate [N m].

        Torques on the rotors add up, so one of them is seen beside nothing else; a fault of an instrument distorts
        what the whole baseline gives.
        """
        extra = candidate.mechanism(self.bench, self.model, values)
        alone, fault = Gearbox(self.bench, (extra,)), isinstance(extra, Instrument)
        torques = holding_torques(alone, self.readings.grid.points, self.drag if fault else None)
        return change(self.readings.of(torques), self.predicted if fault else self.ideal)

    def fitted(
        self, candidate: Candidate, values: Array, gain: float = 0.0, on_bound: tuple[str, ...] = ()
    ) -> CandidateFit:
        """A candidate with values of its parameters, as a fit."""
        effect = self.effect(candidate, values)
        return CandidateFit(candidate, gain, len(values), self.beyond_baseline(effect), on_bound, values, effect)

    def tangents(self, fit: CandidateFit) -> Array:
        """Change of each reading per change of each parameter of a fitted candidate (m, k) [N m per unit]."""
        slopes = []
        for i, parameter in enumerate(fit.candidate.parameters):
            step = 1e-3 * max(abs(float(fit.values[i])), 1e-3 * parameter.typical)
            low, high = parameter.bounds
            up, down = fit.values.copy(), fit.values.copy()
            up[i], down[i] = min(fit.values[i] + step, high), max(fit.values[i] - step, low)
            slopes.append((self.effect(fit.candidate, up) - self.effect(fit.candidate, down)) / (up[i] - down[i]))
        return np.stack(slopes, axis=1)

    def slopes(self, fit: CandidateFit) -> Array:
        """The same, whitened."""
        return self.white(self.tangents(fit))


def grid_problem(
    readings: Readings, bench: BenchParameters, model: LossModel, white: Whitener, allowed: Array | None = None
) -> GridProblem:
    """The problem of a campaign about a calibrated baseline that may follow some `allowed` columns (m, k) besides."""
    columns = jacobian(readings, bench, model, BASELINE_FREE)
    if allowed is not None:
        columns = np.hstack([columns, allowed])
    points = readings.grid.points
    drag = Gearbox.calibrated(bench, model).torque(points)
    predicted = predict(readings, bench, model)
    ideal = readings.of(holding_torques(Gearbox(bench, ()), points))
    y = white((readings.torque - predicted)[:, None])[:, 0]
    return GridProblem(*freed(white(columns), y), readings, bench, model, white, predicted, ideal, columns, drag)

"""A model carried to a campaign: what it predicts unseen, and what the campaign leaves once its mechanisms are in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit, grid_problem, predict_with
from pmg.pipeline.diagnosis.grid.refit import refit
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import predict, take_readings
from pmg.pipeline.model.model_file import Model, Part, fitted_model, grid_digest, model_of
from pmg.pipeline.model.read_model import names_on
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.refit import Refit
    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Prediction:
    """Errors of three models at readings of one kind [N m], root mean square.

    Parameters
    ----------
    kind : str
        Which readings.
    count : int
        How many.
    noise : float
        Standard uncertainty of one reading.
    as_is : float
        Of the model as it came: nothing of this campaign went into it.
    recalibrated : float
        Of the plain baseline calibrated on these very readings.
    refitted : float
        Of the model with its baseline and its mechanisms fitted to these readings.
    """

    kind: str
    count: int
    noise: float
    as_is: float
    recalibrated: float
    refitted: float


@dataclass(frozen=True)
class Carried:
    """A model and a campaign.

    Parameters
    ----------
    model : Model
        As it came.
    own : bool
        Whether it was made from this very campaign: what it predicts is then not unseen.
    here : Model
        The same mechanisms, fitted to this campaign together with its baseline.
    analysis : Analysis
        Of the campaign with what the mechanisms do taken out of its readings.
    predictions : tuple of Prediction
        Kind by kind, and all.
    """

    model: Model
    own: bool
    here: Model
    analysis: Analysis
    predictions: tuple[Prediction, ...]
    bench: BenchParameters

    @property
    def gearbox(self) -> Gearbox:
        """The bench as the model has it."""
        return Gearbox(
            self.bench, (*baseline_mechanisms(self.model.baseline, self.bench), *self.model.mechanisms(self.bench))
        )

    def slopes(self, readings: Readings) -> Array:
        """Slopes of the readings against each parameter of the mechanisms [N m per unit], (m, k)."""
        base = self.here.baseline
        columns = []
        for i, part in enumerate(self.here.parts):
            for known in part.kind.parameters():
                if known.name not in part.values:
                    continue
                value, (low, high), step = part.values[known.name], known.bounds, SPAN * abs(known.typical)
                ends = [max(low, value - step), min(high, value + step)]
                found = []
                for end in ends:
                    moved = replace(part, values={**part.values, known.name: end})
                    parts = (*self.here.parts[:i], moved, *self.here.parts[i + 1 :])
                    extra = tuple(one.mechanism(self.bench, base) for one in parts)
                    found.append(predict_with(readings, self.bench, base, extra))
                columns.append((found[1] - found[0]) / (ends[1] - ends[0]))
        return np.stack(columns, axis=1) if columns else np.zeros((len(readings), 0))


SPAN = 1e-3
"""Span of the differences behind a slope, in typical values of the parameter."""


def apply_model(model: Model, analysis: Analysis, options: AnalysisOptions, bench: BenchParameters) -> Carried:
    """Carry a model to an analysed campaign.

    Parameters
    ----------
    model : Model
        Baseline and mechanisms.
    analysis : Analysis
        Of the campaign by itself, with its calibrated baseline.
    options : AnalysisOptions
        Choices of that analysis.
    bench : BenchParameters
        The bench.

    Notes
    -----
    Three predictions are set side by side. Then baseline and mechanisms are fitted to the campaign together, every
    constant free, what the mechanisms do is taken out of the readings, and what remains is analysed like a campaign
    of its own: its loss curves, its noise, its baseline.
    """
    assert analysis.calibration is not None
    assert analysis.floor is not None
    readings, calibrated = take_readings(analysis.grid, bench), analysis.calibration.model
    as_is = predict_with(readings, bench, model.baseline, model.mechanisms(bench))
    found = fit_together(model.parts, (), analysis, bench)
    here = fitted_model(found, model_of(analysis.grid, analysis.calibration, None).provenance)
    taken = found.prediction - predict(readings, bench, found.model)
    torque_sun, torque_ring = analysis.grid.torque_sun.copy(), analysis.grid.torque_ring.copy()
    torque_sun[readings.row[readings.sun]] -= taken[readings.sun]
    torque_ring[readings.row[~readings.sun]] -= taken[~readings.sun]
    remaining = analyse(replace(analysis.grid, torque_sun=torque_sun, torque_ring=torque_ring), options, bench)
    if remaining.calibration is None:
        raise remaining.missing[0]
    return Carried(
        model,
        model.provenance.get("grid_sha256") == grid_digest(analysis.grid),
        here,
        remaining,
        _predictions(readings, as_is, predict(readings, bench, calibrated), found.prediction),
        bench,
    )


def found_together(carried: Carried, analysis: Analysis, diagnosis: Diagnosis | None) -> Model:
    """The model after this campaign: its mechanisms, and those that were named in addition to them, fitted together."""
    if diagnosis is None or diagnosis.naming is None or diagnosis.refit is None:
        return carried.here
    found = fit_together(carried.here.parts, diagnosis.naming.best.fits, analysis, carried.bench)
    return fitted_model(found, {**carried.here.provenance, "verdict": str(diagnosis.verdict)})


def fit_together(
    parts: tuple[Part, ...], more: tuple[CandidateFit, ...], analysis: Analysis, bench: BenchParameters
) -> Refit:
    """Baseline and mechanisms fitted to a campaign together, from the values they have.

    Parameters
    ----------
    parts : tuple of Part
        Mechanisms with values.
    more : tuple of CandidateFit
        Mechanisms as a diagnosis fitted them.
    analysis : Analysis
        Of the campaign.
    bench : BenchParameters
        The bench.
    """
    assert analysis.calibration is not None
    assert analysis.floor is not None
    readings = take_readings(analysis.grid, bench)
    white = whitener(readings, bench, analysis.floor)
    stage = grid_problem(readings, bench, analysis.calibration.model, white)
    fits = []
    for part in parts:
        names = names_on(part.kind, part.shaft)
        sizes = tuple(name for name in names if name not in part.kind.shape)
        candidate = Candidate(part.kind, part.shaft, sizes)
        values = np.array([part.values.get(p.name, p.null) for p in candidate.parameters])
        fits.append(stage.fitted(candidate, values))
    return refit(stage, (*fits, *more))


def _predictions(readings: Readings, as_is: Array, recalibrated: Array, refitted: Array) -> tuple[Prediction, ...]:
    at = readings.configuration
    kinds = {
        "sun torque, neutral": readings.sun & (at == "neutral"),
        "ring torque, neutral": ~readings.sun & (at == "neutral"),
        "sun torque, engaged": readings.sun & (at == "engaged"),
        "zero checks": at == "zero",
        "all readings": np.ones(len(readings), dtype=bool),
    }

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(values**2)))

    return tuple(
        Prediction(
            kind,
            int(rows.sum()),
            rms(readings.u[rows]),
            *(rms((readings.torque - predicted)[rows]) for predicted in (as_is, recalibrated, refitted)),
        )
        for kind, rows in kinds.items()
        if rows.any()
    )


def lead(carried: Carried) -> str:
    """The model that the verdict is about, to stand before it."""
    return f"With the model fitted to this campaign ({carried.model.description}): "


def remark(carried: Carried) -> str:
    """Errors of the predictions, in sentences."""
    whole = carried.predictions[-1]
    about = (
        "The given model was made from this campaign, so this is no prediction"
        if carried.own
        else "The given model uses nothing of this campaign"
    )
    return (
        f"{about}. Its error is {whole.as_is * 1e3:.2f} mN m rms at {whole.count} readings. "
        f"The plain baseline, calibrated on them, has {whole.recalibrated * 1e3:.2f} mN m; "
        f"repeatability is {whole.noise * 1e3:.2f} mN m."
    )

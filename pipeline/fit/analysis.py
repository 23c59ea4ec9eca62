"""From a measured grid to loss curves, noise floor, calibration, power balance and damping constants."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.calibration import FittedBaseline, calibrate, start_model
from pmg.pipeline.fit.common_errors import CommonErrorSources, causes_of_calibration, causes_of_fits
from pmg.pipeline.fit.correction import CorrectionStudy, study_correction
from pmg.pipeline.fit.damping import THESIS_CORRECTIONS, DampingFit, fit_damping
from pmg.pipeline.fit.drift import Drift, find_drift
from pmg.pipeline.fit.loss_fit import LossFits, fit_losses, point_weights, shaft_drags
from pmg.pipeline.fit.losses import PowerBalance, largest_plausible_correction, power_balance
from pmg.pipeline.fit.noise import NoiseFloor
from pmg.pipeline.fit.noise_floor import noise_floor, structured_columns
from pmg.pipeline.fit.plane_fit import PlaneFits, plane_fits
from pmg.pipeline.fit.robust import studentised
from pmg.pipeline.fit.span import freed
from pmg.pipeline.fit.term_choice import TermChoice, choose_terms
from pmg.pipeline.fit.whitening import floor_scale, with_floor
from pmg.pipeline.grid.completeness import holes
from pmg.pipeline.grid.readings import predict, take_readings
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

FAR_OFF = 1e-5
"""p-value of a reading, all readings looked at, below which it is set aside at once: two such readings can bend a
smooth structure towards themselves, so that neither is the clearest thing that is seen."""

STANDS_OUT = "off what the others say"
"""How the reason of a point ends that stands out by itself."""

MOST_OUTLIERS = 0.04
"""Part of the points that may be set aside because they stand out by themselves; more is no accident."""


@dataclass(frozen=True)
class Analysis:
    """Results from the grids of one campaign; None where they do not reach.

    Parameters
    ----------
    grid : Grid
        All points, with the uncertainty of each once the noise floor is known.
    options : AnalysisOptions
        Choices that were made; terms that the data chose are among them.
    fits : LossFits or None
        Loss curves of the neutral points.
    floor : NoiseFloor or None
        Noise of one point.
    calibration : FittedBaseline or None
        The baseline for the simulator.
    balance : PowerBalance or None
        Losses and efficiencies at the K_corr of the calibration.
    rule_correction : float or None
        Largest K_corr at which no magnetic loss is negative.
    damping : tuple of DampingFit
        The thesis's damping fit at its four correction factors and at the calibration's.
    lacking : tuple of str
        Holes of the grids.
    missing : tuple of FitError
        Steps that could not be made, with their reason.
    choices : tuple of TermChoice
        Ranking of the terms of each shaft for which the data chose them.
    plane : PlaneFits or None
        What the other shaft does.
    drift : Drift or None
        Repeats and order.
    study : CorrectionStudy or FitError or None
        The joint fit of K_corr, b and c, or why these points do not determine them, where K_corr is held.
    causes : Causes or None
        What the points share: transducers, and what the calibration fitted.
    """

    grid: Grid
    options: AnalysisOptions
    fits: LossFits | None
    floor: NoiseFloor | None
    calibration: FittedBaseline | None
    balance: PowerBalance | None
    rule_correction: float | None
    damping: tuple[DampingFit, ...]
    lacking: tuple[str, ...]
    missing: tuple[FitError, ...]
    choices: tuple[TermChoice, ...] = ()
    plane: PlaneFits | None = None
    drift: Drift | None = None
    study: CorrectionStudy | FitError | None = None
    causes: CommonErrorSources | None = None

    @property
    def outliers(self) -> tuple[str, ...]:
        """Points that are not accepted because they stand out by themselves, as their reason says."""
        rows = [row for row, why in enumerate(self.grid.reason.tolist()) if why.endswith(STANDS_OUT)]
        return tuple(map(str, self.grid.points.name[rows]))

    @property
    def complete(self) -> bool:
        """Whether every step was made and no grid has a hole."""
        every = self.grid.accepted | np.isin(self.grid.points.name, self.outliers)
        return not self.missing and not self.lacking and bool(every.all())


def analyse(grid: Grid, options: AnalysisOptions, bench: BenchParameters) -> Analysis:
    """Analyse one campaign as far as its points reach.

    Parameters
    ----------
    grid : Grid
        Measured or published grid.
    options : AnalysisOptions
        Terms of the curves, choice of K_corr.
    bench : BenchParameters
        Ratio, shares, tolerances.

    Raises
    ------
    FitError
        The options themselves cannot be met; a lack of points is reported in `Analysis.missing` instead.
    """
    fixed = options.fixed_correction
    nothing = Analysis(grid, options, None, None, None, None, None, (), holes(grid), ())
    try:
        rough = _rough_fit(grid, options, bench)
    except FitError as error:
        return replace(nothing, missing=(error,))
    rough = _without_far_readings(rough, options, bench)
    grid, options, fits, floor = with_floor(rough.grid, rough.floor), rough.options, rough.fits, rough.floor
    if point_weights(grid) is not None:
        fits = fit_curves(grid, options, weighted=True)
    curves = replace(
        nothing,
        grid=grid,
        options=options,
        fits=fits,
        floor=floor,
        choices=rough.choices,
        plane=plane_fits(grid, fits, bench),
        drift=find_drift(grid, bench),
    )
    try:
        rule = largest_plausible_correction(grid, fits)
        correction = min(max(rule, 0.0), 1.0) if options.correction == "rule" else fixed
        calibration = calibrate(grid, fits, bench, correction=correction, method=options.damping)
    except FitError as error:
        return replace(curves, missing=(error,))
    used = calibration.model.correction
    causes = causes_of_calibration(grid, calibration, bench)
    behind = causes if causes.fitted else causes_of_fits(grid, fits, bench)
    damping, missing = list[DampingFit](), list[FitError]()
    for correction in dict.fromkeys((*THESIS_CORRECTIONS, used)):
        try:
            damping.append(fit_damping(grid, fits, correction, options.damping))
        except FitError as error:
            missing.append(error)
    return replace(
        curves,
        calibration=calibration,
        balance=power_balance(grid, fits, used, behind),
        rule_correction=rule,
        damping=tuple(damping),
        missing=tuple(missing),
        study=_study(grid, fits, bench, rule, calibration),
        causes=causes,
    )


@dataclass(frozen=True)
class _Rough:
    """Curves and noise of a grid before its points have uncertainties, with the options and rankings behind them."""

    grid: Grid
    options: AnalysisOptions
    choices: tuple[TermChoice, ...]
    fits: LossFits
    floor: NoiseFloor


def _rough_fit(grid: Grid, options: AnalysisOptions, bench: BenchParameters) -> _Rough:
    chosen, choices = chosen_terms(grid, options)
    fits = fit_curves(grid, chosen)
    return _Rough(grid, chosen, choices, fits, noise_floor(grid, fits, bench))


def _without_far_readings(rough: _Rough, options: AnalysisOptions, bench: BenchParameters) -> _Rough:
    """The fit without the points that stand out by themselves, as long as they are few.

    A single reading far from all others is a bad reading, not physics: it takes no part in any fit, and is reported.
    """
    every, outliers = rough, 0
    while (far := _far_off(rough.grid, rough.fits, rough.floor, bench)) is not None:
        row, shaft, off = far
        if outliers >= MOST_OUTLIERS * len(rough.grid):
            return every
        outliers += 1
        accepted, reasons = rough.grid.accepted.copy(), rough.grid.reason.tolist()
        accepted[row] = False
        reasons[row] = "; ".join(filter(None, (reasons[row], f"{shaft} torque {off:+.3f} N m {STANDS_OUT}")))
        try:
            rough = _rough_fit(replace(rough.grid, accepted=accepted, reason=np.array(reasons)), options, bench)
        except FitError:  # what is left is too little for the curves
            return every
    return rough


def _far_off(grid: Grid, fits: LossFits, floor: NoiseFloor, bench: BenchParameters) -> tuple[int, str, float] | None:
    """Row, shaft and distance [N m] of the reading farthest from baseline and every smooth structure, if it is far."""
    readings, model = take_readings(grid, bench), start_model(fits)
    surprise, off = _surprises(readings, bench, model, floor)
    worst = int(np.argmin(surprise))
    if surprise[worst] * len(readings) >= FAR_OFF:
        return None
    return int(readings.row[worst]), "sun" if readings.sun[worst] else "ring", float(off[worst])


def _surprises(readings: Readings, bench: BenchParameters, model: LossModel, floor: NoiseFloor) -> tuple[Array, Array]:
    """p-value of each reading (m,) by its externally studentised residual, and how far off it is [N m] (m,).

    Shaft by shaft; 1 where the structures leave a reading too little room to be judged.
    """
    scale = floor_scale(readings, bench, floor)
    y = (readings.torque - predict(readings, bench, model)) / scale
    basis, left = freed(structured_columns(readings, bench, model) / scale[:, None], y)
    room = 1.0 - np.einsum("ij,ij->i", basis, basis)
    found, off = np.ones(len(readings)), np.zeros(len(readings))
    for mine in readings.of_shaft:
        rows, surprise, dof = studentised(left, room, mine)
        found[rows] = 2.0 * stats.t.sf(np.abs(surprise), dof)
        off[rows] = (left * scale)[rows] / room[rows]
    return found, off


def chosen_terms(grid: Grid, options: AnalysisOptions) -> tuple[AnalysisOptions, tuple[TermChoice, ...]]:
    """The options with the terms that the data choose, where they are to, and the rankings behind them.

    Raises
    ------
    FitError
        A shaft whose terms are left to the data has fewer than four speeds.
    """
    choices = []
    readings = shaft_drags(grid, include_rest=options.include_rest)
    for reading, auto in zip(readings, (options.auto_sun, options.auto_ring), strict=True):
        if auto:
            choice = choose_terms(reading, robust=options.robust)
            choices.append(choice)
            if reading.shaft == "sun":
                options = replace(options, powers_sun=choice.powers)
            else:
                options = replace(options, powers_ring=choice.powers)
    return options, tuple(choices)


def fit_curves(grid: Grid, options: AnalysisOptions, *, weighted: bool = False) -> LossFits:
    """The loss curves [N m], weighted by the uncertainty of the points once it is known and where it differs.

    Raises
    ------
    FitError
        Too few points or speeds for the terms, or terms that these speeds cannot tell apart.
    """
    return fit_losses(
        grid,
        options.powers_sun,
        options.powers_ring,
        include_rest=options.include_rest,
        weights=point_weights(grid) if weighted else None,
        robust=options.robust,
    )


def _study(
    grid: Grid, fits: LossFits, bench: BenchParameters, rule: float, calibration: FittedBaseline
) -> CorrectionStudy | FitError:
    """The joint fit: the calibration itself where K_corr is free in it, else one of its own, or why there is none."""
    try:
        joint = calibration if "K_corr" in calibration.names else calibration.method
        return study_correction(grid, fits, bench, rule, joint)
    except FitError as error:
        return error

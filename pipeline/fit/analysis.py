"""From a measured grid to loss curves, noise floor, calibration, power balance and damping constants."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.fit.calibration import FittedBaseline, calibrate
from pmg.pipeline.fit.common_errors import CommonErrorSources, causes_of_calibration, causes_of_fits
from pmg.pipeline.fit.correction import CorrectionStudy, study_correction
from pmg.pipeline.fit.damping import THESIS_CORRECTIONS, DampingFit, fit_damping
from pmg.pipeline.fit.drift import Drift, find_drift
from pmg.pipeline.fit.loss_fit import LossFits, fit_losses, point_weights, shaft_drags
from pmg.pipeline.fit.losses import PowerBalance, largest_plausible_correction, power_balance
from pmg.pipeline.fit.noise import NoiseFloor
from pmg.pipeline.fit.noise_floor import noise_floor
from pmg.pipeline.fit.plane_fit import PlaneFits, plane_fits
from pmg.pipeline.fit.term_choice import TermChoice, choose_terms
from pmg.pipeline.fit.whitening import with_floor
from pmg.pipeline.grid.completeness import holes
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.fit.options import AnalysisOptions
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


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
    def complete(self) -> bool:
        """Whether every step was made and no grid has a hole."""
        return not self.missing and not self.lacking and bool(self.grid.accepted.all())


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
        options, choices = chosen_terms(grid, options)
        fits = fit_curves(grid, options)
    except FitError as error:
        return replace(nothing, missing=(error,))
    floor = noise_floor(grid, fits, bench)
    grid = with_floor(grid, floor)
    if point_weights(grid) is not None:
        fits = fit_curves(grid, options, weighted=True)
    curves = replace(
        nothing,
        grid=grid,
        options=options,
        fits=fits,
        floor=floor,
        choices=choices,
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

"""From a measured grid to loss curves, noise floor, calibration, power balance and damping constants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.calibrate import Calibration, calibrate
from pmg.pipeline.completeness import holes
from pmg.pipeline.damping import THESIS_CORRECTIONS, DampingFit, fit_damping
from pmg.pipeline.diagnose.noise import NoiseFloor, noise_floor, with_floor
from pmg.pipeline.fit import LossFits, fit_losses
from pmg.pipeline.losses import PowerBalance, largest_plausible_correction, power_balance
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from pmg.pipeline.options import AnalysisOptions
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


@dataclass(frozen=True)
class Analysis:
    """What the grids of one campaign give; None where they do not reach.

    Parameters
    ----------
    grid : Grid
        All points, with the uncertainty of each once the noise floor is known.
    options : AnalysisOptions
        Choices that were made.
    fits : LossFits or None
        Loss curves of the neutral points.
    floor : NoiseFloor or None
        Noise of one point.
    calibration : Calibration or None
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
    """

    grid: Grid
    options: AnalysisOptions
    fits: LossFits | None
    floor: NoiseFloor | None
    calibration: Calibration | None
    balance: PowerBalance | None
    rule_correction: float | None
    damping: tuple[DampingFit, ...]
    lacking: tuple[str, ...]
    missing: tuple[FitError, ...]

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
    lacking = holes(grid)
    try:
        fits = fit_losses(grid, options.powers_sun, options.powers_ring, include_rest=options.include_rest)
    except FitError as error:
        return Analysis(grid, options, None, None, None, None, None, (), lacking, (error,))
    floor = noise_floor(grid, fits, bench)
    grid = with_floor(grid, floor)
    try:
        rule = largest_plausible_correction(grid, fits)
        correction = min(max(rule, 0.0), 1.0) if options.correction == "rule" else fixed
        calibration = calibrate(grid, fits, bench, correction=correction)
    except FitError as error:
        return Analysis(grid, options, fits, floor, None, None, None, (), lacking, (error,))
    used = calibration.model.correction
    corrections = THESIS_CORRECTIONS + (() if used in THESIS_CORRECTIONS else (used,))
    return Analysis(
        grid=grid,
        options=options,
        fits=fits,
        floor=floor,
        calibration=calibration,
        balance=power_balance(grid, fits, used),
        rule_correction=rule,
        damping=tuple(fit_damping(grid, fits, k) for k in corrections),
        lacking=lacking,
        missing=(),
    )

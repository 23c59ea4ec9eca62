"""Correction factor K_corr from the points: rule, joint fit, and whether it can be distinguished from the damping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.calibration import CONSTANTS, calibrate
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.pipeline.wording.probability import CONFIDENCE

if TYPE_CHECKING:
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array


WIDEST = 0.1
"""Half axis of the interval of K_corr beyond which it counts as not determined."""

CLOSEST = 0.95
"""Magnitude of the correlation of K_corr and c beyond which they are determined only together."""


@dataclass(frozen=True)
class CorrectionStudy:
    """K_corr, b and c fitted together.

    Parameters
    ----------
    joint : FittedBaseline
        The joint fit.
    rule : float
        K_corr by the thesis's rule.
    inflation : float
        Factor on every standard error, from chi-square over degrees of freedom; not below 1.
    """

    joint: FittedBaseline
    rule: float
    inflation: float

    def standard_error(self, name: str) -> float | None:
        """Standard error of a constant, inflated; None on a bound."""
        error = self.joint.standard_error(name)
        return None if error is None else error * self.inflation

    def correlation(self, one: str, other: str) -> float | None:
        """Correlation of two constants; None where either sits on a bound."""
        u, v = self.joint.standard_error(one), self.joint.standard_error(other)
        if u is None or v is None or u == 0.0 or v == 0.0:
            return None
        i, j = self.joint.names.index(one), self.joint.names.index(other)
        return float(self.joint.covariance[i, j]) / (u * v)

    @property
    def half_axis(self) -> float | None:
        """Half the 95 % interval of K_corr; None on a bound."""
        error = self.standard_error("K_corr")
        return None if error is None else float(stats.norm.ppf(0.5 + CONFIDENCE / 2.0)) * error

    @property
    def separate(self) -> bool:
        """Whether K_corr and c are determined separately."""
        half, rho = self.half_axis, self.correlation("K_corr", "c")
        return half is not None and rho is not None and half <= WIDEST and abs(rho) <= CLOSEST

    @property
    def bounds_in_words(self) -> tuple[str, ...]:
        """Parameters on a bound, as sentences."""
        said = []
        for name in self.joint.on_bound:
            low, high = CONSTANTS[name].bounds
            side = "lower" if abs(self.joint.value(name) - low) <= abs(self.joint.value(name) - high) else "upper"
            bound = low if side == "lower" else high
            said.append(f"{name} sits on its {side} bound of {bound:g}: no error bar belongs to it.")
        return tuple(said)

    @property
    def sentence(self) -> str:
        """Whether these data determine K_corr and c separately, in one sentence."""
        half, rho = self.half_axis, self.correlation("K_corr", "c")
        if half is None or rho is None:
            bounded = " and ".join(name for name in ("K_corr", "c") if name in self.joint.on_bound)
            return f"These data do not determine K_corr and c separately: {bounded} sits on its bound in the joint fit."
        text = f"95 % interval of K_corr ± {half:.3f}, correlation with c {rho:+.3f}".replace("-", "−")
        if self.separate:
            return f"These data determine K_corr and c separately ({text})."
        return f"These data determine K_corr and c only together ({text})."

    def ellipse(self, points: int = 181) -> tuple[Array, Array] | None:
        r"""Outline of the 95 % ellipse: c [N m s/rad] and K_corr, (points,) each; None where either is on a bound.

        Notes
        -----
        :math:`(\theta - \hat\theta)^T C^{-1} (\theta - \hat\theta) = \chi^2_{2;\,0.95}`, both constants together.
        """
        u, v, rho = self.standard_error("c"), self.standard_error("K_corr"), self.correlation("K_corr", "c")
        if u is None or v is None or rho is None:
            return None
        angle = np.linspace(-np.pi, np.pi, points)
        radius = math.sqrt(float(stats.chi2.ppf(CONFIDENCE, 2)))
        first, second = radius * np.cos(angle), radius * np.sin(angle)
        across = rho * first + math.sqrt(max(1.0 - rho**2, 0.0)) * second
        return self.joint.value("c") + u * first, self.joint.value("K_corr") + v * across


def study_correction(
    grid: Grid, fits: LossFits, bench: BenchParameters, rule: float, joint: FittedBaseline | DampingMethod
) -> CorrectionStudy:
    """The joint fit of K_corr, b and c, and what it determines.

    Parameters
    ----------
    grid : Grid
        Measured grid with the uncertainty of each point.
    fits : LossFits
        Curves of the neutral points.
    bench : BenchParameters
        Ratio and shares.
    rule : float
        K_corr by the thesis's rule.
    joint : FittedBaseline or DampingMethod
        The joint fit, where it has been made already, else how it is to be made.

    Raises
    ------
    FitError
        The points do not determine the constants, or the solver did not converge.

    Notes
    -----
    Where the readings scatter about the baseline by more than their uncertainty, the standard errors are inflated by
    the root of chi-square over degrees of freedom (R. T. Birge, Physical Review 40, 1932,
    doi:10.1103/PhysRev.40.207): a baseline that does not fit determines its constants less well than the noise alone
    would have it. "Separately" asks a half axis of the interval of K_corr of 0.1 at most, and a correlation with c of
    0.95 at most in magnitude.
    """
    found = calibrate(grid, fits, bench, method=joint) if isinstance(joint, DampingMethod) else joint
    ratio = found.chi_square / found.dof if found.dof > 0 else 1.0
    return CorrectionStudy(found, rule, max(1.0, math.sqrt(ratio)))

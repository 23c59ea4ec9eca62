"""Adequacy: is what an explanation leaves still structured, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pmg.pipeline.diagnosis.engine.scan import in_parts, look_elsewhere, make_scan

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.pipeline.diagnosis.engine.problem import WhitenedProblem
    from pmg.pipeline.diagnosis.engine.scan import Scan
    from pmg.sim.signals import Array

ADEQUATE = 0.01
"""p-value of the structure left over from which on a set of candidates is adequate.

Below the level of the mismatch test, as it is looked at after a choice was made."""

ORDINARY = 0.02
"""p-value of the structure left over from which on nothing is seen in it."""

ORDINARY_NARROW = 18.0
"""Sum of squares, in noise variances, that the largest of a hundred narrow families rarely exceeds in noise alone."""

USUAL = 0.99
"""Quantile of the excess in noise alone that counts as usual."""


@dataclass(frozen=True)
class Remainder:
    """Remainder of an explanation.

    Parameters
    ----------
    p_value : float
        Of any structure in it.
    excess : float
        Sum of squares along the families of structure, beyond what noise gives, in noise variances.
    usual : float
        What noise alone exceeds one time in a hundred.
    """

    p_value: float
    excess: float
    usual: float

    @property
    def adequate(self) -> bool:
        """Whether it may be noise."""
        return self.p_value >= ADEQUATE

    @property
    def within_noise(self) -> bool:
        """Whether nothing in it is more than noise gives one time in a hundred, and no family is seen in it."""
        return self.p_value >= ORDINARY and self.excess <= self.usual


AdequacyTest: TypeAlias = "Callable[[WhitenedProblem[Any]], Remainder]"
"""Remainder of a problem, judged."""


def adequacy_test(evidence: Evidence) -> AdequacyTest:
    """Test of what problems on some evidence leave, by the same families of structure as the mismatch test.

    Notes
    -----
    The excess is the sum of squares along all families at once, less its expectation, in units of the variance of what
    follows none of them. That variance includes the columns which the estimate of the scatter excludes: over hundreds
    of directions a variance slightly too small would inflate the excess.
    """

    def remainder(problem: WhitenedProblem[Any]) -> Remainder:
        scan = make_scan(evidence, problem.baseline)
        left, null = problem.left[:, None], evidence.null
        p_value = look_elsewhere(float(scan(left)[:, 0].min()), scan(null).min(axis=0))
        usual = float(np.quantile(in_parts(lambda part: _excess(scan, part), null), USUAL))
        return Remainder(p_value, max(0.0, float(_excess(scan, left)[0])), usual)

    return remainder


def _excess(scan: Scan, white: Array) -> Array:
    """Sum of squares of whitened columns (m, draws) along the families, less its expectation, in noise variances.

    The variance is that of what follows no family; the largest of the narrow families adds what it has beyond the
    ordinary.
    """
    left = white - scan.baseline @ (scan.baseline.T @ white)
    along = scan.everything.T @ left
    rest = left - scan.everything @ along
    dof = max(len(white) - scan.everything.shape[1], 1)
    dimensions = scan.everything.shape[1] - scan.baseline.shape[1]
    variance = np.maximum(np.sum(rest**2, axis=0) / dof, 1e-12)
    largest = np.zeros(white.shape[1])
    for basis in scan.bases[len(scan.bases) - scan.evidence.narrow :]:
        largest = np.maximum(largest, np.sum((basis.T @ rest) ** 2, axis=0) / variance)
    return np.asarray(np.sum(along**2, axis=0) / variance - dimensions + np.maximum(largest - ORDINARY_NARROW, 0.0))

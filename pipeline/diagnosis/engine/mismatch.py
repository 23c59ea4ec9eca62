"""Mismatch: the clearest structure, one after the other, corrected for multiple testing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from pmg.pipeline.diagnosis.engine.scan import look_elsewhere, make_scan

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.pipeline.diagnosis.engine.scan import Scan
    from pmg.sim.signals import Array

FALSE_ALARM_RATE = 0.05
"""Rate at which evidence without any mismatch is called mismatched."""

L = TypeVar("L")


@dataclass(frozen=True)
class Mismatch(Generic[L]):
    """The outcome of the mismatch test.

    Parameters
    ----------
    p_value : float
        Of the whole procedure: everything that was looked at together.
    false_alarm_rate : float
        Level at which it was judged.
    locations : tuple
        Places, clearest first; empty without a mismatch.
    tested : int
        Kinds of structure looked at.
    draws : int
        Synthetic campaigns or records behind `p_value`.
    """

    p_value: float
    false_alarm_rate: float
    locations: tuple[L, ...]
    tested: int
    draws: int

    @property
    def found(self) -> bool:
        """Whether the mismatch is beyond the noise."""
        return self.p_value <= self.false_alarm_rate


@dataclass(frozen=True)
class Step:
    """One step of a search: what was looked at, and the clearest of it.

    Parameters
    ----------
    scan : Scan
        With everything found before in its baseline.
    nominal : (t,) array
        Natural logarithms of the nominal p-values of the tests.
    observed : (t,) array
        The same as they are compared with each other and with `smallest`.
    smallest : (draws,) array
        Least logarithm of each synthetic campaign.
    best : int
        The clearest test.
    p_value : float
        Of the clearest, the search paid for.
    """

    scan: Scan
    nominal: Array
    observed: Array
    smallest: Array
    best: int
    p_value: float

    def corrected(self, test: int) -> float:
        """Probability of one as clear as a test anywhere, by chance."""
        return look_elsewhere(float(self.observed[test]), self.smallest)


def search(
    evidence: Evidence, *, steps: int, level: float = FALSE_ALARM_RATE, elsewhere: Array | None = None
) -> Iterator[Step]:
    r"""Step by step the clearest structure, each time with the earlier ones added to the baseline.

    Parameters
    ----------
    evidence : Evidence
        Rows, and what they may follow.
    steps : int
        Most steps.
    level : float
        Level above which the search ends; the step that ends it is given too.
    elsewhere : (draws,) array, optional
        Least logarithm of each synthetic campaign in other searches that are paid for together with this one; each
        test is then taken on its own scale.

    Notes
    -----
    The smallest nominal p-value of all tests is compared with its distribution over synthetic noise that goes through
    the same steps (minimum-p), so the search is paid for. Rounding alone gives some families a small nominal p-value
    in every synthetic campaign, and the smallest of all would then be that of these. On its own scale :math:`-\ln p` is
    divided by its mean over the synthetic campaigns, 1 for a p-value that is uniform; where the mean is below 1, p is
    left as it is.

    References
    ----------
    P. H. Westfall, S. S. Young, 'Resampling-Based Multiple Testing', Wiley, 1993.
    """
    baseline = evidence.baseline
    for _ in range(steps):
        scan = make_scan(evidence, baseline)
        observed = nominal = scan(evidence.y[:, None])[:, 0]
        drawn = scan(evidence.null)
        if elsewhere is not None:
            power = 1.0 / np.maximum(-drawn.mean(axis=1), 1.0)
            observed, drawn = nominal * power, np.r_[drawn * power[:, None], elsewhere[None, :]]
        smallest = drawn.min(axis=0)
        best = int(np.argmin(observed))
        p_value = look_elsewhere(float(observed[best]), smallest)
        yield Step(scan, nominal, observed, smallest, best, p_value)
        if p_value > level or best >= len(evidence.families):
            return
        baseline = np.hstack([baseline, evidence.families[best]])

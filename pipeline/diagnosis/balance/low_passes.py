"""Another low-pass: would the search name the same with half of it, or twice?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.balance.estimate import fit_together, impossible_in
from pmg.pipeline.diagnosis.balance.library.elastic import RESONANCE
from pmg.pipeline.diagnosis.balance.records.reading import KEPT, read_recordings
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.machine.channel import PrepareTable

FACTORS = (0.5, 2.0)
"""Other low-passes that are tried, as parts of the one in force."""

MOST_THINNED = 100
"""Samples of which one may be kept."""

HIGHEST_TRIED = 0.45
"""Low-pass, over the rate of the samples, above which none is tried."""


@dataclass(frozen=True)
class LowPassTried:
    """What the search says with another low-pass; no proof was made of it.

    Parameters
    ----------
    low_pass_hz : float
        Cut-off [Hz].
    keep_every : int
        Samples of which one was kept.
    p_value : float
        Of any mismatch but a hum.
    fits : tuple of TermFit
        Terms of the leading set, the first to enter first.
    explained : bool
        Whether they leave no more than noise, or an error of form.
    sizes : tuple of Estimate
        Their parameters.
    impossible : bool
        Whether a fitted value is physically impossible, such as a negative mass.
    """

    low_pass_hz: float
    keep_every: int
    p_value: float
    fits: tuple[TermFit, ...] = ()
    explained: bool = False
    sizes: tuple[Estimate, ...] = ()
    impossible: bool = False

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the terms."""
        return frozenset(fit.identifier for fit in self.fits)

    def lets_in_a_resonance(self, low_pass_hz: float) -> bool:
        """Whether it lies above another low-pass and names what a resonance does."""
        return self.low_pass_hz > low_pass_hz and RESONANCE in self.ids

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "low_pass_Hz": self.low_pass_hz,
            "keep_every": self.keep_every,
            "p_value": self.p_value,
            "best": [fit.identifier for fit in self.fits],
            "explained": self.explained,
            "parameters": [
                {
                    "term": e.term,
                    "parameter": e.name,
                    "unit": e.unit,
                    "value": e.value,
                    "standard_error": e.standard_error,
                }
                for e in self.sizes
            ],
        }


def _others(given: PrepareTable) -> Iterator[PrepareTable]:
    """The other low-passes, thinned in proportion at least, so that the force keeps no more than the motion."""
    for factor in FACTORS:
        low_pass = factor * given.low_pass_hz
        keep = max(round(given.keep_every / factor), math.ceil(KEPT * given.rate_hz / low_pass - 0.01), 1)
        if low_pass <= HIGHEST_TRIED * given.rate_hz and keep <= MOST_THINNED:
            drop = None if given.drop is None else max(given.drop, round(given.drop / factor))
            yield given.model_copy(update={"low_pass_hz": low_pass, "keep_every": keep, "drop": drop})


def try_low_passes(case: Case, rng: np.random.Generator) -> tuple[LowPassTried, ...]:
    """Search the fitted recordings anew with half the low-pass and with twice.

    Parameters
    ----------
    case : Case
        Baseline and library.
    rng : numpy.random.Generator
        Draws synthetic records.

    Notes
    -----
    The cut-off is a choice of whoever prepares the record. Too low, it rounds off what tells terms apart; too high, it
    lets in resonances and noise that no term describes. What both neighbours name as well does not hang on it. One at
    which the recordings are too short for the filter is left out.
    """
    tried = []
    for prepare in _others(case.prepare):
        other = replace(case, prepare=prepare, withheld=())
        try:
            recorded, _ = read_recordings(other)
        except RecordingError:
            continue
        s = search_record(other, recorded, rng)
        alone = s.p_beside_hum is not None
        p_value = s.mismatch.p_value if s.p_beside_hum is None else s.p_beside_hum
        last = LowPassTried(prepare.low_pass_hz, prepare.keep_every, p_value, () if alone else s.named)
        if s.found is not None and last.fits:
            fitted = fit_together(s.recorded, s.noise.noise, s.free, s.named)
            sizes = tuple(e for e in fitted.estimates if e.term in last.ids)
            last = replace(last, explained=s.found.explained, sizes=sizes, impossible=bool(impossible_in(fitted)))
        tried.append(last)
    return tuple(tried)

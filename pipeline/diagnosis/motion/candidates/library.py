"""Candidates in motion: every mechanism whose law at an instant a run may show, on each shaft where it may act."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.motion.candidates.coupling_terms import coupling_terms, play_terms
from pmg.pipeline.diagnosis.motion.candidates.gear_terms import (
    cogging_terms,
    hysteresis_terms,
    loss_terms,
    spring_terms,
)
from pmg.pipeline.diagnosis.motion.candidates.late_terms import common_terms, delay_terms, lag_terms
from pmg.pipeline.diagnosis.motion.candidates.reading_terms import drift_terms, scale_terms, zero_terms
from pmg.pipeline.diagnosis.motion.candidates.shaft_terms import (
    bearing_terms,
    reversal_terms,
    rubbing_terms,
    turning_terms,
    wave_terms,
)
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm


@cache
def library() -> tuple[MotionTerm, ...]:
    """Every candidate, the same objects at each call: what was worked out for one serves again."""
    of_shaft = (
        bearing_terms,
        reversal_terms,
        rubbing_terms,
        wave_terms,
        turning_terms,
        coupling_terms,
        play_terms,
        scale_terms,
        lag_terms,
        delay_terms,
        zero_terms,
        drift_terms,
    )
    on_shafts = (term for side in SIDES for terms in of_shaft for term in terms(side))
    return (*on_shafts, *common_terms(), *hysteresis_terms(), *spring_terms(), *loss_terms(), *cogging_terms())

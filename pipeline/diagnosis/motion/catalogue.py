"""The catalogue in motion: candidates fitted beside the constants, and what an error of form is worth."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, cast

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.motion.free_form import bent_columns

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.motion.terms import MotionTerm
    from pmg.sim.signals import Array

WEAK, WEAK_OF_SHEET = 60.0, 25.0
"""Gains below which an effect of another kind may pass for the leading one: of any, and of a constant that is so many
times its variance off its data sheet."""

FORM_MARGIN = 0.02
"""Part of a cause's evidence by which another's may be less without being told from it: drag, damping and wander are
known to a form, and look-alikes as a gain and a crosstalk differ by as little."""


class MotionCatalogue(TermCatalogue):
    """The mechanisms that runs in motion may show."""

    tells_weak: ClassVar[bool] = True
    form_margin: ClassVar[float] = FORM_MARGIN

    def weak_below(self, leading: tuple[TermFit, ...]) -> float:
        """Gain below which an effect of another kind may pass: less where a constant is plainly off its data sheet."""
        of_sheet = all(cast("MotionTerm", fit.candidate).constants for fit in leading)
        return WEAK_OF_SHEET if of_sheet else WEAK

    def free_form(self, problem: TermProblem, fit: TermFit) -> Array:
        """Whitened columns (m, k) along which the law of a fit may bend smoothly by what it follows."""
        return bent_columns(problem, fit)

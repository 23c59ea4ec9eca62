"""The outcome of a comparison of two campaigns, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.campaign_comparison.verdict import SIGNIFICANCE
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.probability import COVERAGE_FACTOR, search_p_text
from pmg.sim import signals
from pmg.sim.signals import RESIDUAL

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.verdict import ComparisonVerdict, DifferenceTrend, GroupResult

ALIKE = 0.1
"""Two covariates whose lines take up shares of the variance no further apart than this are not separated."""

FOLLOWED = 0.25
"""Share of the variance from which a difference is said to follow a covariate."""


def statement(versus: Versus, judged: ComparisonVerdict | None) -> str:
    """The outcome: whether the campaigns differ, by how much, where most, and what the difference follows."""
    if judged is None:
        return "No point of A has a partner in B within the tolerances: nothing can be subtracted."
    p = f"p {search_p_text(judged.p_value, judged.draws)}"
    if judged.differ:
        lead = f"B differs from A by more than noise and transducer tolerances can explain ({p})."
        return " ".join(filter(None, (lead, _loss(versus), _clearest_words(judged))))
    if judged.readings_differ:
        readings = f"p {search_p_text(judged.p_readings, judged.draws)}"
        lead = (
            f"The readings differ beyond noise ({readings}), but by no more than the tolerances of the transducers "
            f"permit ({p}); the same transducers in both campaigns, or one calibrated against the other, would tell."
        )
        return " ".join(filter(None, (lead, _loss(versus), _clearest_words(judged))))
    return " ".join(filter(None, (f"No difference beyond noise ({p}).", _loss(versus))))


def _measured_text(value: float, u: float, unit: str) -> str:
    """A difference and its U, with unit."""
    return f"{numerals.measured(value, COVERAGE_FACTOR * u)} {unit}"


def _loss(versus: Versus) -> str:
    """Mean total loss and the point at which it differs most, in units of its uncertainty."""
    name = signals.LOSS_TOTAL.name
    if name not in versus.quantities or not versus.quantities[name].compared.any():
        return ""
    found = versus.quantities[name]
    mean, own, common = found.mean(np.ones(len(versus.matching), dtype=bool))
    u = float(np.hypot(own, common))
    n, beyond = int(found.compared.sum()), int(found.beyond.sum())
    if abs(mean) <= COVERAGE_FACTOR * u:
        lead = f"The mean total loss differs by {_measured_text(mean, u, 'W')} (B − A, U = 2u, {n} points)"
    else:
        more = "more" if mean > 0.0 else "less"
        lead = f"Engaged, B loses {_measured_text(abs(mean), u, 'W')} {more} than A (mean of {n} points, U = 2u)"
    if not beyond:
        return f"{lead}, at no point beyond U."
    clearest = np.where(found.beyond, np.abs(found.value) / np.where(found.u > 0.0, found.u, np.inf), -1.0)
    row = int(np.argmax(clearest))
    where = f"{versus.at.name[row]} ({_measured_text(float(found.value[row]), float(found.u[row]), 'W')})"
    return f"{lead}, beyond U at {beyond} points, most clearly at {where}."


def _clearest(judged: ComparisonVerdict) -> GroupResult:
    """The group with the clearest mean or slope; by chi-square where none is clear."""

    def distance(group: GroupResult) -> float:
        tests = [group.mean, *(one.slope for one in alike(group))]
        return max(abs(test.value) / test.u if test.u > 0.0 else 0.0 for test in tests)

    best = max(judged.groups, key=distance)
    return best if distance(best) > COVERAGE_FACTOR else min(judged.groups, key=lambda group: group.p_value)


def _clearest_words(judged: ComparisonVerdict) -> str:
    """The clearest group: its mean, and the slope that is clearer than that."""
    group = _clearest(judged)
    lead = f"Clearest in the {group.words} ({group.points} points)"
    mean = _measured_text(group.mean.value / RESIDUAL.scale, group.mean.u / RESIDUAL.scale, RESIDUAL.display_unit)
    found = alike(group)
    if not found:
        share = f"{FOLLOWED:.0%}"
        return f"{lead}: {mean} on average; no line against speed, torque or time explains {share} of its variance."
    best = found[0]
    slope = _measured_text(best.slope.value / RESIDUAL.scale, best.slope.u / RESIDUAL.scale, RESIDUAL.display_unit)
    names = " or ".join(one.covariate.words for one in found)
    unit = best.covariate.unit if best.covariate.unit[0].isdigit() else f"1 {best.covariate.unit}"
    share = f"{best.share:.0%} of its variance"
    return f"{lead}: it follows the {names}, {slope} per {unit} ({share}), and is {mean} on average."


def alike(group: GroupResult) -> tuple[DifferenceTrend, ...]:
    """Covariate that the difference of a group follows best, and those nearly as good; none where nothing is clear."""
    if not group.followed:
        return ()
    best = group.followed[0]
    if best.share < FOLLOWED or best.slope.p_value > SIGNIFICANCE:
        return ()
    return tuple(one for one in group.followed if best.share - one.share <= ALIKE)

"""A diagnosis with its records simulated by its models."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.free_run import free_run, of_fit, of_published
from pmg.pipeline.diagnosis.balance.library.term import RECORDING

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis


def with_free_runs(d: TermsDiagnosis) -> TermsDiagnosis:
    """A diagnosis with each record simulated by each model that differs from the one before.

    None of a machine between two torques. Without a recorded position, which is the integral of the speed then, the
    speed is compared.
    """
    case, steps, refinements = d.case, d.steps, d.refinements
    if case.ratio is not None:
        return d
    published = of_published(case)
    if RECORDING in d.recorded.motion.besides and any(each.term.of_angle for each in published):
        published = ()  # at an angle that nobody recorded
    models = {"published": published, "baseline": of_fit(steps[0].fitted, case)}
    if len(steps) > 1:
        models[d.last_word] = of_fit(steps[-1].fitted, case)
    if refinements:
        models["refined"] = of_fit(refinements[-1].fitted, case)
    records = [one for whole in (d.recorded, d.withheld) if whole is not None for one in whole.each()]
    of_speed = "position" not in case.channels
    runs = [free_run(name, record, terms, of_speed=of_speed) for name, terms in models.items() for record in records]
    return replace(d, free_runs=tuple(run for run in runs if run is not None))

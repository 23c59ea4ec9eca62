"""Figures of a force balance: what each model leaves, and friction against speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.errors_told import percent
from pmg.pipeline.report.document import Chart, Figure, Series

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array


def residuals_figure(d: TermsDiagnosis) -> Figure:
    """Each model's residual over time."""
    truth, time = d.recorded.force + d.recorded.known, d.recorded.time
    models = [("baseline", d.steps[0]), (f"with the {d.last_word} terms", d.steps[-1])]
    if d.refinements:
        models.append(("refined", (d.refinements or d.steps)[-1]))
    panels = []
    for i, (name, step) in enumerate(models):
        left = truth - step.fitted.predict(d.recorded)
        panels.append(
            Chart(
                "time, recordings one after the other [s]" if len(d.recorded.names) > 1 else "time [s]",
                f"residual [{d.case.axis.push}]",
                (Series("", time, left, None, "line", i),),
                title=f"Residual, {name}",
            )
        )
    first, named = d.steps[0], d.steps[-1]
    return Figure(
        "terms-residuals",
        "Residual before and after",
        f"Relative {d.case.axis.pushes} error {percent(first.error_fit)} before, {percent(named.error_fit)} after. "
        "Scales differ.",
        tuple(panels),
    )


def friction_figure(d: TermsDiagnosis) -> Figure:
    """Force less that of inertia, against speed; baseline and named terms in their mean over speed."""
    recorded, named, axis = d.recorded, d.steps[-1], d.case.axis
    speed = recorded.thin(recorded.motion.speed[:, None])[:, 0]
    acceleration = recorded.thin(recorded.motion.acceleration[:, None])[:, 0]
    inertia = next((e.value for e in named.fitted.estimates if e.term == "inertia"), d.case.fixed.get("inertia", 0.0))
    truth, pull = recorded.force + recorded.known, inertia * acceleration
    series = [Series("measured", speed, truth - pull, None, "markers", 0)]
    for colour, (name, step) in enumerate((("baseline", d.steps[0]), (f"{d.last_word} terms", named)), start=1):
        x, y = mean_over(speed, step.fitted.predict(recorded) - pull)
        series.append(Series(name, x, y, None, "line", colour))
    return Figure(
        "terms-friction",
        "Friction against speed",
        f"{axis.pushes.capitalize()} less inertia times acceleration, with {inertia:.4g} {axis.mass}: measured, and as "
        "the models give it.",
        (Chart(f"speed [{axis.speed}]", f"friction [{axis.push}]", tuple(series)),),
    )


def mean_over(x: Array, y: Array, slices: int = 60) -> tuple[Array, Array]:
    """Means of y in slices of x."""
    edges = np.linspace(float(x.min()), float(x.max()), slices + 1)
    which = np.clip(np.searchsorted(edges, x) - 1, 0, slices - 1)
    filled = np.unique(which)
    return np.array([x[which == k].mean() for k in filled]), np.array([y[which == k].mean() for k in filled])

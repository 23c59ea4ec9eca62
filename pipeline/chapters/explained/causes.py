"""The cause: the mechanisms, what else would show them, the residual before and after, the ranking."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.explained.grounds import on_bound
from pmg.pipeline.diagnosis.engine.conclusion import probabilities
from pmg.pipeline.diagnosis.grid.decide import JUDGE_DRAWS
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Measured, Series, Table
from pmg.pipeline.wording.probability import search_p_text
from pmg.sim.shafts import SIDES
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_SUN, Array

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.report.table import Cell

RANKED = 8
"""Mechanisms of the catalogue shown in the ranking."""


def cause_items(diagnosis: Diagnosis, residual: Array) -> list[Facts | Table | Figure]:
    """The cause, what else would show it, the residual before and after; none where nothing is reported."""
    if diagnosis.refit is None:
        return []
    return [_mechanisms(diagnosis), _revealed_by(diagnosis), _before_and_after(diagnosis, residual)]


def ranking_items(diagnosis: Diagnosis) -> list[Table]:
    """The catalogue as it ranks; none where nothing was searched for."""
    return [] if diagnosis.naming is None else [_ranking(diagnosis)]


def _revealed_by(diagnosis: Diagnosis) -> Facts:
    """Experiments that would show each mechanism, from its card in the catalogue."""
    assert diagnosis.naming is not None
    kinds = {fit.candidate.kind for fit in diagnosis.naming.best.fits}
    return Facts(
        tuple(
            (
                f"Shown by, {kind.title[0].lower()}{kind.title[1:]}",
                "; ".join(f"{r.experiment.replace('_', ' ')}: {r.trace}" for r in kind.revealed_by),
            )
            for kind in sorted(kinds, key=lambda kind: kind.title)
        )
    )


def _mechanisms(diagnosis: Diagnosis) -> Table:
    naming, found = diagnosis.naming, diagnosis.refit
    assert naming is not None
    assert found is not None
    rows: list[tuple[Cell, ...]] = []
    for fit, values, errors in zip(naming.best.fits, found.values, found.standard_errors, strict=True):
        other = naming.on_the_other_shaft(fit)
        for parameter, value, error in zip(fit.candidate.parameters, values, errors, strict=True):
            bound = on_bound(float(value), parameter)
            remark = "on its bound" if bound is not None else "" if np.isfinite(error) else "not determined"
            rows.append(
                (
                    fit.candidate.kind.title,
                    fit.candidate.shaft if other is not None else naming.shafts[fit.candidate.identifier],
                    parameter.meaning,
                    Measured(float(value) if bound is None else bound, float(error)),
                    "" if parameter.unit == "1" else parameter.unit,
                    remark,
                )
            )
        if other is not None:
            rows += [
                (
                    other.candidate.kind.title,
                    other.candidate.shaft,
                    parameter.meaning,
                    Measured(float(value), np.nan),
                    "" if parameter.unit == "1" else parameter.unit,
                    "instead, which reads alike",
                )
                for parameter, value in zip(other.candidate.parameters, other.values, strict=True)
            ]
    title, text = "Cause", "Baseline and mechanism fitted together, every constant free"
    if diagnosis.weak:
        title, text = "Possible cause", f"The first of a set too weak to separate. {text}"
    elif diagnosis.rivals:
        weight = probabilities(diagnosis)[0]
        title, text = "Possible cause", f"{text}; weight among the causes that fit {weight:.0%}"
    return Table(
        "mechanisms",
        title,
        f"{text}.",
        (
            Column("mechanism", "Mechanism"),
            Column("shaft", "Shaft"),
            Column("parameter", "Parameter"),
            Column("value", "Value", "", uncertain=True),
            Column("unit", "Unit"),
            Column("remark", "Remark"),
        ),
        tuple(rows),
    )


def _before_and_after(diagnosis: Diagnosis, residual: Array) -> Figure:
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    assert naming is not None
    assert found is not None
    effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
    of_shaft = readings.of_shaft
    shaft = max(SIDES, key=lambda side: float(np.sum(effect[of_shaft[side]] ** 2)))
    rows = np.flatnonzero(of_shaft[shaft] & (effect != 0.0))
    at = readings.grid.points[readings.row[rows]]
    remembers = any(fit.candidate.kind.memory for fit in naming.best.fits)
    if remembers and at.ordered:
        x, label = (at.started_at - readings.grid.points.started_at.min()) / MINUTE, "time since the first point [min]"
    elif 2.0 * float(np.sum(effect[rows][at.engaged] ** 2)) > float(np.sum(effect[rows] ** 2)):
        x, label = at.torque_ring, "ring torque [N m]"
    else:
        x, label = SPEED_SUN.display(np.abs(at.speed_sun)), SPEED_SUN.label
    after = readings.torque - found.prediction
    before_rms, after_rms = (float(np.sqrt(np.mean(part[rows] ** 2))) for part in (residual, after))
    u = readings.u[rows]
    reach = 1.05 * max(float(np.max(np.abs(part[rows]) + 2.0 * u)) for part in (residual, after)) / RESIDUAL.scale
    panels = tuple(
        Chart(
            label,
            RESIDUAL.label,
            (Series("U = 2u", x, RESIDUAL.display(part[rows]), u / RESIDUAL.scale, "markers", colour),),
            references=(("", 0.0),),
            title=title,
            y_limits=(-reach, reach),
        )
        for title, part, colour in (("baseline alone", residual, 0), ("with the cause", after, 1))
    )
    return Figure(
        "before-and-after",
        "Before and after",
        f"Residual of the {shaft} torque where the mechanism acts: {before_rms * 1e3:.2f} mN m rms with the baseline "
        f"alone, {after_rms * 1e3:.2f} mN m with the mechanism.",
        panels,
        columns=2,
    )


def _on_bounds(fit: CandidateFit) -> str:
    """Parameters of a fit on a bound, by what they mean."""
    return ", ".join(p.meaning for p in fit.candidate.parameters if p.name in fit.on_bound) or "none"


def _simpler(fit: CandidateFit, named: CandidateFit) -> bool:
    """Whether a fit is of the simple form of a mechanism that is named in its detailed one."""
    return fit.candidate.kind.refined is named.candidate.kind


def _ranking(diagnosis: Diagnosis) -> Table:
    naming = diagnosis.naming
    assert naming is not None
    stage = naming.best.problem
    shown = naming.ranking[:RANKED]
    rows: list[tuple[Cell, ...]] = [
        (fit.candidate.kind.title, fit.candidate.shaft, stage.score(fit), fit.gain, float(fit.cost), _on_bounds(fit))
        for fit in shown
    ]
    finer = [fit for fit in naming.best.fits if any(_simpler(other, fit) for other in shown)]
    return Table(
        "ranking",
        "The catalogue, best single mechanisms first",
        "Sorted by evidence: the gain, which is the fall of the sum of squares with the baseline free in noise "
        f"variances, less ln {len(stage.left)} = {math.log(len(stage.left)):.2f} for each parameter. "
        + "".join(
            f"{fit.candidate.kind.title} stands here in its simple form; above it has its detailed one, with "
            f"{fit.cost} parameters. "
            for fit in finer
        )
        + f"The leading set leaves {naming.remainder.excess:.0f} beyond the noise (p "
        f"{search_p_text(naming.remainder.p_value, JUDGE_DRAWS)}).",
        (
            Column("mechanism", "Mechanism"),
            Column("shaft", "Shaft"),
            Column("evidence", "Evidence", "", digits=1),
            Column("gain", "Gain", "", digits=1),
            Column("cost", "Parameters", "", digits=0),
            Column("on_bound", "On a bound"),
        ),
        tuple(rows),
    )

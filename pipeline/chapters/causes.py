"""What was left out: the mechanisms, their rivals, the residual before and after, and the next test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.document import probabilities
from pmg.pipeline.report.document import Chart, Column, Figure, Measured, Series, Table, Text
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_SUN, Array

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.diagnosis import Diagnosis
    from pmg.pipeline.report.table import Cell

RANKED = 8
"""Mechanisms of the catalogue shown in the ranking."""


def cause_items(diagnosis: Diagnosis, residual: Array) -> list[Text | Table | Figure]:
    """Tables and figure on the cause; none where nothing was searched for."""
    if diagnosis.naming is None:
        return []
    items: list[Text | Table | Figure] = []
    if diagnosis.refit is not None:
        items += [_mechanisms(diagnosis), _before_and_after(diagnosis, residual)]
    if diagnosis.rivals:
        items.append(_rivals(diagnosis))
    items.append(_ranking(diagnosis))
    return items


def _mechanisms(diagnosis: Diagnosis) -> Table:
    naming, found = diagnosis.naming, diagnosis.refit
    assert naming is not None
    assert found is not None
    rows: list[tuple[Cell, ...]] = []
    for fit, values, errors in zip(naming.best.fits, found.values, found.standard_errors, strict=True):
        for parameter, value, error in zip(fit.candidate.parameters, values, errors, strict=True):
            rows.append(
                (
                    fit.candidate.kind.title,
                    naming.shafts[fit.candidate.identifier],
                    parameter.meaning,
                    Measured(float(value), float(error)),
                    parameter.unit,
                )
            )
    weight = probabilities(diagnosis)[0]
    return Table(
        "mechanisms",
        "What was left out",
        f"Baseline and mechanism fitted together, every constant free; weight among what cannot be told apart "
        f"{weight:.0%}. A parameter without uncertainty sits on its bound or is not determined.",
        (
            Column("mechanism", "Mechanism"),
            Column("shaft", "Shaft"),
            Column("parameter", "Parameter"),
            Column("value", "Value", "", uncertain=True),
            Column("unit", "Unit"),
        ),
        tuple(rows),
    )


def _before_and_after(diagnosis: Diagnosis, residual: Array) -> Figure:
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    assert naming is not None
    assert found is not None
    effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
    sun = float(np.sum(effect[readings.sun] ** 2)) >= float(np.sum(effect[~readings.sun] ** 2))
    rows = np.flatnonzero((readings.sun == sun) & (effect != 0.0))
    at = readings.grid.points[readings.row[rows]]
    remembers = any(fit.candidate.kind.memory for fit in naming.best.fits)
    if remembers and at.ordered:
        x, label = (at.started_at - readings.grid.points.started_at.min()) / MINUTE, "time since the first point [min]"
    elif bool(at.engaged.any()):
        x, label = at.torque_ring, "ring torque [N m]"
    else:
        x, label = SPEED_SUN.display(np.abs(at.speed_sun)), SPEED_SUN.label
    after = readings.torque - found.prediction
    before_rms, after_rms = (float(np.sqrt(np.mean(part[rows] ** 2))) for part in (residual, after))
    panels = tuple(
        Chart(
            label,
            RESIDUAL.label,
            (Series("U = 2u", x, RESIDUAL.display(part[rows]), readings.u[rows] / RESIDUAL.scale, "markers", colour),),
            references=(("", 0.0),),
            title=title,
        )
        for title, part, colour in (("baseline alone", residual, 0), ("with what was left out", after, 1))
    )
    shaft = "sun" if sun else "ring"
    return Figure(
        "before-and-after",
        "Before and after",
        f"Residual of the {shaft} torque where the mechanism acts: {before_rms * 1e3:.2f} mN m rms with the baseline "
        f"alone, {after_rms * 1e3:.2f} mN m with it in.",
        panels,
        columns=2,
    )


def _rivals(diagnosis: Diagnosis) -> Table:
    assert diagnosis.naming is not None
    rows: list[tuple[Cell, ...]] = []
    for rival in diagnosis.rivals:
        names = " + ".join(f"{fit.candidate.kind.title} ({fit.candidate.shaft})" for fit in rival.explanation.fits)
        test = rival.test
        rows.append(
            (
                names,
                diagnosis.naming.best.score - rival.explanation.score,
                "none known" if test is None else test.plan.description,
                None if test is None else test.plan.seconds / MINUTE,
                None if test is None else 100.0 * test.power,
            )
        )
    return Table(
        "rivals",
        "What these recordings cannot tell from it",
        "Evidence in noise variances; the test that would tell, its bench time, and the probability that it does.",
        (
            Column("rival", "Rival"),
            Column("behind", "Behind by", "", digits=1),
            Column("test", "Separating test"),
            Column("minutes", "Bench time", "min", digits=0),
            Column("power", "Power", "%", digits=0),
        ),
        tuple(rows),
    )


def _ranking(diagnosis: Diagnosis) -> Table:
    assert diagnosis.naming is not None
    rows: list[tuple[Cell, ...]] = [
        (fit.candidate.kind.title, fit.candidate.shaft, fit.gain, float(fit.cost), ", ".join(fit.on_bound) or "none")
        for fit in diagnosis.naming.ranking[:RANKED]
    ]
    remainder = diagnosis.naming.remainder
    return Table(
        "ranking",
        "The catalogue, best single mechanisms first",
        f"Fall of the sum of squares with the baseline free, in noise variances. The leading set leaves "
        f"{remainder.excess:.0f} beyond the noise (p = {remainder.p_value:.2g}).",
        (
            Column("mechanism", "Mechanism"),
            Column("shaft", "Shaft"),
            Column("gain", "Gain", "", digits=1),
            Column("cost", "Parameters", "", digits=0),
            Column("on_bound", "On a bound"),
        ),
        tuple(rows),
    )

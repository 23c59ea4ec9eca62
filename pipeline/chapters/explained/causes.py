"""The cause: the mechanisms, what else would show them, the ranking."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.explained.grounds import on_bound
from pmg.pipeline.diagnosis.engine.conclusion import probabilities
from pmg.pipeline.diagnosis.grid.decide import JUDGE_DRAWS
from pmg.pipeline.diagnosis.grid.rivals import why_weak
from pmg.pipeline.report.document import Column, Facts, Measured, Table
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.pipeline.wording.probability import search_p_text

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.report.table import Cell

RANKED = 8
"""Mechanisms of the catalogue shown in the ranking."""


def cause_items(diagnosis: Diagnosis) -> list[Facts | Table]:
    """The cause, and what else would show it; none where nothing is reported."""
    if diagnosis.refit is None:
        return []
    return [_mechanisms(diagnosis), _revealed_by(diagnosis)]


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
                f"Shown by, {uncapitalised(kind.title)}",
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
        title, text = "Possible cause", f"The first of those possible. {why_weak(diagnosis)[1]}. {text}"
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

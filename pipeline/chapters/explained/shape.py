"""A short form of what no mechanism explains: formula, constants, the proof on withheld readings, and how it lies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.report.document import Chart, Column, Facts, Figure, Measured, Series, Table, Text
from pmg.pipeline.wording.numerals import number
from pmg.sim.signals import MINUTE, RESIDUAL, RPM

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.form.atoms import FormCovariate
    from pmg.pipeline.diagnosis.form.shape import Shape
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.sim.signals import Array

NOT_FOUND = "No short formula for the clearest place predicts data not used for the fit."
DISPLAYED = {"rad/s": ("rpm", RPM), "s": ("min", MINUTE)}
"""Units in which a covariate is drawn, with the SI value of one."""


def shape_items(diagnosis: Diagnosis) -> list[Text | Facts | Table | Figure]:
    """Facts, constants and figure of the short form; a sentence where none holds up; else nothing."""
    if diagnosis.verdict is not Verdict.NOT_IN_LIBRARY:
        return []
    if diagnosis.shape is None:
        return [Text(NOT_FOUND, kind="note")]
    shape = diagnosis.shape
    items: list[Text | Facts | Table | Figure] = [_facts(shape), _constants(shape)]
    if shape.covariates:
        items.append(_figure(diagnosis, shape))
    return items


def _facts(shape: Shape) -> Facts:
    proof, (low, high) = shape.held_out, shape.held_out.gain_interval
    assert proof.placebo_gain is not None  # the proof of a form has one
    smooth = "no family follows it" if np.isnan(shape.rmse_smooth) else f"{shape.rmse_smooth * 1e3:.2f} mN m"
    where = f"{shape.signal.replace('_', ' ')}, {shape.configuration} points"
    kind = "a drag" if shape.as_drag else "a torque of the same sign in both directions"
    rows: list[tuple[str, str]] = [
        ("Short form", f"{shape.text} [N m]: {shape.label}"),
        ("Where", f"{where}, as {kind}"),
        *((f"{c.symbol} [{c.unit}]", c.meaning) for c in shape.covariates),
        ("Withheld error of the baseline", f"{proof.rmse_before * 1e3:.2f} mN m"),
        (
            "Withheld error with the form",
            f"{proof.rmse_after * 1e3:.2f} mN m, chosen and fitted without these readings",
        ),
        ("Withheld error with smooth columns", smooth),
        ("Noise of the same readings", f"{proof.noise_floor * 1e3:.2f} mN m"),
        ("Gain, 95 % interval", f"{low * 1e3:.2f} to {high * 1e3:.2f} mN m"),
        (
            "Gain of the placebo",
            f"{number(proof.placebo_gain * 1e3, 2)} mN m, covariates of whole blocks exchanged",
        ),
        ("The same form chosen", f"in {shape.alike} of {shape.folds} parts"),
    ]
    return Facts(tuple(rows))


def _constants(shape: Shape) -> Table:
    return Table(
        "shape-constants",
        "Constants of the formula",
        "Fitted with the baseline, its constants free. They describe the readings, not their cause.",
        (Column("name", "Constant"), Column("value", "Value", "", uncertain=True), Column("unit", "Unit")),
        tuple(
            (c.name, Measured(c.value, np.nan if c.standard_error is None else c.standard_error), c.unit)
            for c in shape.constants
        ),
    )


def _axis(covariate: FormCovariate) -> tuple[Array, str]:
    unit, scale = DISPLAYED.get(covariate.unit, (covariate.unit, 1.0))
    return covariate.values / scale, f"{covariate.meaning} [{unit}]"


def _figure(diagnosis: Diagnosis, shape: Shape) -> Figure:
    """Residual at the location against the first covariate, with the formula; against the second where it has two."""
    readings = diagnosis.mismatch.readings
    u = readings.u[shape.rows] / RESIDUAL.scale
    panels = []
    for covariate in shape.covariates:
        x, label = _axis(covariate)
        order = np.argsort(x, kind="stable")
        alone = len(shape.covariates) == 1
        panels.append(
            Chart(
                label,
                "residual of the baseline [mN m]",
                (
                    Series(
                        "readings, U = 2u", x[order], RESIDUAL.display(shape.located)[order], u[order], "markers", 0
                    ),
                    Series(
                        "formula",
                        x[order],
                        RESIDUAL.display(shape.fitted)[order],
                        None,
                        "line" if alone else "markers",
                        1,
                    ),
                ),
                references=(("", 0.0),),
            )
        )
    return Figure(
        "short-form",
        "The formula",
        f"What the baseline leaves of the {shape.signal.replace('_', ' ')} in {shape.configuration} points when both "
        f"are fitted together, and {shape.text}: {shape.held_out.rmse_before * 1e3:.2f} mN m before, "
        f"{shape.held_out.rmse_after * 1e3:.2f} mN m with it, on data not used for the fit.",
        tuple(panels),
        columns=len(panels),
    )

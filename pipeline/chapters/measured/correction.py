"""The correction factor: swept, fitted together with the damping, and whether the two can be separated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.correction import CorrectionStudy
from pmg.pipeline.report.document import Chart, Column, Figure, Measured, Series, Table, Text
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.pipeline.wording.plurals import counted

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.damping import DampingFit
    from pmg.pipeline.report.table import Cell

SCALE = {"K_corr": 1.0, "b": 1e3, "c": 1e4}
"""From SI to what the tables of this chapter show: b in mN m, c in 1e-4 N m s/rad."""


def correction_items(analysis: Analysis) -> tuple[Table | Figure | Text, ...]:
    """Sweep of the correction factor; joint fit, its ellipse, and the sentence what these data determine."""
    items: list[Table | Figure | Text] = [_sweep(analysis.damping, analysis.rule_correction)]
    study = analysis.study
    if study is None:
        return tuple(items)
    if not isinstance(study, CorrectionStudy):
        return (*items, Text(f"K_corr, b and c could not be fitted together. {study}", kind="warning"))
    items += [_joint(study), Text(" ".join((study.sentence, *study.bounds_in_words)), kind="finding")]
    figure = _ellipse(study)
    return (*items, figure) if figure is not None else tuple(items)


def _sweep(fits: tuple[DampingFit, ...], rule: float | None) -> Table:
    def cell(value: float, error: float | None, factor: float) -> Measured | str:
        return "0 (on its bound)" if error is None else Measured(value * factor, error * factor)

    bisquare = any(fit.method is DampingMethod.BISQUARE for fit in fits)
    manner = "Bisquare-weighted least squares" if bisquare else "Least squares"
    text = "" if rule is None else f" By the thesis's rule, the largest without a negative loss, it is {rule:.3f}."
    return Table(
        "damping",
        "Damping constants against the correction factor",
        f"{manner} of the magnetic loss power at a given K_corr, mean over the loads, against speed; constants not "
        "below zero (thesis, equation 6.1). Degrees of freedom: speeds less the constants that are off their bound."
        + text,
        (
            Column("k_corr", "K_corr", "", digits=3),
            Column("smallest", "smallest magnetic loss", "W", digits=3),
            Column("negative", "negative losses"),
            Column("b", "b", "mN m"),
            Column("c", "c", "1e-4 N m s/rad"),
            Column("d", "d", "1e-3 N m (s/rad)^1/2"),
            Column("r_squared", "R²", "", digits=4),
            Column("rmse", "RMSE", "W", digits=4),
            Column("dof", "Degrees of freedom"),
            Column("left_out", "Speeds left out"),
        ),
        tuple(
            (
                fit.correction,
                fit.smallest,
                fit.negative,
                cell(fit.b, fit.standard_errors[0], 1e3),
                cell(fit.c, fit.standard_errors[1], 1e4),
                cell(fit.d, fit.standard_errors[2], 1e3),
                fit.r_squared,
                fit.rmse,
                fit.dof,
                int((fit.weights <= 0.0).sum()),
            )
            for fit in fits
        ),
    )


def _manner(study: CorrectionStudy) -> str:
    if study.joint.method is DampingMethod.LEAST_SQUARES:
        return "Least squares"
    return f"Bisquare-weighted least squares ({counted(study.joint.left_out, 'reading')} of weight 0)"


def _by_scale(study: CorrectionStudy) -> str:
    """What stands for the sum of squares of a robust fit, in words."""
    return "" if study.joint.method is DampingMethod.LEAST_SQUARES else "by the robust scale "


def _joint(study: CorrectionStudy) -> Table:
    def value(name: str) -> Cell:
        error, factor = study.standard_error(name), SCALE[name]
        best = study.joint.value(name) * factor
        return f"{best:.4g} (on its bound)" if error is None else Measured(best, error * factor)

    def correlation(name: str) -> Cell:
        rho = None if name == "K_corr" else study.correlation("K_corr", name)
        return None if rho is None else rho

    inflated = (
        f" Errors are {study.inflation:.2f} times those of the noise alone, as the baseline does not fit within it."
        if study.inflation > 1.0
        else ""
    )
    return Table(
        "correction-joint",
        "K_corr, b and c fitted together",
        f"{_manner(study)} of neutral and engaged readings at once, curves free, weighted by the uncertainty of the "
        f"points, chi-square {_by_scale(study)}{study.joint.chi_square:.0f} for {study.joint.dof} degrees of "
        f"freedom.{inflated} The transducers' tolerances are not in them; they are in those of the constants above, "
        "which are not scaled.",
        (
            Column("constant", "Constant"),
            Column("unit", "Unit"),
            Column("value", "Value", "", uncertain=True),
            Column("correlation", "Correlation with K_corr", "", digits=3),
        ),
        tuple(
            (name, unit, value(name), correlation(name))
            for name, unit in (("K_corr", ""), ("b", "mN m"), ("c", "1e-4 N m s/rad"))
        ),
    )


def _ellipse(study: CorrectionStudy) -> Figure | None:
    outline = study.ellipse()
    if outline is None:
        return None
    c, k = outline
    best = np.array([study.joint.value("c") * SCALE["c"]]), np.array([study.joint.value("K_corr")])
    return Figure(
        "correction-ellipse",
        "K_corr against c",
        f"{study.sentence} The ellipse holds both constants with 95 % probability; the level line is "
        "the thesis's rule.",
        (
            Chart(
                "c [1e-4 N m s/rad]",
                "K_corr",
                (
                    Series("95 % ellipse", c * SCALE["c"], k, None, "line", 0),
                    Series("joint fit", *best, None, "markers", 1),
                ),
                references=(("rule", study.rule),),
            ),
        ),
    )

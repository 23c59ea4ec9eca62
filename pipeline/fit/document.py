"""The loss fits as JSON: curves, ranking of terms, the other shaft, repeats and order, correction factor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.fit.correction import CorrectionStudy
from pmg.pipeline.wording.probability import CONFIDENCE

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.damping import DampingFit
    from pmg.pipeline.fit.drift import Drift
    from pmg.pipeline.fit.loss_fit import LossFit
    from pmg.pipeline.fit.plane_fit import PlaneFit
    from pmg.pipeline.fit.term_choice import TermChoice

RANKED = 10
"""Candidates of a ranking that are written."""


def number(value: float | None) -> float | None:
    """A JSON number, or null for what is not known."""
    return None if value is None or not math.isfinite(value) else float(value)


def fit_document(fit: LossFit) -> dict[str, Any]:
    """One loss curve."""
    return {
        "powers": list(fit.curve.powers),
        "coefficients_Nm": [float(v) for v in fit.curve.coefficients],
        "standard_errors_Nm": [number(float(v)) for v in fit.standard_errors],
        "speed_reference_rad_s": fit.curve.speed_reference,
        "points": len(fit.residuals),
        "r_squared": number(fit.r_squared),
        "rmse_Nm": fit.rmse,
        "error_thesis_Nm": fit.error_thesis,
        "aicc": number(fit.aicc),
        "weighted": fit.weighted,
        "robust": fit.robust,
        "down_weighted": fit.down_weighted,
    }


def damping_document(fit: DampingFit) -> dict[str, Any]:
    """The damping constants at one correction factor."""
    return {
        "K_corr": fit.correction,
        "method": str(fit.method),
        "smallest_magnetic_loss_W": fit.smallest,
        "negative_magnetic_losses": fit.negative,
        "b_Nm": fit.b,
        "c_Nm_s_rad": fit.c,
        "d": fit.d,
        "standard_errors": list(fit.standard_errors),
        "on_bound": list(fit.on_bound),
        "degrees_of_freedom": fit.dof,
        "speeds_left_out": int((fit.weights <= 0.0).sum()),
        "r_squared": number(fit.r_squared),
        "rmse_W": fit.rmse,
    }


def _choice_document(choice: TermChoice) -> dict[str, Any]:
    return {
        "chosen": list(choice.powers),
        "candidates": len(choice.ranking),
        "withheld_speeds": choice.levels,
        "ranking": [
            {
                "powers": list(rank.powers),
                "aicc": number(rank.aicc),
                "weight": rank.weight,
                "withheld_rmse_Nm": rank.cv_rmse,
                "withheld_rmse_standard_error_Nm": rank.cv_se,
                "within_one_standard_error": rank.eligible,
            }
            for rank in choice.ranking[:RANKED]
        ],
    }


def _plane_document(fit: PlaneFit) -> dict[str, Any]:
    return {
        "rmse_own_speed_Nm": fit.rmse_line,
        "rmse_both_speeds_Nm": number(fit.rmse_plane),
        "F": number(fit.f),
        "p": number(fit.p),
        "added_terms": fit.added,
        "degrees_of_freedom": fit.dof,
        "terms": [
            {
                "name": term.name,
                "form": term.form,
                "tested": term.tested,
                "same_as": term.alike or None,
                "size_Nm": number(term.size),
                "standard_error_Nm": number(term.size_u),
                "rms_beyond_curve_Nm": number(term.share),
                "F": number(term.f),
                "p": number(term.p),
                "p_holm": number(term.p_holm),
                "found": term.found,
            }
            for term in fit.terms
        ],
    }


def _drift_document(drift: Drift) -> dict[str, Any]:
    return {
        "nothing_to_compare": drift.reason or None,
        "rising_against_falling": {
            order.shaft: {
                "points": len(order.difference),
                "mean_Nm": order.mean,
                "mean_standard_error_Nm": order.mean_u,
                "mean_p": number(order.mean_p),
                "slope_Nm_s_rad": number(order.slope),
                "slope_standard_error_Nm_s_rad": number(order.slope_u),
                "slope_p": number(order.slope_p),
                "hours_between": order.hours,
            }
            for order in drift.orders
        },
        "repeats": {
            repeat.shaft: {
                "slope_Nm_s": repeat.slope,
                "slope_standard_error_Nm_s": repeat.slope_u,
                "p": number(repeat.p),
                "degrees_of_freedom": repeat.dof,
                "scatter_Nm": repeat.scatter,
                "hours": repeat.hours,
            }
            for repeat in drift.repeats
        },
    }


def _study_document(study: CorrectionStudy) -> dict[str, Any]:
    return {
        "rule": number(study.rule),
        "values": {name: study.joint.value(name) for name in ("K_corr", "b", "c")},
        "standard_errors": {name: number(study.standard_error(name)) for name in ("K_corr", "b", "c")},
        "standard_errors_inflated_by": study.inflation,
        "on_bound": list(study.joint.on_bound),
        "correlation_K_corr_c": number(study.correlation("K_corr", "c")),
        "correlation_K_corr_b": number(study.correlation("K_corr", "b")),
        "coverage": CONFIDENCE,
        "half_axis_K_corr": number(study.half_axis),
        "separate": study.separate,
        "told": " ".join((study.sentence, *study.bounds_in_words)),
    }


def further_document(analysis: Analysis) -> dict[str, Any]:
    """Results beyond the curves themselves; null where a step was not made."""
    study = analysis.study
    return {
        "terms": {choice.shaft: _choice_document(choice) for choice in analysis.choices},
        "other_shaft": None
        if analysis.plane is None
        else {"sun": _plane_document(analysis.plane.sun), "ring": _plane_document(analysis.plane.ring)},
        "repeats_and_order": None if analysis.drift is None else _drift_document(analysis.drift),
        "correction": _study_document(study)
        if isinstance(study, CorrectionStudy)
        else None
        if study is None
        else {"told": str(study)},
    }

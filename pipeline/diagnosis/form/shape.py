"""The short form that describes what no mechanism explains, and its proof; and both as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.wording import numerals
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.form.atoms import FormCovariate
    from pmg.sim.signals import Array

LABEL = "shape, not physics"

_SHOWN = {"N m": (1e3, "mN m"), "rad/s": (1.0 / RPM, "rpm")}
"""Factor and unit in which constants are shown."""


@dataclass(frozen=True)
class Constant:
    """A constant of a form.

    Parameters
    ----------
    name : str
        In the formula.
    value : float
        SI.
    standard_error : float or None
        None where the readings do not determine it.
    unit : str
        SI unit.
    """

    name: str
    value: float
    standard_error: float | None
    unit: str


@dataclass(frozen=True)
class Shape:
    """A short form that holds up on readings it has not seen.

    Parameters
    ----------
    signal, configuration : str
        Of the location.
    text : str
        The form as a drag on that shaft [N m], for people, its constants by name.
    formula : str
        The same in the syntax of sympy, its constants as numbers.
    covariates : tuple of Covariate
        What it follows.
    constants : tuple of Constant
        Linear ones first.
    as_drag : bool
        Whether it turns its sign with the direction of rotation.
    held_out : HeldOut
        Errors on withheld readings of the baseline, and with a form chosen and fitted without them. The gain of the
        placebo is that, beyond a constant's, of a search with the covariates of whole blocks exchanged before it: what
        the search gains from nothing, at or below zero up to noise.
    rmse_smooth : float
        The same error with the smooth columns of the location's family [N m]; NaN where it has none.
    alike : int
        Folds in which the same form was chosen without the withheld readings.
    folds : int
        Folds in all.
    rows : (n,) array of int
        Readings of the location.
    located : (n,) array
        What is left there when the baseline joins the fit, as the form counts it [N m].
    fitted : (n,) array
        What the form gives there [N m].
    label : str
        What it is.
    """

    signal: str
    configuration: str
    text: str
    formula: str
    covariates: tuple[FormCovariate, ...]
    constants: tuple[Constant, ...]
    as_drag: bool
    held_out: HeldOut
    rmse_smooth: float
    alike: int
    folds: int
    rows: npt.NDArray[np.int64]
    located: Array
    fitted: Array
    label: str = LABEL


def constants_in_words(shape: Shape) -> str:
    """Constants of a form with their standard uncertainty, torques in mN m and speeds in rpm, one after the other."""
    words = []
    for each in shape.constants:
        factor, unit = _SHOWN.get(each.unit, (1.0, each.unit))
        value = factor * each.value
        known = each.standard_error is not None and math.isfinite(each.standard_error)
        number = numerals.measured(value, factor * float(each.standard_error or 0.0)) if known else f"{value:.3g}"
        words.append(f"{each.name} = {number}{f' {unit}' if unit != '1' else ''}")
    return ", ".join(words)


def shape_document(shape: Shape) -> dict[str, Any]:
    """The shape as JSON: formula, constants, errors on withheld readings."""
    proof = shape.held_out
    return {
        "label": shape.label,
        "signal": shape.signal,
        "configuration": shape.configuration,
        "text": shape.text,
        "formula": shape.formula,
        "as_drag": shape.as_drag,
        "covariates": [
            {"name": c.name, "symbol": c.symbol, "unit": c.unit, "meaning": c.meaning} for c in shape.covariates
        ],
        "constants": [
            {"name": c.name, "value": c.value, "standard_error": c.standard_error, "unit": c.unit}
            for c in shape.constants
        ],
        "rmse_before_Nm": proof.rmse_before,
        "rmse_after_Nm": proof.rmse_after,
        "rmse_smooth_Nm": None if math.isnan(shape.rmse_smooth) else shape.rmse_smooth,
        "noise_floor_Nm": proof.noise_floor,
        "gain_interval_Nm": list(proof.gain_interval),
        "placebo_gain_Nm": proof.placebo_gain,
        "alike": shape.alike,
        "folds": shape.folds,
    }

"""Numbers that are written without an uncertainty of their own, each with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Iterator

NOT_STATED = "no uncertainty stated"

_BOUND = "held, or on its bound"

_CARRIED = frozenset({"coefficients_Nm", "b_Nm", "c_Nm_s_rad", "size_Nm", "mean_Nm", "slope_Nm_s_rad", "slope_Nm_s"})
"""Names of numbers next to which their uncertainty stands."""

_REASONS: dict[str, frozenset[str]] = {
    "a choice": frozenset(
        {
            "powers_sun",
            "powers_ring",
            "powers",
            "chosen",
            "speed_reference_rad_s",
            "coverage",
            "coverage_factor",
            "K_corr",
            "divisor",
            "limits",
        }
    ),
    "a count": frozenset(
        {
            "all",
            "accepted",
            "neutral",
            "engaged",
            "zero",
            "points",
            "down_weighted",
            "repeats_dof",
            "degrees_of_freedom",
            "negative_magnetic_losses",
            "added_terms",
            "candidates",
            "withheld_speeds",
            "from_memory",
            "effective_degrees_of_freedom",
        }
    ),
    "an elapsed time": frozenset({"hours", "hours_between"}),
    "a probability": frozenset({"p", "p_holm", "mean_p", "slope_p"}),
    "a statistic of a fit": frozenset(
        {
            "r_squared",
            "rmse_Nm",
            "rmse_W",
            "error_thesis_Nm",
            "aicc",
            "chi_square",
            "F",
            "weight",
            "withheld_rmse_Nm",
            "rmse_own_speed_Nm",
            "rmse_both_speeds_Nm",
            "rms_beyond_curve_Nm",
            "standard_errors_inflated_by",
            "correlation_K_corr_c",
            "correlation_K_corr_b",
        }
    ),
    "itself an uncertainty": frozenset(
        {
            "u_Nm",
            "within_Nm",
            "repeats_Nm",
            "unstructured_Nm",
            "at_rest_Nm",
            "at_highest_speed_Nm",
            "scatter_Nm",
            "correlation",
            "half_axis_K_corr",
        }
    ),
}

_CSV_REASONS = {
    "speed_sun_rpm": "mean of the encoder, taken as exact",
    "speed_ring_rpm": "mean of the encoder, taken as exact",
    "load_set_Nm": "asked for",
    "gear": "a choice",
    "points": "a count",
    "started_at_s": "a time",
}


def _is_uncertainty(name: str) -> bool:
    return "standard_error" in name or name.startswith(("u_", "within_", "common_", "rmse_u"))


def _numbers(value: object, path: tuple[str, ...], within: dict[str, Any]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every number with its path and the object it stands in."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _numbers(part, (*path, name), value)
    elif isinstance(value, list):
        for part in value:
            yield from _numbers(part, (*path, "[]"), within)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, within


def unstated_in(document: dict[str, Any]) -> list[dict[str, str]]:
    """Numbers of a JSON document without an uncertainty: where, and why.

    Parameters
    ----------
    document : dict
        As it is written; items of one list share an entry, ``[]``.
    """
    found: dict[str, str] = {}
    for path, within in _numbers(document, (), document):
        names = [part for part in path if part != "[]"]
        reason = _reason(names, within)
        if reason:
            found.setdefault(".".join(path), reason)
    return [{"what": what, "reason": reason} for what, reason in found.items()]


def _reason(names: list[str], within: dict[str, Any]) -> str:
    name = names[-1]
    if any(_is_uncertainty(part) and part != "standard_errors_inflated_by" for part in names) and name not in (
        "u_Nm",
        "within_Nm",
    ):
        return ""
    if name == "value" and "standard_error" in within:
        return _BOUND if within["standard_error"] is None else ""
    if len(names) > 1 and names[-2] == "values":
        return ""  # their errors stand under standard_errors, null on a bound
    if name == "d" and "standard_errors" in within:
        return _BOUND if within["standard_errors"][2] is None else ""
    if name in _CARRIED or f"u_{name}" in within:
        return ""
    return next((reason for reason, members in _REASONS.items() if not members.isdisjoint(names[-2:])), NOT_STATED)


def unstated_columns(frame: pd.DataFrame) -> list[dict[str, str]]:
    """Numeric columns of a table next to which no column ``u_...`` stands, and why."""
    found = []
    for name in map(str, frame.columns):
        numeric = pd.api.types.is_numeric_dtype(frame[name]) and not pd.api.types.is_bool_dtype(frame[name])
        uncertainties = {f"u_{name}", name.replace("torque_", "u_")} - {name}
        if numeric and not _is_uncertainty(name) and not uncertainties & set(frame.columns):
            found.append({"what": name, "reason": _CSV_REASONS.get(name, NOT_STATED)})
    return found

"""Choices of an analysis as a user types them: powers of speed, correction factor, weights of the damping fit."""

from __future__ import annotations

import math
from enum import StrEnum

from pmg.sim.errors import FitError, near_miss

AUTO = "auto"
"""Word for terms that are chosen by the data."""

CORRECTIONS = ("joint", "rule")
"""Words for how K_corr is found; a number holds it."""


class DampingMethod(StrEnum):
    """How a damping fit weighs its readings.

    ``LEAST_SQUARES``: all alike, or by their uncertainty. ``BISQUARE``: those far from the fit less, or not at all.
    """

    LEAST_SQUARES = "least-squares"
    BISQUARE = "bisquare"


def check_powers(powers: tuple[float, ...]) -> tuple[float, ...]:
    """The exponents in rising order.

    Raises
    ------
    FitError
        They cannot be terms of a curve.
    """
    if not powers or len(set(powers)) < len(powers) or min(powers) < 0.0 or not all(map(math.isfinite, powers)):
        raise FitError(
            "loss fit terms",
            ", ".join(f"{p:g}" for p in powers) or "none",
            "distinct exponents of the speed, none below 0, such as 0,0.5,1,2",
            "Choose the terms anew.",
        )
    return tuple(sorted(powers))


def parse_powers(text: str, option: str) -> tuple[float, ...]:
    """Exponents from ``0,0.5,1,2``; fractions such as ``1/2`` are understood.

    Raises
    ------
    FitError
        One of them is no number.
    """
    powers = []
    for word in text.split(","):
        top, _, bottom = word.strip().partition("/")
        try:
            powers.append(float(top) / (float(bottom) if bottom else 1.0))
        except (ValueError, ZeroDivisionError):
            raise FitError(
                option,
                repr(word.strip()),
                "exponents separated by commas, such as 0,1/2,1,2, or auto",
                "Correct the list.",
            ) from None
    return tuple(powers)


def parse_correction(word: str) -> float | None:
    """The number given for K_corr; None for one of `CORRECTIONS`.

    Raises
    ------
    FitError
        It is neither.
    """
    if word in CORRECTIONS:
        return None
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value <= 1.0:
        raise FitError("--k-corr", word, "joint, rule, or a number from 0 to 1", near_miss(word, CORRECTIONS))
    return value


def parse_damping(word: str) -> DampingMethod:
    """The weights that a word names.

    Raises
    ------
    FitError
        It names none.
    """
    known = tuple(map(str, DampingMethod))
    if word not in known:
        raise FitError("--damping", repr(word), " or ".join(known), near_miss(word, known))
    return DampingMethod(word)

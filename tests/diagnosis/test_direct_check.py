"""Checks by hand where no further recording tells causes apart."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from pmg.pipeline.diagnosis.design.direct_check import CHECKS, nothing_yet
from pmg.pipeline.diagnosis.motion.candidates.library import library


@dataclass(frozen=True)
class _Fit:
    identifier: str
    place: str


GAIN, CROSSTALK = _Fit("torque_gain_error", "ring"), _Fit("torque_crosstalk", "sun")
WARM, HYSTERESIS = _Fit("lubricant_viscosity", "sun"), _Fit("gear_hysteresis", "both")


def _by_hand(*sets: tuple[_Fit, ...], test_tells: bool = False) -> str:
    """What is said of some sets of causes, the leading one first."""
    best, *rivals = (SimpleNamespace(fits=fits) for fits in sets)
    naming: Any = SimpleNamespace(best=best, rivals=tuple(rivals))
    return nothing_yet(naming, test_tells=test_tells)


@pytest.mark.parametrize(
    ("sets", "begins"),
    [
        (((GAIN,), (CROSSTALK,)), "load the ring transducer by a lever and known weights"),
        (((WARM,), (CROSSTALK,)), "load the ring shaft by a lever, the sun shaft free"),
        (((WARM, GAIN), (GAIN, CROSSTALK)), "load the ring shaft by a lever, the sun shaft free"),
        (((WARM, GAIN), (GAIN, HYSTERESIS)), ""),
        (((GAIN,),), ""),
    ],
)
def test_what_some_sets_hold_and_others_do_not_is_checked(sets: tuple[tuple[_Fit, ...], ...], begins: str) -> None:
    asked = f" To tell by hand: {begins}" if begins else ""
    assert _by_hand(*sets).startswith(f"Repair nothing yet.{asked}")
    assert (_by_hand(*sets) == "Repair nothing yet.") is not bool(begins)


def test_each_check_is_of_a_mechanism_of_the_library_and_names_its_shaft() -> None:
    known = {term.identifier for term in library()}
    assert set(CHECKS) <= known
    for name in CHECKS:
        told = _by_hand((_Fit(name, "ring"),), (HYSTERESIS,))
        assert "ring" in told
        assert "only" in told


def test_a_check_is_told_only_where_no_test_tells() -> None:
    assert _by_hand((GAIN,), (WARM,)).startswith("Repair nothing yet. To tell by hand: load the ring")
    assert _by_hand((GAIN,), (WARM,), test_tells=True) == "Repair nothing yet: the next test tells."
    assert nothing_yet(None, test_tells=False) == "Repair nothing yet."

"""What to do about a diagnosis: on the bench, in the model, and which test is next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.next_test import HIDDEN
from pmg.pipeline.wording.units import MILLI
from pmg.sim.mechanisms.base import Instrument
from pmg.sim.mechanisms.thermal import MagnetTemperature
from pmg.sim.mechanisms.warmed import WarmingBearings
from pmg.sim.shafts import SIDES
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.design.next_test import NextTest
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array

EXTENDED = "compare with the extended model (`pmg compare --model model.toml`)"


def advice(diagnosis: Diagnosis) -> str:
    """Remedy for the named mechanisms, on the bench or in the model."""
    action = bench_action(diagnosis)
    if _is_fault(diagnosis):
        return f"Do: {action}."
    return f"Do: {action}, or {EXTENDED}." if action else f"Do: {EXTENDED}."


def _is_fault(diagnosis: Diagnosis) -> bool:
    """Whether a fault of a reading is among what was named."""
    naming = diagnosis.naming
    return naming is not None and any(issubclass(fit.candidate.kind, Instrument) for fit in naming.best.fits)


def bench_action(diagnosis: Diagnosis) -> str:
    """What to do on the bench about the named mechanisms; empty where nothing is to be done there."""
    naming = diagnosis.naming
    if naming is None:
        return ""
    if _is_fault(diagnosis):
        if any(naming.on_the_other_shaft(fit) for fit in naming.best.fits):
            return "calibrate one of the two transducers, or exchange them and repeat loaded points; that tells which"
        return "check the zero and the calibration of the torque transducers"
    if any(fit.candidate.kind.memory for fit in naming.best.fits):
        if warm := _begins_warm(diagnosis):
            why = f"the {warm} start above their mean temperature"
            return f"log the temperature, and start when the no-load torque no longer changes: {why}"
        return "log the temperature, and warm up first"
    return ""


def _begins_warm(diagnosis: Diagnosis) -> str:
    """The part that a named mechanism warms where it begins warmer than it is on average; else empty."""
    naming, found, at = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings.grid.points
    if naming is None or found is None or not at.ordered:
        return ""
    for mechanism, fit in zip(found.mechanisms(naming.best.problem), naming.best.fits, strict=True):
        for shaft in SIDES if fit.candidate.shaft == "both" else (fit.candidate.shaft,):
            what, rise = warmth(mechanism, shaft, at)
            known = np.isfinite(rise)
            if known.any() and rise[known][np.argmin(at.started_at[known])] > np.mean(rise[known]):
                return what
    return ""


def warmth(mechanism: Mechanism, shaft: str, at: OperatingPoints) -> tuple[str, Array]:
    """Part that a mechanism warms, and its rise above the room at each point [K]; empty and NaN where there is none."""
    if isinstance(mechanism, WarmingBearings) and (rise := mechanism.rises(at)[shaft]).any():
        return f"{shaft} bearings", rise
    if isinstance(mechanism, MagnetTemperature):
        return "magnets", mechanism.rise(at)
    return "", np.full(len(at), np.nan)


def lifting(diagnosis: Diagnosis) -> str:
    """The test that a blind design lacks, as a sentence or two."""
    test = diagnosis.lifting
    if test is None:
        return "Repeat points spread over the grid, in random order."
    sizes = " or ".join(
        f"{HIDDEN * diagnosis.floor[side].u / MILLI:.1f} mN m rms in the {side} torque" for side in diagnosis.blind
    )
    drift = f"a drift of {sizes}, {HIDDEN:g} times its repeatability,"
    power = f"It would show {drift} with {power_words(test.power)} probability; a smaller one less often."
    return f"{test.plan.description} ({test.plan.seconds / MINUTE:.0f} min). {power}"


SURE = 0.99
"""Power above which its digits have no meaning."""


def power_words(power: float) -> str:
    """A power in per cent; nothing is certain."""
    return f"{power:.0%}" if power <= SURE else f"over {SURE:.0%}"


LIKELY = 0.5
"""Power below which a test more often fails than not."""


APART, AGAIN = "tell them apart", "show it again"
"""What a test does that tells causes apart, and one that repeats a difference."""


def words_of_test(test: NextTest, does: str = APART) -> str:
    """A test with its bench time, what it `does` and its power, as a sentence."""
    plan, minutes = test.plan, f"{test.plan.seconds / MINUTE:.0f} min"
    weak = " Too weak to rely on: it is the best of those known." if test.power < LIKELY else ""
    return f"{plan.description} ({minutes}; {power_words(test.power)} likely to {does}).{weak}"


def best_test(tests: tuple[NextTest, ...]) -> NextTest:
    """The most powerful of some tests, the shortest of those that are as powerful."""
    return max(tests, key=lambda test: (test.power, -test.plan.seconds))

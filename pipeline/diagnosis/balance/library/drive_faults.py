"""Terms of a drive's own faults: of the chain from its command to the readings, and of what it makes of a command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf
from scipy.stats import norm

from pmg.pipeline.diagnosis.balance.library.columns import SETTLES, amount, part, settling, stack
from pmg.pipeline.diagnosis.balance.library.term import DELAY, DURATION, EXCEEDED, LAG, Motion, Quantity, Term
from pmg.sim.sources import BALANCE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

FADE_TEST = "Repeat the record after a rest and after a long run, and measure the drive's temperature"

DEAD_ZONE_TEST = "Raise the command slowly from zero at a machine that is held, and measure what it exerts"

BLURRED, LEAST_BLUR = (0.01, 0.3), 1e-300
"""Deviation that blurs the corners of a dead zone, over the command that a quarter of all in motion exceed: with more
it would be a gain; and the least of it, where nothing is commanded [N, N m]."""

LOST = (0.8, 1.25)
"""Part of what a command has beyond the limit of its drive that is lost: all of it, but for errors; where less is lost,
the gain is off."""

MAY_BE_OFF = norm.ppf((np.arange(7) + 0.5) / 7)
"""Deviations, equally likely, by which a command is off what the rest of the model gives."""

DEAD_ZONE = "dead_zone"
"""Id of a command that does nothing up to a size of it."""

GAIN = "actuator_gain"
"""Id of the gain of the drive, with which every amplitude that is not known grows."""


def chain_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """Faults of the chain from the command to the readings."""
    yield Term(
        GAIN,
        "Gain error of the actuator",
        "g (baseline terms)",
        part("g", "1", 0.3),
        lambda m, _: stack(m.modelled),
        BALANCE,
        separating_test=f"Push with a known {axis.pushes}, or add a known mass",
        of_model=True,
    )
    yield Term(
        DELAY,
        f"Delay or lag of the position behind the {axis.pushes} command",
        "baseline terms at t + T, or T d/dt(baseline terms)",
        part("T", "s", 0.02),
        lambda m, _: stack(m.ahead(m.modelled, m.references.get(LAG, 0.0))),
        BALANCE,
        separating_test="Record both signals of one step through one input card",
        of_model=True,
    )


def drift(axis: Axis) -> Iterator[Term[Motion]]:
    """A zero that does not stay."""
    test = f"Read the {axis.pushes} at standstill with the coupling open, before and after each record"
    yield Term(
        "zero_drift",
        f"Zero of the {axis.pushes} that drifts steadily during each record",
        "z (t/T - 1/2)",
        part("z", axis.push, 1e4),
        lambda m, _: stack(m.elapsed / m.references[DURATION] - 0.5),
        BALANCE,
        separating_test=test,
        needs_drive=True,
    )
    yield Term(
        "zero_drift",
        f"Zero of the {axis.pushes} that drifts during each record and settles",
        "z ((1 - exp(-t/(s T)))/(1 - exp(-1/s)) - 1/2)",
        part("z", axis.push, 1e4),
        lambda m, settles: stack(settling(m, settles) - 0.5),
        BALANCE,
        shape=SETTLES,
        separating_test=test,
        needs_drive=True,
        variant="settling",
    )


def _mean_sense(m: Motion, blur: float) -> Array:
    """Mean sign of a command (n,) that is off what the rest of the model gives, normally and by a known deviation."""
    deviation = max(blur * m.references[EXCEEDED], LEAST_BLUR)
    return np.asarray(erf(m.modelled / (math.sqrt(2.0) * deviation)))


def _senses(m: Motion, blur: float) -> Array:
    """Signs that the same command may have (n, k)."""
    return np.asarray(np.sign(m.modelled[:, None] + blur * m.references[EXCEEDED] * MAY_BE_OFF))


def _dead_zones(axis: Axis) -> Iterator[Term[Motion]]:
    """A command that does nothing up to a size of it."""
    yield Term(
        DEAD_ZONE,
        "Dead zone of the drive: the command must exceed it before anything acts",
        "z sign(baseline terms)",
        amount("z", axis.push, 1e4),
        lambda m, _: stack(np.sign(m.modelled)),
        BALANCE,
        separating_test=DEAD_ZONE_TEST,
        of_model=True,
    )
    yield Term(
        DEAD_ZONE,
        "Dead zone of the drive, its corners rounded or blurred by disturbances",
        "z erf(F/(2^(1/2) r F75)), F = baseline terms",
        amount("z", axis.push, 1e4),
        lambda m, blur: stack(_mean_sense(m, blur)),
        BALANCE,
        shape=Quantity("r", "1", BLURRED),
        separating_test=DEAD_ZONE_TEST,
        of_model=True,
        variant="blurred",
        outcomes=_senses,
    )


def drive_faults(axis: Axis) -> Iterator[Term[Motion]]:
    """What a drive does with its command."""
    yield from _dead_zones(axis)
    yield Term(
        "drive_fade",
        f"Drive whose {axis.pushes} fades during each record",
        "f t/T (baseline terms)",
        amount("f", "1", 1.0),
        lambda m, _: stack(m.modelled * m.elapsed / m.references[DURATION]),
        BALANCE,
        separating_test=FADE_TEST,
        of_model=True,
    )
    yield Term(
        "drive_fade",
        f"Drive whose {axis.pushes} fades during each record and settles",
        "f (1 - exp(-t/(s T)))/(1 - exp(-1/s)) (baseline terms)",
        amount("f", "1", 1.0),
        lambda m, settles: stack(m.modelled * settling(m, settles)),
        BALANCE,
        shape=SETTLES,
        separating_test=FADE_TEST,
        of_model=True,
        variant="settling",
    )
    yield Term(
        "motor_constant_sag",
        f"Drive whose {axis.pushes} falls behind its command as that grows",
        "s (baseline terms) |baseline terms|",
        part("s", f"1/({axis.push})", 10.0),
        lambda m, _: stack(m.modelled * np.abs(m.modelled)),
        BALANCE,
        separating_test=f"Measure the {axis.pushes} over the command at a machine that is held",
        of_model=True,
    )
    yield Term(
        "drive_limit",
        f"Limit of the drive (its {axis.pushes} saturates below the command)",
        "c (F - clip(F, -L, L)), L = l F75",
        (Quantity("c", "1", LOST),),
        _beyond_limit,
        BALANCE,
        shape=Quantity("l", "1", (1.0, 30.0)),
        separating_test=f"Measure the {axis.pushes} over the command, up to the largest, at a machine that is held",
        needs_drive=True,
        of_model=True,
    )


def _beyond_limit(m: Motion, times: float) -> Array:
    """What a command has beyond a multiple of what a quarter of all commands in motion exceed (n, 1).

    Below that the limit would be a gain: the command also holds what disturbs the machine. As it is made of the command
    itself, that of a withheld recording enters its prediction beyond the limit.
    """
    limit = times * m.references[EXCEEDED]
    if limit == 0.0:
        return stack(np.zeros_like(m.force))
    return stack(m.force - np.clip(m.force, -limit, limit))

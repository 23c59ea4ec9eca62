"""Terms of a machine that is not one rigid mass: a part of it on a spring, or beyond a gap."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import bilinear, lfilter, lfilter_zi

from pmg.pipeline.diagnosis.balance.library.columns import amount, stack
from pmg.pipeline.diagnosis.balance.library.flight import HARD, REBOUNDS, fly
from pmg.pipeline.diagnosis.balance.library.term import DELAY, Motion, Quantity, Term
from pmg.sim.signals import REVOLUTION
from pmg.sim.sources import BALANCE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

RESONANCE, BACKLASH = "two_masses", "backlash"
"""Terms of a mass on a spring, and of a load beyond a gap."""

HARD_STOP, SURE_FLIGHT = "hard", f"{BACKLASH}/hard"
"""Variant and key of the latter of which it is known how it rebounds, so that its flight may be foretold."""

LIKE_PLAY = frozenset({DELAY, RESONANCE})
"""Terms that together explain what play in a coupling does: it comes late, and lets the far side swing."""

DAMPED = (0.02, 0.1)
"""Parts of critical damping of a mass on a spring: of steel, and of an elastomer or a belt."""

HIGHEST = 0.4
"""Natural frequency, over the rate of the samples, from which on they do not show it."""

BACKLASH_TITLE = "Backlash (the load moves on once a gap is crossed)"
"""Title of every form of backlash."""

GAP_EDGE = 8
"""Power by which the end of a gap falls off: steep, and smooth enough for its place to have an uncertainty."""

SETTLED = 3.0
"""Decay times of the free oscillation for which the machine is taken to have moved before it is recorded."""

GAP_TEST = "Hold the load and turn the motor gently back and forth: what it moves without effort is the gap"

TAP_TEST = (
    "Hold the machine and tap the driven mass, or sweep the command through the frequency, with a speed measured on "
    "either side of the coupling"
)


def elastic_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """A part of the mass on a spring, lightly and well damped."""
    for damping, variant in zip(DAMPED, ("", "damped"), strict=True):
        yield Term(
            RESONANCE,
            "A part of the mass on a spring (a resonance behind an elastic coupling or belt)",
            f"m (a_far - a), a_far of a mass on a spring of f Hz with {damping:g} of critical damping",
            amount("m", axis.mass, 1e5),
            lambda m, hertz, damping=damping: stack(_carried(m, hertz, damping) - m.clear_acceleration),  # type: ignore[misc]  # bound now
            BALANCE,
            shape=Quantity("f", "Hz", (1.0, 100.0)),
            separating_test=TAP_TEST,
            needs_drive=True,
            variant=variant,
            sharp=True,
            at_an_instant=False,
        )


def gap_terms(axis: Axis) -> Iterator[Term[Motion]]:
    """A load beyond a gap: one that friction holds until the gap is crossed, and one that flies across it."""
    yield Term(
        BACKLASH,
        BACKLASH_TITLE,
        "-(Fl sign(v) + m a) exp(-(travel/b)8)",
        (*amount("Fl", axis.push, 1e4), *amount("m", axis.mass, 1e4)),
        _across_gap,
        BALANCE,
        shape=Quantity("b", axis.length, axis.presliding),
        separating_test=GAP_TEST,
        of_parts=True,
    )
    for variant, rebounds, outcomes in ((HARD_STOP, (HARD,), None), ("flying", REBOUNDS, flights)):
        parts = f"{HARD}" if outcomes is None else f"{REBOUNDS[0]} to {REBOUNDS[-1]}, the mean,"
        yield Term(
            BACKLASH,
            BACKLASH_TITLE,
            f"m (a_far - a), a_far of a mass that is free across b and rebounds with {parts} of its speed",
            amount("m", axis.mass, 1e4),
            lambda m, gap, rebounds=rebounds: stack(flights(m, gap, rebounds).mean(axis=1)),  # type: ignore[misc]  # bound now
            BALANCE,
            shape=Quantity("b", axis.length, axis.gaps),
            separating_test=GAP_TEST,
            needs_drive=True,
            variant=variant,
            sharp=True,
            at_an_instant=False,
            outcomes=outcomes,
        )


def _across_gap(m: Motion, gap: float) -> Array:
    """Force missing while a gap is crossed (n, 2): of the load's friction and of its inertia, per unit of each."""
    return -stack(m.sense, m.clear_acceleration) * np.exp(-((m.travel / gap) ** GAP_EDGE))[:, None]


def flights(m: Motion, gap: float, rebounds: Sequence[float] = REBOUNDS) -> Array:
    """Acceleration of a load that flies across a gap, beyond that of the machine, with some rebounds (n, k).

    The machine's is cleared of noise: with it a load at an even speed would fly to and fro, and what noise makes of
    the acceleration is in what is left of the force as well. When a load meets its stop depends on every time it met
    one before, so that nobody knows it for long.
    """
    stretches = (np.split(values, m.starts[1:]) for values in (m.speed, m.clear_acceleration, m.sense))
    found = []
    for speed, change, sense in zip(*stretches, strict=True):
        moves = speed[0] + cumulative_trapezoid(change, dx=m.sample_time, initial=0)
        driven = float(sense[np.argmax(sense != 0.0)])
        flown = (fly(moves, m.sample_time, gap, rebound, driven) - moves for rebound in rebounds)
        found.append(np.stack([np.gradient(one, m.sample_time) for one in flown], axis=1))
    return np.concatenate(found)


def _carried(m: Motion, hertz: float, damping: float) -> Array:
    r"""Acceleration, without noise, of a mass that the machine carries along through a damped spring (n,).

    That of the machine behind :math:`(2\zeta\omega s + \omega^2)/(s^2 + 2\zeta\omega s + \omega^2)`, or its own where
    the samples do not show the frequency. Before a recording began the machine is taken to have moved as after it,
    mirrored, so that one which begins in motion does not ring.
    """
    if hertz * m.sample_time > HIGHEST:
        return m.clear_acceleration
    natural = 2.0 / m.sample_time * math.tan(0.5 * REVOLUTION * hertz * m.sample_time)  # as the samples have it
    b, a, settled = _through_spring(natural, damping, m.sample_time)
    before = round(SETTLED / (damping * natural * m.sample_time))
    found = []
    for part in np.split(m.clear_acceleration, m.starts[1:]):
        mirrored = 2.0 * part[0] - part[before:0:-1]
        whole = np.r_[mirrored, part]
        found.append(lfilter(b, a, whole, zi=settled * whole[0])[0][len(mirrored) :])
    return np.concatenate(found)


@lru_cache(maxsize=1024)
def _through_spring(natural: float, damping: float, step: float) -> tuple[Array, Array, Array]:
    """Filter of what a spring carries, and its state at rest; every search looks at the same frequencies."""
    through = [2.0 * damping * natural, natural**2]
    b, a = bilinear(through, [1.0, *through], 1.0 / step)
    return b, a, lfilter_zi(b, a)

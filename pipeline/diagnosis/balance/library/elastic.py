"""Terms of a machine that is not one rigid mass."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import bilinear, lfilter, lfilter_zi

from pmg.pipeline.diagnosis.balance.library.columns import amount, stack
from pmg.pipeline.diagnosis.balance.library.term import Motion, Quantity, Term
from pmg.sim.signals import REVOLUTION
from pmg.sim.sources import BALANCE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

RESONANCE = "two_masses"
"""Term of a mass on a spring."""

LIKE_PLAY = frozenset({"delay", RESONANCE})
"""Terms that together explain what play in a coupling does: it comes late, and lets the far side swing."""

DAMPED = (0.02, 0.1)
"""Parts of critical damping of a mass on a spring: of steel, and of an elastomer or a belt."""

HIGHEST = 0.4
"""Natural frequency, over the rate of the samples, from which on they do not show it."""

SETTLED = 3.0
"""Decay times of the free oscillation for which the machine is taken to have moved before it is recorded."""

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
            lambda m, hertz, damping=damping: stack(_carried(m, hertz, damping) - m.acceleration),  # type: ignore[misc]
            BALANCE,
            shape=Quantity("f", "Hz", (1.0, 100.0)),
            separating_test=TAP_TEST,
            needs_drive=True,
            variant=variant,
            sharp=True,
            at_an_instant=False,
        )


def _carried(m: Motion, hertz: float, damping: float) -> Array:
    r"""Acceleration of a mass that the machine carries along through a damped spring (n,).

    That of the machine behind :math:`(2\zeta\omega s + \omega^2)/(s^2 + 2\zeta\omega s + \omega^2)`, or its own where
    the samples do not show the frequency. Before a recording began the machine is taken to have moved as after it,
    mirrored, so that one which begins in motion does not ring.
    """
    if hertz * m.sample_time > HIGHEST:
        return m.acceleration
    natural = 2.0 / m.sample_time * math.tan(0.5 * REVOLUTION * hertz * m.sample_time)  # as the samples have it
    b, a, settled = _through_spring(natural, damping, m.sample_time)
    before = round(SETTLED / (damping * natural * m.sample_time))
    found = []
    for part in np.split(m.acceleration, m.starts[1:]):
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

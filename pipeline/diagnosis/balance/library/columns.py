"""What the terms of every library are made of: columns, waves, and parameters of one sign or either."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import DURATION, HOW_MANY, RECORDING, Motion, Quantity

if TYPE_CHECKING:
    from pmg.sim.signals import Array

RIPPLE, SECOND_RIPPLE = "position_ripple", "second_ripple"
"""Terms of a wave over position, and of one more with a period of its own, as of cogging beside the weight of an arm:
it is looked for once the first is found, and has the same columns."""

SETTLES = Quantity("s", "1", (0.05, 1.0))
"""Settling time of what changes during a record, over the length T of the longest one; a slower change can hardly be
distinguished from a steady one."""


def stack(*columns: Array) -> Array:
    """Columns beside one another (n, k)."""
    return np.stack(columns, axis=1)


def waves_of(m: Motion, angle: Array) -> Array:
    """Sine and cosine; each recording has its own where no angle was recorded, and none where it was not fitted."""
    waves = stack(np.sin(angle), np.cos(angle))
    if RECORDING not in m.besides:
        return waves
    own = m.besides[RECORDING][:, None] == np.arange(m.references[HOW_MANY])
    return np.asarray((own[:, :, None] * waves[:, None, :]).reshape(len(waves), -1))


def part(name: str, unit: str, most: float) -> tuple[Quantity]:
    """A single amplitude of either sign."""
    return (Quantity(name, unit, (-most, most)),)


def amount(name: str, unit: str, most: float) -> tuple[Quantity]:
    """A single amplitude that is not negative."""
    return (Quantity(name, unit, (0.0, most)),)


def settling(m: Motion, settles: float) -> Array:
    """How far a change has come that settles (n,): from zero to 1 at the end of the longest record."""
    return np.asarray(np.expm1(-m.elapsed / (settles * m.references[DURATION])) / np.expm1(-1.0 / settles))

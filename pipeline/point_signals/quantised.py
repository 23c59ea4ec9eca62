"""Numbers as signed 16-bit integers, each array with its own offset and scale."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.sim.signals import Array

LARGEST = 30000
"""Largest code of a number; the smallest is its negative."""
UNKNOWN = -32768
"""Code of a number that is not known."""


@dataclass
class Numbers:
    """Codes that are being gathered, and how many."""

    parts: list[bytes] = field(default_factory=list)
    count: int = 0

    def add(self, values: Array, range_of: Iterable[Array] = (), *, log: bool = False) -> list[float]:
        """Quantise values, over the range of these and others, and say where they stand."""
        if log:
            values = np.log10(values, out=np.full(len(values), np.nan), where=values > 0.0)
        offset, scale = _scaling(np.concatenate([values, *range_of]))
        codes = np.full(len(values), UNKNOWN, dtype="<i2")
        known = np.isfinite(values)
        if scale > 0.0:
            steps = np.rint((values[known] - offset) / scale)
            codes[known] = np.clip(steps, -LARGEST, LARGEST)  # rounding of offset and scale, at the ends of the range
        else:
            codes[known] = 0
        first, self.count = self.count, self.count + len(codes)
        self.parts.append(codes.tobytes())
        return [first, len(codes), offset, scale, int(log)]


def _scaling(values: Array) -> tuple[float, float]:
    """Middle of the values, and the step between codes."""
    known = values[np.isfinite(values)]
    if not len(known):
        return 0.0, 0.0
    low, high = float(known.min()), float(known.max())
    return low / 2.0 + high / 2.0, high / (2 * LARGEST) - low / (2 * LARGEST)

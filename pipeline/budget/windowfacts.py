"""What the store knows of the windows behind a grid, beside their means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.budget.shared import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.store import Manifest
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class ShaftFacts:
    """One shaft over n windows.

    Parameters
    ----------
    dof : (n,) array
        Degrees of freedom of the uncertainty from within the window; NaN where it is not known.
    correlation_time : (n,) array
        Of the torque noise [s].
    correlated : (n,) array of bool
        Flagged: the noise outlives a twentieth of the window.
    remembered : (n,) array of bool
        Uncertainty from the memory of the noise instead of batches.
    resolution : (n,) array
        Step between neighbouring values of the torque [N m]; NaN where it is not known.
    std : (n,) array
        Standard deviation of the torque [N m].
    """

    dof: Array
    correlation_time: Array
    correlated: Mask
    remembered: Mask
    resolution: Array
    std: Array


@dataclass(frozen=True)
class WindowFacts:
    """Both shafts, windows in the order of the grid, and the limits by which they were judged."""

    sun: ShaftFacts
    ring: ShaftFacts
    limits: Mapping[str, float]

    @property
    def correlated(self) -> Mask:
        """Windows flagged on either shaft (n,)."""
        return self.sun.correlated | self.ring.correlated


def sorted_windows(manifests: Sequence[Manifest]) -> list[dict[str, Any]]:
    """The windows of a campaign in the order in which they were run."""
    return sorted(
        (window for manifest in manifests for window in manifest.document["windows"]),
        key=lambda window: (window["started_at_s"], window["point"]),
    )


def window_facts(manifests: Sequence[Manifest]) -> WindowFacts:
    """What the manifests say of the windows of `measured_grid`; a number that an earlier version left out is NaN."""
    windows = sorted_windows(manifests)
    sun, ring = (_of_shaft([window["means"][side] for window in windows]) for side in SIDES)
    limits = [manifest.document["limits"] for manifest in manifests if "limits" in manifest.document]
    return WindowFacts(sun, ring, limits[-1] if limits else {})


def _of_shaft(means: Sequence[Mapping[str, Any]]) -> ShaftFacts:
    def numbers(key: str) -> Array:
        values = [mean.get(key) for mean in means]
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    return ShaftFacts(
        dof=numbers("dof"),
        correlation_time=numbers("correlation_time"),
        correlated=np.array([bool(mean.get("correlated")) for mean in means], dtype=bool),
        remembered=np.array([mean.get("method") == "memory" for mean in means], dtype=bool),
        resolution=numbers("resolution"),
        std=numbers("std"),
    )

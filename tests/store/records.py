"""Manifests and windows made for tests."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pmg.pipeline.recording.means import PointMeans, ShaftMeans
from pmg.pipeline.recording.run_records import Setpoints
from pmg.pipeline.store.manifest import StoredWindow
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from collections.abc import Mapping

SHAFT = ShaftMeans(0.5, 1e-3, 9.0, 1, 1e-2, 1e-3, 0.0, 10.0)
WINDOW = StoredWindow(
    point="P1",
    configuration=Configuration.NEUTRAL,
    gear=1,
    drive="sun",
    started_at_s=0.0,
    first_sample=0,
    stop_sample=1000,
    setpoints=Setpoints(),
    accepted=True,
    reasons=(),
    rest_sun=False,
    rest_ring=False,
    means=PointMeans(SHAFT, replace(SHAFT, torque=0.7), 1000, 1.0),
)


def window(torque: Mapping[str, float] | None = None, **change: Any) -> StoredWindow:  # noqa: ANN401  (any field)
    """A window with these mean torques [N m]."""
    means = WINDOW.means
    if torque is not None:
        means = replace(means, sun=replace(SHAFT, torque=torque["sun"]), ring=replace(SHAFT, torque=torque["ring"]))
    return replace(WINDOW, means=means, **change)

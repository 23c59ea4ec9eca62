"""One window shown whole: its order spectrum, and the average turn."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.orders.angle import AverageTurn, average_turn, by_angle, order_amplitudes
from pmg.sim.errors import StoreError
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterable

    import polars as pl

    from pmg.pipeline.store.manifest import Manifest, StoredWindow
    from pmg.pipeline.store.store import Store
    from pmg.sim.signals import Array

FEWEST_TURNS = 5.0
"""Turns of the slower shaft in a window that is shown."""
FINEST, COARSEST = 512, 16
"""Most and fewest steps a turn."""


@dataclass(frozen=True)
class ShaftExample:
    """The torque of one shaft over its own angle.

    Parameters
    ----------
    side : str
        ``sun`` or ``ring``.
    orders, magnitudes : (k,) array
        Order spectrum over all whole turns [N m].
    angle : (b,) array
        Middles of the steps of a turn [rad].
    turn : AverageTurn
        The average turn [N m].
    """

    side: str
    orders: Array
    magnitudes: Array
    angle: Array
    turn: AverageTurn


@dataclass(frozen=True)
class Example:
    """One window shown whole."""

    point: str
    shafts: tuple[ShaftExample, ...]


def choose_example(store: Store, manifests: Iterable[Manifest]) -> Example | None:
    """The slowest accepted window, engaged if there is one, that holds `FEWEST_TURNS` turns; None without one.

    The slowest, since it has the most samples a turn and so shows the highest orders.
    """
    found = []
    for manifest in manifests:
        for window in manifest.windows:
            speeds = window.means.sun.speed, window.means.ring.speed
            if not window.accepted or any(map(math.isnan, speeds)):
                continue
            slowest = min(map(abs, speeds))
            turns = slowest * window.means.duration / REVOLUTION
            if turns >= FEWEST_TURNS:
                found.append((window.configuration != "engaged", slowest, window.first_sample, manifest, window))
    for _, _, _, manifest, window in sorted(found, key=lambda item: (*item[:3], item[3].identifier)):
        with suppress(StoreError):  # samples that are damaged or changed; they are named where all are read
            return _example(store.samples(manifest), window)
    return None


def _example(samples: pl.DataFrame, window: StoredWindow) -> Example:
    """The window of these samples, shown whole."""
    offset = int(samples["sample"][0])
    part = samples.slice(window.first_sample - offset, window.stop_sample - window.first_sample)
    shafts = [_shaft(side, part[f"torque_{side}"].to_numpy(), part[f"angle_{side}"].to_numpy()) for side in SIDES]
    return Example(window.point, tuple(shafts))


def _shaft(side: str, torque: Array, angle: Array) -> ShaftExample:
    turned = abs(float(angle[-1] - angle[0])) / REVOLUTION
    steps = 2 ** int(np.log2(len(torque) / turned))
    turns = by_angle(torque, angle, min(FINEST, max(COARSEST, steps)))
    orders, magnitudes = order_amplitudes(turns)
    return ShaftExample(side, orders, magnitudes, turns.middles, average_turn(turns))

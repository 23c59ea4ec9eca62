"""Numbers at the ends of what a float holds, and those that are none: calibration, samples, set-points, metadata."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.grid.checked_campaign import ENGAGED, NEUTRAL, Runs
from tests.recording.writer import CALIBRATION

from .case import Case
from .signals import COUNT, RING, SUN, changed, put, torque

NUMBERS = ("1e308", "-1e308", "5e-324", "nan", "inf", "-inf")
INSIDE = ("null_frequency_Hz", "nominal_torque_Nm", "span_Hz", "counts_per_rev")
TOPICS = (SUN, RING, *COUNT.values())
SET = ("sun_speed_set_rpm", "ring_speed_set_rpm", "ring_torque_set_Nm", "gear")


def _calibration(key: str, number: str) -> Callable[[Runs], None]:
    lines = [f"{key} = {number}" if line.startswith(f"{key} ") else line for line in CALIBRATION.splitlines()]
    return changed(calibration="\n".join(lines) + "\n")


def _told(key: str, number: str, name: str = NEUTRAL) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        runs[name] = replace(runs[name], run=dict(runs[name].run) | {key: number})

    return plant


def _cases(number: str) -> tuple[tuple[str, Callable[[Runs], None]], ...]:
    value = float(number)
    return (
        *((f"{key} of the calibration {number}", _calibration(key, number)) for key in INSIDE),
        (f"one sample {number} Hz", torque(put(slice(500, 501), value))),
        (f"every tenth sample {number} Hz", torque(put(slice(0, None, 10), value))),
        (f"all samples {number} Hz", torque(put(slice(None), value), "ring")),
        (f"samples of {number} Hz with both signs", torque(lambda v: value * (-1.0) ** np.arange(len(v)))),
        *((f"{key} {number}", _told(key, number)) for key in SET),
        (f"set-point of a load {number}", _told("ring_torque_set_Nm", number, ENGAGED)),
        (f"rate of every channel {number}", changed(channel={topic: {"rate_hz": number} for topic in TOPICS})),
        (f"rate of one channel {number}", changed(channel={SUN: {"rate_hz": number}})),
        (f"bits of a counter {number}", changed(channel={COUNT["sun"]: {"bits": number}})),
    )


CASES = tuple(
    Case("extreme", what, plant, small="load" not in what) for number in NUMBERS for what, plant in _cases(number)
)

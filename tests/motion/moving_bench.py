"""Recordings of runs in motion for tests: given speeds and torques, written as a recorder writes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.recording.writer import COUNTS_PER_REV, NOMINAL, NULL_HZ, SPAN_HZ, Bench, write

Floats = npt.NDArray[np.float64]
RATE, SECONDS = 500.0, 3.0
TIME: Floats = np.arange(round(RATE * SECONDS)) / RATE
COUNT = 2.0 * math.pi / COUNTS_PER_REV
NOISE = 0.005
"""Noise of the torques [N m]."""
RATIO = 2.6


def hump(height: float) -> Floats:
    """A speed that rises from rest to a height [rad/s] and falls back over the run (n,)."""
    return height * np.sin(np.pi * TIME / SECONDS) ** 2


def counts(speed: Floats) -> npt.NDArray[np.int64]:
    """Encoder counts of a speed [rad/s]."""
    return np.floor(np.cumsum(speed) / RATE / COUNT).astype(np.int64)


def torques(side: str) -> Floats:
    """Torque of a shaft with its noise [N m], always the same."""
    return {"sun": 0.1, "ring": 0.3}[side] * np.sin(np.pi * TIME) + noise(side)


def noise(side: str) -> Floats:
    """Noise of the torque of a shaft [N m], always the same."""
    return NOISE * np.random.default_rng(7 if side == "sun" else 8).standard_normal(len(TIME))


def instead(values: npt.NDArray[Any]) -> Callable[[npt.NDArray[Any]], npt.NDArray[Any]]:
    """These samples instead of any."""
    return lambda _: values


def moving(
    path: Path,
    manoeuvre: str = "ramp",
    speeds: Mapping[str, Floats] | None = None,
    *,
    run: Mapping[str, str | None] | None = None,
    steps: tuple[tuple[int, str], ...] | None = None,
    count: Mapping[str, Callable[[npt.NDArray[Any]], npt.NDArray[Any]]] | None = None,
    torque: Mapping[str, Callable[[Floats], Floats]] | None = None,
    **more: Any,  # noqa: ANN401 - as `Bench` takes them
) -> Path:
    """Write a run; `count` and `torque` spoil the signals of a shaft, `steps` are (sample, phase)."""
    point = path.stem
    speeds = speeds if speeds is not None else {"sun": hump(60.0)}
    spoil: dict[str, Any] = {}
    for side in ("sun", "ring"):
        turned, read = counts(speeds.get(side, np.zeros(len(TIME)))), torques(side)
        turned = count[side](turned) if count and side in count else turned
        read = torque[side](read) if torque and side in torque else read
        spoil[f"/daq/encoder_{side}/count"] = instead(turned % 2**32)
        spoil[f"/daq/torque_{side}/frequency"] = instead(NULL_HZ[side] + read / NOMINAL[side] * SPAN_HZ[side])
    phases = ((0, "START"), (0, manoeuvre.upper()), (len(TIME) - 1, "END")) if steps is None else steps
    bench = Bench(
        seconds=SECONDS,
        rate_hz=RATE,
        run={"campaign": "moving", "point": point, "manoeuvre": manoeuvre, **(run or {})},
        steps=tuple((sample, point, phase, {}) for sample, phase in phases),
        spoil=spoil,
        **more,
    )
    return write(path, bench)


def geared(height: float = 60.0) -> dict[str, Floats]:
    """Speeds of both shafts, engaged in gear 1."""
    return {"sun": hump(height), "ring": -hump(height) / RATIO}


ENGAGED = {"configuration": "engaged"}


def started(number: int) -> dict[str, str]:
    """The start of run so many."""
    return {"started_at": f"2025-06-03T08:{number:02d}:00Z"}


def at_rest(path: Path, number: int) -> Path:
    """A zero check."""
    still = {"sun": np.zeros(len(TIME)), "ring": np.zeros(len(TIME))}
    alone: dict[str, Callable[[Floats], Floats]] = {"sun": lambda _: noise("sun"), "ring": lambda _: noise("ring")}
    return moving(path, "zero", still, run={"configuration": "zero", **started(number)}, torque=alone)

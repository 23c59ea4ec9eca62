"""The recordings of raw/gearbox, made anew: ``python -m tests.balance.make_gearbox_example FOLDER``.

Synthetic: a gearbox of two stages between a motor and a brake, logged as a test bench of another house logs. What is
concealed in it shares no code with the library: the friction under load is no straight line, and the oil warms.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, RootObject, TdmsWriter
from tests.balance.gearbox import COULOMB, INERTIA, RATE, RATIO, VISCOUS, driven

EVERY = 2
"""Samples of the simulation from one of the log to the next."""


def write_example(folder: Path) -> None:
    """Three logs: two to fit, one to withhold."""
    rng = np.random.default_rng(20261123)
    for k in (1, 2, 3):
        m = driven(rng, 60.0)
        warm = 1.0 - 0.06 * (1.0 - np.exp(-(m.t + 60.0 * k) / 150.0))
        sense = np.tanh(m.speed / 0.4)
        losses = INERTIA * m.acceleration + VISCOUS * warm * m.speed + COULOMB * sense
        losses += 0.024 * sense * (np.sqrt(m.load**2 + 0.05**2) - 0.05) ** 1.06
        ripple = 0.004 * np.sin(12.0 * np.cumsum(m.speed) / RATE)

        def logged(name: str, unit: str, values: np.ndarray, noise: float, step: float) -> ChannelObject:
            drift = np.cumsum(rng.standard_normal(len(values))) * noise / 400.0
            shown = values + noise * rng.standard_normal(len(values)) + drift - drift.mean()
            shown = (step * np.round(shown / step))[::EVERY].astype(np.float32)
            properties = {"unit_string": unit, "wf_increment": EVERY / RATE, "wf_start_offset": 0.0}
            return ChannelObject("Messung", name, shown, properties)

        channels = [
            logged("n_Motor", "1/min", m.speed * 30.0 / np.pi, 0.3, 0.05),
            logged("M_Motor", "Nm", m.load + losses + ripple, 0.012, 0.001),
            logged("n_Bremse", "1/min", m.speed / RATIO * 30.0 / np.pi, 0.1, 0.05),
            logged("M_Bremse", "Nm", m.load * RATIO, 0.12, 0.01),
        ]
        with TdmsWriter(str(folder / f"lauf_0{k}.tdms")) as writer:
            writer.write_segment([RootObject({"Pruefling": "Getriebe", "Lauf": k}), *channels])


if __name__ == "__main__":
    write_example(Path(sys.argv[1]))

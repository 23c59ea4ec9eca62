"""A simulated run in other formats, its calibration and its map: what the tests of the import read."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.write import SimulatedRun, recording_bytes
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM

Array = npt.NDArray[np.float64]
RATE = 500.0
START = datetime(2026, 3, 4, 9, 30, 0, 250_000, tzinfo=UTC)
CALIBRATION = Calibration(
    Transducer(10_000.0, 5.0, 5_000.0, "A"), Transducer(10_000.0, 10.0, -5_000.0, "B"), 5120, 4096
)
CALIBRATION_TEXT = """
[transducer.sun]
null_frequency_Hz = 10000.0
nominal_torque_Nm = 5.0
span_Hz = 5000.0
serial = "A"
[transducer.ring]
null_frequency_Hz = 10000.0
nominal_torque_Nm = 10.0
span_Hz = -5000.0
serial = "B"
[encoder.sun]
counts_per_rev = 5120
[encoder.ring]
counts_per_rev = 4096
"""
RUN = """
[run]
campaign = "made"
point = "E1"
configuration = "engaged"
gear = 2
drive = "sun"
started_at = 2026-03-04T09:30:00.250Z
sun_speed_set_rpm = 600
"""
TOPICS = {
    "torque_sun": "/daq/torque_sun/frequency",
    "torque_ring": "/daq/torque_ring/frequency",
    "angle_sun": "/daq/encoder_sun/count",
    "angle_ring": "/daq/encoder_ring/count",
}


@functools.cache
def run(samples: int = 2500) -> SimulatedRun:
    noise = np.random.default_rng(11).normal(0.0, 0.02, (2, samples))
    t = np.arange(samples) / RATE
    return SimulatedRun(
        campaign="made",
        point="E1",
        configuration=Configuration.ENGAGED,
        gear=2,
        started_at=START,
        drive="sun",
        rate=RATE,
        torque_sun=2.0 + noise[0],
        torque_ring=3.8 + noise[1],
        angle_sun=0.4 + 600.0 * RPM * t,
        angle_ring=5.0 - 230.0 * RPM * t,
        setpoints={"sun_speed_set_rpm": 600.0},
    )


@functools.cache
def original(samples: int = 2500) -> bytes:
    """The run as a recording of layout pmg.v1, without any detour."""
    return recording_bytes(run(samples), CALIBRATION)


@dataclass(frozen=True)
class Columns:
    """Raw values as an acquisition would log them."""

    time: Array
    frequency_sun: Array
    frequency_ring: Array
    count_sun: npt.NDArray[np.int64]
    count_ring: npt.NDArray[np.int64]


def columns(samples: int = 2500) -> Columns:
    made = run(samples)
    counts = [
        np.floor(angle / (2 * np.pi / per_rev)).astype(np.int64) % 2**32
        for angle, per_rev in ((made.angle_sun, 5120), (made.angle_ring, 4096))
    ]
    return Columns(
        np.arange(samples) / RATE,
        CALIBRATION.sun.frequency(made.torque_sun),
        CALIBRATION.ring.frequency(made.torque_ring),
        counts[0],
        counts[1],
    )


def channel(topic: str, source: str, **more: str | float) -> str:
    lines = [f"{key} = {value!r}" for key, value in {"topic": topic, "source": source, **more}.items()]
    return "\n".join(["[[channel]]", *lines, ""])


def map_text(channels: str, time: str = "rate_Hz = 500", extra: str = "", run: str = RUN) -> str:
    top = 'schema = "pmg.import/1"\ncalibration = "calibration.toml"\n'
    return f"{top}{run}\n[time]\n{time}\n{extra}\n{channels}"


PLAIN = "".join(channel(topic, name) for name, topic in TOPICS.items())
"""Channels called like the signals, in the units of the topics."""
UNITS = {"torque_sun": "Hz", "torque_ring": "Hz", "angle_sun": "1", "angle_ring": "1"}


def write_map(folder: Path, text: str) -> Path:
    (folder / "calibration.toml").write_text(CALIBRATION_TEXT, encoding="utf-8")
    path = folder / "map.toml"
    path.write_text(text, encoding="utf-8")
    return path


def raw(samples: int = 2500) -> dict[str, npt.NDArray[np.float64] | npt.NDArray[np.int64]]:
    made = columns(samples)
    return {
        "torque_sun": made.frequency_sun,
        "torque_ring": made.frequency_ring,
        "angle_sun": made.count_sun,
        "angle_ring": made.count_ring,
    }


def csv_text(
    samples: int = 2500,
    *,
    delimiter: str = ";",
    decimal: str = ",",
    end: str = "\r\n",
    units: bool = True,
    comment: str = "# bench: Süd\r\n",
    time: bool = False,
) -> str:
    table = raw(samples)
    names = (["t"] if time else []) + list(table)
    rows = [delimiter.join(names)]
    if units:
        rows.append(delimiter.join((["s"] if time else []) + [UNITS[name] for name in table]))
    for i in range(samples):
        cells = [f"{i / RATE:.4f}"] if time else []
        cells += [f"{table[n][i]:.6f}" if table[n].dtype.kind == "f" else str(table[n][i]) for n in table]
        rows.append(delimiter.join(cell.replace(".", decimal) for cell in cells))
    return comment + end.join(rows) + end

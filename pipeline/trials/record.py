"""A concealed campaign as a folder of recordings, one window a file."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.write import COUNTS_PER_REV, NULL_FREQUENCY_HZ, SPAN_HZ, SimulatedRun, recording_bytes
from pmg.pipeline.trials.nature import hold_points
from pmg.pipeline.trials.world import NOMINAL_RING, NOMINAL_SUN, RATE, STEP_HZ, WINDOW
from pmg.sim.grid import Configuration
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pmg.pipeline.trials.nature import ConcealedCampaign
    from pmg.sim.signals import Array


def _bench_calibration() -> Calibration:
    """Transducers and encoders of the proving bench."""
    sun, ring = (
        Transducer(NULL_FREQUENCY_HZ, nominal, SPAN_HZ, "concealed") for nominal in (NOMINAL_SUN, NOMINAL_RING)
    )
    return Calibration(sun, ring, COUNTS_PER_REV, COUNTS_PER_REV)


def _record_case(case: ConcealedCampaign, rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """Name and content of each recording, in the order in which the points were run.

    Parameters
    ----------
    case : ConcealedCampaign
        What is recorded.
    rng : numpy.random.Generator
        Noise of this run of the campaign; the same state gives the same bytes.
    """
    points, at, noise = hold_points(case, rng), case.design.at, case.world.noise
    calibration, n = _bench_calibration(), round(WINDOW * RATE)
    time = np.arange(n) / RATE
    for i in range(len(at)):
        torque_sun, torque_ring = (
            _stepped(torque[i] + white * rng.standard_normal(n), nominal)
            for torque, white, nominal in zip(
                points.torques, (noise.white_sun, noise.white_ring), (NOMINAL_SUN, NOMINAL_RING), strict=True
            )
        )
        angle_sun, angle_ring = (rng.uniform(0.0, REVOLUTION) + speed[i] * time for speed in points.speeds)
        setpoints = {
            "sun_speed_set_rpm": round(at.speed_sun[i] / RPM, 6),
            "ring_speed_set_rpm": round(at.speed_ring[i] / RPM, 6),
            "ring_torque_set_Nm": float(at.load_set[i]),
        }
        run = SimulatedRun(
            campaign=case.campaign,
            point=str(at.name[i]),
            configuration=Configuration(str(at.configuration[i])),
            gear=int(at.gear[i]),
            started_at=datetime.fromtimestamp(float(at.started_at[i]), tz=UTC),
            drive=str(at.drive[i]),
            rate=RATE,
            torque_sun=torque_sun,
            torque_ring=torque_ring,
            angle_sun=angle_sun,
            angle_ring=angle_ring,
            setpoints=setpoints,
        )
        yield f"{i:04d}.mcap", recording_bytes(run, calibration)


def write_case(case: ConcealedCampaign, folder: Path, rng: np.random.Generator) -> None:
    """The recordings, written into a folder that is there already; the truth is not among them."""
    for name, content in _record_case(case, rng):
        (folder / name).write_bytes(content)


def _stepped(torque: Array, nominal: float) -> Array:
    """Torque in the steps of the transducer's frequency [N m]."""
    step = STEP_HZ / SPAN_HZ * nominal
    return np.asarray(np.round(torque / step) * step)

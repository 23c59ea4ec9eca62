"""Rows that tell little: where a machine sticks at a reversal, and where steps of its encoder pass the low-pass."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from tests.balance.dry_drive import DryDrive, sweep, triangle, write_records
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.row_noise import noise_of_steps
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.pipeline.machine.channel import PrepareTable
from pmg.pipeline.machine.machine_file import read_machine

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.signals import Array

RATE, STEP = 1000.0, 2.0 * math.pi / 65536


def _smoother() -> Smoother:
    return Smoother(PrepareTable.model_validate({"rate_Hz": RATE, "low_pass_Hz": 20.0, "keep_every": 20}), 1.0 / RATE)


def _steps(speed: Array, step: float) -> Array:
    angle = np.cumsum(speed) / RATE
    smoother = _smoother()
    counted = np.floor(angle / step) * step
    return noise_of_steps(counted, smoother.smooth(counted), smoother)


def test_steps_are_slow_where_a_sample_passes_a_whole_number_of_them() -> None:
    step = 2.0 * math.pi / 4096
    speed = np.linspace(0.5, 1.5, 20000) * step * RATE
    found = _steps(speed, step)
    at_whole = np.abs(speed / step / RATE - 1.0) < 0.01
    between = np.abs(speed / step / RATE - 0.75) < 0.02
    assert found[at_whole].mean() > 3.0 * found[between].mean()


def test_a_position_without_steps_or_with_blurred_ones_has_no_noise_of_them() -> None:
    rng, smoother = np.random.default_rng(5), _smoother()
    angle = np.cumsum(np.linspace(0.5, 1.5, 20000)) / RATE
    blurred = np.round(angle / STEP + rng.standard_normal(len(angle))) * STEP
    for position in (angle, blurred):
        assert not noise_of_steps(position, smoother.smooth(position), smoother).any()


@slow
def test_plain_dry_friction_that_sticks_at_reversals_is_no_mismatch(tmp_path: Path) -> None:
    """Friction is free; how long it holds the machine, and how a low-pass rounds off its kinks, no cause explains."""
    drive = DryDrive(1.1e-3, 8e-4, 6e-3, 0.0, 1.0, 4096, 3.2e-4, 0.06, 0.34)
    runs = {"slow": triangle(20.0, 8.0), "reversals": triangle(3.0, 1.5), "sweep": sweep(30.0, 0.1, 3.0, 40.0)}
    case = case_of(read_machine(write_records(tmp_path, drive, runs, np.random.default_rng(11))), tmp_path)
    recorded, _ = read_recordings(case)
    assert any("may stick" in finding.message for finding in recorded.findings)
    assert not search_record(case, recorded, np.random.default_rng(1)).mismatch.found

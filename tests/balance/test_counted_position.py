"""Positions in counts of an encoder: the machine file says what one is, and counters that begin anew are counted on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance import wheel

from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.channel_values import _unwrapped
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.recording.findings import Findings, Severity
from pmg.sim.errors import BenchError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.signals import Array

PER_TURN = 20_000
FILE = """
schema = "pmg.machine/1"
title = "A counted wheel"
[shaft.wheel]
moves = "{moves}"
{encoder}
[shaft.wheel.channel]
position = {{ name = "x", unit = "{unit}"{sign} }}
{push} = {{ name = "T", unit = "{of}" }}
[records]
time = {{ name = "t", unit = "s" }}
rate_Hz = 500
low_pass_Hz = 40
keep_every = 8
"""
ENCODER = "[shaft.wheel.encoder]\n"
TURNS = {"moves": "turns", "push": "torque", "of": "N m", "sign": ""}


def motion(folder: Path, position: Array, words: dict[str, str]) -> Array:
    """Position [m, rad] as it is read from a recording of one in the unit of the machine file."""
    m = wheel.turning(np.random.default_rng(1), 20.0)
    folder.mkdir()
    rows = zip(m.t, position, wheel.plain(m), strict=True)
    table = "".join(f"{t:.4f},{x:.9g},{torque:.6f}\n" for t, x, torque in rows)
    (folder / "a.csv").write_text(f"t,x,T\n{table}", encoding="utf-8")
    (folder / "machine.toml").write_text(FILE.format(**words), encoding="utf-8")
    found, _ = read_recordings(case_of(read_machine(folder / "machine.toml"), folder / "a.csv"))
    return found.motion.position


def counts_of(angle: Array) -> Array:
    return np.asarray(np.floor(angle / REVOLUTION * PER_TURN))


@pytest.mark.parametrize("bits", [None, 16, 24])
def test_counts_give_the_angle_that_they_count(tmp_path: Path, bits: int | None) -> None:
    angle = wheel.turning(np.random.default_rng(1), 20.0).angle
    counted = counts_of(angle) if bits is None else counts_of(angle) % 2**bits
    words = {"unit": "count", "encoder": f'{ENCODER}counts_per_turn = {{ value = {PER_TURN}, unit = "1" }}'}
    found = motion(tmp_path / "counts", counted, TURNS | words)
    plain = motion(tmp_path / "rad", angle, TURNS | {"unit": "rad", "encoder": ""})
    whole = 0.0 if bits is None else float(np.round((found[0] - plain[0]) / (REVOLUTION / PER_TURN)))
    np.testing.assert_allclose(found - whole * REVOLUTION / PER_TURN, plain, atol=2.0 * REVOLUTION / PER_TURN)


def test_counts_that_begin_anew_at_the_index_are_not_taken_for_sixteen_bits(tmp_path: Path) -> None:
    per_turn = 72_000
    angle = wheel.turning(np.random.default_rng(1), 20.0).angle
    words = {"unit": "count", "encoder": f'{ENCODER}counts_per_turn = {{ value = {per_turn}, unit = "1" }}'}
    counted = np.floor(angle / REVOLUTION * per_turn) % per_turn
    found = motion(tmp_path / "counts", counted, TURNS | words)
    plain = motion(tmp_path / "rad", angle, TURNS | {"unit": "rad", "encoder": ""})
    whole = REVOLUTION * round((found[0] - plain[0]) / REVOLUTION)
    np.testing.assert_allclose(found - whole, plain, atol=1e-3)


def test_a_counter_that_is_read_too_seldom_is_told_and_a_real_step_stays() -> None:
    findings, position = Findings("a.csv"), np.asarray(np.arange(4000) * 40_000.0 % 2**16)
    assert _unwrapped(position, [2.0**16, 2.0**24], "x", findings) is position
    (told,) = findings.listed()
    assert (told.severity, told.where) == (Severity.WARNING, "x")
    assert "more than half of its range" in told.message
    moved = np.r_[np.arange(1000.0), 60_000.0 + np.arange(1000.0), np.arange(61_000.0, 200_000.0, 50.0)]
    assert _unwrapped(moved, [2.0**16, 2.0**24], "x", Findings("a.csv")) is moved


def test_counts_the_other_way_and_of_a_slide(tmp_path: Path) -> None:
    way = 0.01 * wheel.turning(np.random.default_rng(1), 20.0).angle
    slides = {"moves": "slides", "push": "force", "of": "N", "sign": ", sign = -1"}
    words = {"unit": "count", "encoder": f'{ENCODER}resolution = {{ value = 5, unit = "um" }}'}
    found = motion(tmp_path / "counts", np.floor(-way / 5e-6) % 2**24, slides | words)
    plain = motion(tmp_path / "m", way, slides | {"unit": "m", "encoder": "", "sign": ""})
    whole = float(np.round((found[0] - plain[0]) / 5e-6)) * 5e-6
    np.testing.assert_allclose(found - whole, plain, atol=1e-5)


def test_counts_without_their_encoder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError) as refused:
        motion(tmp_path / "a", np.zeros(10_000), TURNS | {"unit": "count", "encoder": ""})
    assert refused.value.where.endswith("shaft.wheel.channel.position.unit")
    assert "encoder.counts_per_turn" in refused.value.expected
    assert "without its encoder" in refused.value.came
    words = {"unit": "count", "encoder": f'{ENCODER}counts_per_turn = {{ value = 0, unit = "1" }}'}
    with pytest.raises(BenchError, match=r"shaft\.wheel\.encoder\.counts_per_turn\.value: 0; expected a number above"):
        motion(tmp_path / "b", np.zeros(10_000), TURNS | words)

"""Spikes of a torque in motion: told from impacts, load steps, noise, waves and rattle, at every rate."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.motion.moving_bench import COUNT, Floats

from pmg.pipeline.motion.faults import SPIKE_RATE, spikes, stand_outs

INERTIA, NOISE, SECONDS = 1.08e-3, 0.01, 4.0
"""Of the motor [kg m2]; of the torque [N m]; length of a record [s]."""
RATES = [500.0, 1000.0, 5000.0]
IMPULSE = 4e-3
"""Of a spike [N m s]."""


def record(rate: float, pulses: dict[int, float], *, felt: float, slope: float = 20.0) -> tuple[Floats, Floats]:
    """Torque and counted angle with impulses [N m s] at some samples, of which the motor feels a part."""
    time = np.arange(round(SECONDS * rate)) / rate
    torque = 0.05 * np.sin(3.0 * time) + NOISE * np.random.default_rng(3).standard_normal(len(time))
    speed = 30.0 + slope * time
    for at, impulse in pulses.items():
        torque[at] += impulse * rate
        speed[at:] -= felt * impulse / INERTIA
    return torque, np.floor(np.cumsum(speed) / rate / COUNT) * COUNT


def places(rate: float) -> list[int]:
    """Samples far from each other and from the ends."""
    return [round(t * rate) for t in (0.4, 0.9, 1.7, 2.6, 3.3)]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("slope", [-50.0, 0.0, 50.0])
def test_an_impulse_that_the_motor_does_not_feel_is_a_spike_and_one_that_it_feels_is_not(
    rate: float, sign: float, slope: float
) -> None:
    pulses = dict.fromkeys(places(rate), sign * IMPULSE)
    found = spikes(*record(rate, pulses, felt=0.0, slope=slope), rate, INERTIA, COUNT)
    assert found[:, 0].tolist() == list(pulses)
    assert (found[:, 1] - found[:, 0] == 1).all()
    for felt in (0.3, 1.0, -0.3):  # over within a sample, a torque of the shaft, one of the motor
        assert not len(spikes(*record(rate, pulses, felt=felt, slope=slope), rate, INERTIA, COUNT))


def test_a_spike_of_three_samples_is_found_whole_and_a_longer_one_is_left() -> None:
    rate, (at, *_) = 1000.0, places(1000.0)
    for n in (2, 3, 4, 12):
        torque, angle = record(rate, dict.fromkeys(range(at, at + n), IMPULSE), felt=0.0)
        assert spikes(torque, angle, rate, INERTIA, COUNT).tolist() == ([[at, at + n]] if n <= 3 else [])


def test_what_an_encoder_could_not_show_is_left() -> None:
    torque, angle = record(1000.0, dict.fromkeys(places(1000.0), 0.2 * IMPULSE), felt=0.0)
    assert not len(spikes(torque, angle, 1000.0, INERTIA, COUNT))
    assert len(stand_outs(torque, 1000.0)) == len(places(1000.0))


@pytest.mark.parametrize("apart", [4, 7, 15, 30])
def test_rattle_of_play_is_left(apart: int) -> None:
    """Contacts of both signs: the mean speed before and after each of them is the same."""
    contacts = {600 + apart * k: (-1.0) ** k * IMPULSE for k in range(40)}
    assert not len(stand_outs(record(1000.0, contacts, felt=1.0)[0], 1000.0))


def test_nothing_is_said_beside_unknown_samples_at_the_ends_or_of_a_slow_recorder() -> None:
    rate = 1000.0
    torque, angle = record(rate, dict.fromkeys((5, 1000, 2000, 3990), IMPULSE), felt=0.0)
    assert spikes(torque, angle, rate, INERTIA, COUNT)[:, 0].tolist() == [1000, 2000]
    lost = torque.copy()
    lost[1010:1030] = np.nan
    assert spikes(lost, angle, rate, INERTIA, COUNT)[:, 0].tolist() == [2000]
    lost = angle.copy()
    lost[1990:1995] = np.nan
    assert spikes(torque, lost, rate, INERTIA, COUNT)[:, 0].tolist() == [1000]
    slow = 0.9 * SPIKE_RATE
    assert not len(spikes(*record(slow, {800: IMPULSE}, felt=0.0), slow, INERTIA, COUNT))
    assert not len(stand_outs(np.full(400, np.nan), rate))


@given(
    noise=st.floats(1e-4, 1.0),
    step=st.sampled_from([0.0, 1e-3, 0.05, 0.5]),
    turn=st.floats(0.5, 400.0),
    load=st.floats(0.0, 3.0),
    seed=st.integers(0, 1000),
)
@settings(max_examples=60, deadline=None)
def test_noise_steps_waves_and_loads_of_a_torque_are_no_spikes(
    noise: float, step: float, turn: float, load: float, seed: int
) -> None:
    """Not even of a shaft at rest."""
    rate = 1000.0
    time = np.arange(3000) / rate
    random = noise * np.random.default_rng(seed).standard_normal(len(time))
    torque: Floats = np.sin(2.0 * np.pi * turn * time) + load * (time > 1.5) + random
    if step:
        torque = np.round(torque / step) * step
    assert not len(stand_outs(torque, rate))

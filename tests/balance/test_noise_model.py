"""The noise of a record: its spectrum where structure was taken out, and what is noise in an acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.mismatch import find_mismatch
from pmg.pipeline.diagnosis.balance.noise_model import Bands, noise_of
from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.fit.structure import ResidualStructure
from pmg.pipeline.machine.channel import PrepareTable

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

ROWS = 1000


def _waves(first: int, last: int) -> Array:
    """Cosines of some numbers of half-waves."""
    return np.cos(np.pi * np.arange(first, last + 1) * np.linspace(0.0, 1.0, ROWS)[:, None])


def test_power_that_columns_take_along_is_made_up_for(rng: np.random.Generator) -> None:
    basis = orthonormal(np.c_[_waves(0, 60), rng.standard_normal((ROWS, 40))])
    bands = Bands.of(basis)
    white = rng.standard_normal((ROWS, 200))
    powers = np.stack([bands.power(column - basis @ (basis.T @ column)) for column in white.T])
    assert bands.free.sum() == pytest.approx(ROWS / 2 - 50, abs=3)
    assert powers.mean(axis=0) == pytest.approx(1.0, abs=0.06)


def _coloured(rng: np.random.Generator) -> Array:
    """Noise of a speed, differentiated and low-passed: little power at low frequencies, none at high ones."""
    poles = np.poly([0.6 + 0.3j, 0.6 - 0.3j, 0.5])
    return np.asarray(lfilter([1.0, 0.3], poles.real, rng.standard_normal(ROWS + 200))[200:])


def _red(rng: np.random.Generator) -> Array:
    """Noise that lasts for some rows, beside noise of single ones."""
    lasting = lfilter([1.0], [1.0, -0.7], rng.standard_normal(ROWS + 200))[200:]
    return np.asarray(lasting + 0.8 * rng.standard_normal(ROWS))


def _none(rng: np.random.Generator) -> Array:
    """No row has noise of its own."""
    del rng
    return np.zeros(ROWS)


def _sticking(rng: np.random.Generator) -> Array:
    """What may hold a machine in every other stretch of some rows, far beyond all noise."""
    ends = np.cumsum(rng.integers(12, 45, size=ROWS // 12))
    return np.where(np.searchsorted(ends, np.arange(ROWS)) % 2 == 1, 30.0, 0.0)


@pytest.mark.parametrize(
    ("noise", "of_own", "records", "most"),
    [
        (_coloured, _none, 120, 12),
        (_red, _sticking, 20, 4),
        pytest.param(_red, _sticking, 200, 18, marks=slow),
        pytest.param(_coloured, _sticking, 200, 18, marks=slow),
    ],
)
def test_a_test_of_five_percent_alarms_in_five_percent_of_coloured_records(
    noise: Callable[[np.random.Generator], Array],
    of_own: Callable[[np.random.Generator], Array],
    records: int,
    most: int,
) -> None:
    """As many or fewer come in 99 % of such tests at a rate of 5 %."""
    baseline, slow, fine = np.ones((ROWS, 1)), _waves(1, 8)[:, ::2], _waves(9, 60)[:, ::2]
    families = tuple(ResidualStructure("force", "all", (name,), c) for name, c in (("slow", slow), ("fine", fine)))
    found = 0
    for seed in range(records):
        rng = np.random.default_rng(seed)
        force = noise(rng)
        model = noise_of(force, np.hstack([baseline, slow, fine]), own=of_own(rng))
        white = model.noise.whiten
        basis = orthonormal(white(baseline))
        left = white(force)
        rows = (np.ones(len(left), dtype=np.bool_),)
        columns = [white(family.columns) for family in families]
        null = model.whitened_draws(100, rng)
        found += find_mismatch(Evidence(left, basis, columns, rows, null), families).found
    assert 1 <= found <= most


def test_noise_of_a_position_is_taken_out_of_an_acceleration_and_motion_is_not(rng: np.random.Generator) -> None:
    smoother = Smoother(PrepareTable.model_validate({"rate_Hz": 1000.0, "low_pass_Hz": 50.0}), 1e-3)
    time = 1e-3 * np.arange(20_000)
    position = 0.1 * np.sin(9.0 * time)
    noise = 1e-5 * rng.standard_normal(len(time))
    _, speed, deviations = smoother.moved(position + noise, None)
    inner = slice(500, -500)
    moved, whole = -8.1 * np.sin(9.0 * time)[inner], smoother.slope(speed)[inner]
    noisy = smoother.noise_in(whole, deviations[1], of_position=True)
    assert np.std(whole - moved) == pytest.approx(deviations[1], rel=0.1)
    assert np.std(whole - moved - noisy) < 0.25 * deviations[1]
    assert np.std(noisy - (whole - moved)) < 0.01 * np.std(moved)


@pytest.mark.parametrize("part", [0.0, 0.5])
def test_what_rows_have_of_their_own_is_told_as_part_of_its_bound(part: float) -> None:
    structure = np.c_[np.ones(ROWS), _waves(1, 20)]
    shares = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        own = _sticking(rng) / 5.0
        force = _red(rng) + part * own * rng.standard_normal(ROWS)
        found = noise_of(force, structure, own=own)
        shares.append(float(found.own.max()) / float(own.max()))
    assert float(np.mean(shares)) == pytest.approx(part, abs=0.12)


def test_rows_all_of_which_have_noise_of_their_own_have_a_noise(rng: np.random.Generator) -> None:
    found = noise_of(_red(rng), np.ones((ROWS, 1)), own=2.0 + 2.0 * np.abs(np.sin(np.arange(ROWS) / 40.0)))
    assert np.isfinite(found.whitened_draws(3, rng)).all()

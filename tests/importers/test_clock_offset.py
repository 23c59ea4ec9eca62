"""The offset between two clocks is found with its error, by signals of any colour, sign and rate; chance is refused."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfilt

from pmg.pipeline.importers.clocks.clock_offset import Offset, offset_between
from pmg.sim.errors import RecordingError

Array = npt.NDArray[np.float64]
Pair = tuple[tuple[Array, Array], tuple[Array, Array]]
RATE = 1000.0
N = 4000
DRAWS = 50


def coloured(rng: np.random.Generator, count: int, corner: float, order: int = 1) -> Array:
    """Noise below a corner [Nyquist frequency], with a standard deviation of one."""
    values = sosfilt(butter(order, corner, output="sos"), rng.normal(size=count + 2000))[2000:]
    return np.asarray(values / values.std())


def planted(
    rng: np.random.Generator,
    offset: float,
    *,
    noise: float = 0.3,
    colour: float = 0.1,
    factor: float = 1.0,
    drift: float = 0.0,
    gain: float = -2.0,
) -> Pair:
    """Two recordings of one random signal, the second on a clock of its own and at another rate."""
    dense = make_interp_spline(np.arange(7 * N) / (4.0 * RATE), coloured(rng, 7 * N, 0.006, 2), k=5)
    first = 0.3 + np.arange(N) / RATE
    second = first[0] + np.arange(int(N * factor)) / (RATE * factor)
    true = second + offset + drift * (second - 2.0)
    ours = dense(first) + noise * coloured(rng, N, colour)
    theirs = gain * (dense(true) + noise * coloured(rng, len(second), min(colour / factor, 0.9)))
    return (first, ours), (second, theirs)


def miss(found: Offset, offset: float, drift: float = 0.0) -> tuple[float, float]:
    """How far offset and drift are from the truth, in standard errors."""
    truth = offset + drift * (found.at - 2.0)
    return (found.offset - truth) / found.offset_error, (found.drift - drift) / found.drift_error


@settings(max_examples=10)
@given(
    offset=st.floats(-0.2, 0.9),
    factor=st.sampled_from([0.5, 1.0, 2.5]),
    gain=st.sampled_from([-30.0, -1.0, 0.01]),
    seed=st.integers(0, 99),
)
def test_a_planted_offset_is_found_well_below_a_sample(offset: float, factor: float, gain: float, seed: int) -> None:
    found = offset_between(*planted(np.random.default_rng(seed), offset, noise=0.05, factor=factor, gain=gain))
    assert abs(miss(found, offset)[0]) < 5.0
    assert found.offset_error < 0.2 / RATE
    assert np.sign(found.correlation) == np.sign(gain)
    assert abs(found.correlation) > 0.98
    assert found.margin > 0.1
    assert found.others == ()


@pytest.mark.parametrize(
    "case",
    [{}, {"noise": 1.0}, {"colour": 0.01}, {"factor": 2.5}, {"drift": 3e-4}],
    ids=["plain", "much noise", "slow noise", "two rates", "drift"],
)
def test_the_interval_covers(case: dict[str, float]) -> None:
    """Of `DRAWS` intervals of 95 %, less than 84 % cover in 1 of 500 tests of a right error."""
    rng = np.random.default_rng(11)
    drift = case.get("drift", 0.0)
    offsets = rng.uniform(-0.2, 0.9, DRAWS)
    misses = np.array([miss(offset_between(*planted(rng, offset, **case)), offset, drift) for offset in offsets])
    covered = (np.abs(misses) < 1.96).mean(axis=0)
    assert (covered >= 0.84).all()
    assert (np.abs(np.median(misses, axis=0)) < 0.6).all()
    assert (np.sqrt((misses**2).mean(axis=0)) > 0.7).all()  # nor are the errors too large


def test_exchanged_recordings_have_the_opposite_offset(rng: np.random.Generator) -> None:
    first, second = planted(rng, 0.25)
    there, back = offset_between(first, second), offset_between(second, first)
    at_once = there.offset + there.drift * (back.at - there.offset - there.at)
    assert back.offset == pytest.approx(-at_once, abs=2.0 * there.offset_error)
    assert back.offset_error == pytest.approx(there.offset_error, rel=0.3)
    assert back.correlation == pytest.approx(there.correlation, abs=0.02)


@settings(max_examples=5)
@given(shift=st.floats(-1e6, 1e6), scale=st.sampled_from([1e-6, 1.0, 1e6]), level=st.floats(-10.0, 10.0))
def test_a_clock_set_elsewhere_moves_the_offset_alone(shift: float, scale: float, level: float) -> None:
    (time, values), second = planted(np.random.default_rng(5), 0.25)
    plain = offset_between((time, values), second)
    moved = offset_between((time + shift, scale * (values + level)), second)
    assert moved.offset - shift == pytest.approx(plain.offset, abs=0.02 * plain.offset_error + 1e-9)
    assert moved.correlation == pytest.approx(plain.correlation, abs=2e-4)


def test_drift_is_found_over_a_long_recording(rng: np.random.Generator) -> None:
    values = coloured(rng, 60_000, 0.05, 2)
    spline = make_interp_spline(np.arange(60_000) / RATE, values, k=5)
    time = np.arange(40_000) / RATE
    found = offset_between((np.arange(60_000) / RATE, values), (time, spline(1.001 * time + 7.0)))
    assert found.drift == pytest.approx(1e-3, abs=1e-7)
    assert found.offset == pytest.approx(7.0 + 1e-3 * found.at, abs=1e-6)


def test_a_signal_that_repeats_has_other_offsets(rng: np.random.Generator) -> None:
    time = np.arange(N) / RATE
    first = np.sin(2 * np.pi * 5 * time) + 0.05 * rng.normal(size=N)
    second = np.sin(2 * np.pi * 5 * (time + 0.013)) + 0.05 * rng.normal(size=N)
    found = offset_between((time, first), (time, second))
    assert found.margin < 0.01
    for other in (found.offset, *found.others):
        assert abs((other - 0.013 + 0.05) % 0.1 - 0.05) < 0.004
    assert len(found.others) > 5
    near = offset_between((time, first), (time, second), largest_s=0.04)
    assert near.others == ()
    assert near.offset == pytest.approx(0.013, abs=5 * near.offset_error)


def test_a_profile_of_speed_that_comes_once_is_enough(rng: np.random.Generator) -> None:
    def ramp(time: Array) -> Array:
        return np.clip((time - 1.0) * 2.0, 0.0, 1.0) - np.clip((time - 3.0) * 1.2, 0.0, 1.0)

    time = np.arange(N) / RATE
    noise = 0.01 * rng.normal(size=(2, N))
    found = offset_between((time, ramp(time) + noise[0]), (time, ramp(time + 0.0313) + noise[1]))
    assert found.offset + found.drift * (2.0 - found.at) == pytest.approx(0.0313, abs=5 * found.offset_error)


def test_an_offset_beyond_the_largest_is_not_taken(rng: np.random.Generator) -> None:
    pair = planted(rng, 0.5)
    assert offset_between(*pair, largest_s=0.6).offset == pytest.approx(0.5, abs=0.01)
    with pytest.raises(RecordingError, match="beyond chance"):
        offset_between(*pair, largest_s=0.2)
    with pytest.raises(RecordingError, match="Allow a larger offset"):
        offset_between((pair[0][0] + 100.0, pair[0][1]), pair[1], largest_s=1.0)


@pytest.mark.parametrize("corner", [0.3, 0.02, 0.003])
def test_signals_with_nothing_in_common_are_refused(corner: float) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(2000) / RATE
    passed = 0
    for _ in range(12):
        try:
            offset_between((time, coloured(rng, 2000, corner)), (time, coloured(rng, 2000, corner)))
        except RecordingError as error:
            if "independent samples reach by chance" not in str(error):
                raise
        else:
            passed += 1
    assert passed <= 1


def test_what_cannot_be_compared_is_refused(rng: np.random.Generator) -> None:
    good = planted(rng, 0.1)[0]
    time, values = good
    for bad, text in (
        ((time[:10], values[:10]), "10 times and 10 values"),
        ((time, values[:-1]), "4000 times and 3999 values"),
        ((time, np.where(time > 1.0, np.nan, values)), "no numbers"),
        ((time[::-1], values), "do not grow"),
        ((time**2, values), "sampled unevenly"),
        ((time, np.ones(N)), "the same value throughout"),
    ):
        for pair in ((good, bad), (bad, good)):
            with pytest.raises(RecordingError, match=text):
                offset_between(*pair)

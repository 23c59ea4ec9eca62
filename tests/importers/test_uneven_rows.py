"""Rows at uneven times, or times that begin anew, come onto the sample clock by these; what cannot is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.recording.read import read_recording
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION, RPM

from . import written

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.importers.import_recording import Imported
    from pmg.pipeline.recording.read import Recording

N = 3000
SPEED = 600.0 * RPM
COUNT = REVOLUTION / 5120
"""One count of the sun's encoder [rad]."""
CHANNELS = (
    written.channel("/daq/torque_sun/frequency", "torque", unit="N m")
    + written.channel("/daq/encoder_sun/count", "count", bits=16)
    + written.channel("/daq/encoder_ring/count", "angle", unit="mrad", wraps_at=1000 * REVOLUTION)
)


def torque(t: written.Array) -> written.Array:
    return 2.0 + 0.5 * np.sin(REVOLUTION * 9.0 * t)


def taken_at(t: written.Array) -> dict[str, written.Array]:
    """What a bench shows at these times: a counter and an angle that begin anew within them."""
    angle = SPEED * t
    return {
        "torque": torque(t),
        "count": np.floor(angle / COUNT) % 2.0**16,
        "angle": 1000.0 * (angle % REVOLUTION),
    }


def brought(
    folder: Path, stamps: written.Array, signals: dict[str, written.Array], end: str
) -> tuple[Imported, Recording]:
    source = folder / f"E1.{end}"
    if end == "mf4":
        from asammdf import MDF, Signal

        with MDF() as file:
            file.append([Signal(values, stamps, name=name) for name, values in signals.items()], common_timebase=True)
            file.save(source, overwrite=True)
    else:
        pl.DataFrame({"t": stamps, **signals}).write_parquet(source)
    time = "" if end == "mf4" else "source = 't'"
    chart = read_map(written.write_map(folder, written.map_text(CHANNELS, time)))
    done = import_recording(source, chart, folder / "a.mcap")
    return done, read_recording(done.out)


@pytest.mark.parametrize("end", ["parquet", "mf4"])
@pytest.mark.parametrize("reading", ["taken", "stamped late"])
def test_the_signals_decide_whether_uneven_rows_are_resampled(
    tmp_path: Path, rng: np.random.Generator, end: str, reading: str
) -> None:
    even = np.arange(N) / written.RATE
    late = np.sort(even + rng.uniform(0.0, 0.8, N) / written.RATE)
    done, found = brought(tmp_path, late, taken_at(late if reading == "taken" else even), end)
    told = next(f.message for f in done.findings if "scatter" in f.message)
    assert ("resampled by a cubic spline" if reading == "taken" else "times were stamped late") in told
    assert done.rate_hz == pytest.approx(written.RATE, rel=1e-5)
    assert done.rows == N
    samples = found.samples[5:-5]
    t = samples["torque_sun"].to_numpy()
    start = late[0] if reading == "taken" else 0.0
    at = start + np.arange(len(found.samples))[5:-5] / done.rate_hz
    np.testing.assert_allclose(t, torque(at), atol=2e-3)
    for side, size in (("sun", COUNT), ("ring", REVOLUTION / 4096)):
        angle = samples[f"angle_{side}"].to_numpy()
        assert np.ptp(angle - SPEED * at) < 3.0 * size, "counts and angles go on where they begin anew"


@pytest.mark.parametrize(("wrap", "start"), [(60.0, 57.3), (2**16 * 1e-3, 62.0)])
def test_seconds_that_begin_anew_are_counted_on_and_told(tmp_path: Path, wrap: float, start: float) -> None:
    even = np.arange(N) / written.RATE
    sound, whole = brought(tmp_path, even, taken_at(even), "parquet")
    done, found = brought(tmp_path, (start + even) % wrap, taken_at(even), "parquet")
    assert sum("it begins anew 1 time" in f.message for f in done.findings) == 1
    assert (done.rate_hz, done.written) == (sound.rate_hz, sound.written)
    assert_frame_equal(found.samples, whole.samples, abs_tol=2.0 * COUNT)


def test_even_rows_are_not_resampled_and_out_of_order_is_refused(tmp_path: Path) -> None:
    even = np.arange(N) / written.RATE
    done, _ = brought(tmp_path, even, taken_at(even), "parquet")
    assert not any("scatter" in f.message for f in done.findings)
    order = np.r_[0:100, 105:99:-1, 106:N]
    with pytest.raises(RecordingError, match="out of order"):
        brought(tmp_path, even[order], taken_at(even[order]), "parquet")


def test_edges_are_counted_on_and_not_resampled(tmp_path: Path, rng: np.random.Generator) -> None:
    channels = written.channel("/daq/torque_sun/edges", "e") + written.channel(
        "/daq/torque_ring/frequency", "f", unit="Hz"
    )
    chart = read_map(written.write_map(tmp_path, written.map_text(channels, "source = 't'")))
    even = np.arange(N) / written.RATE
    late = even + rng.uniform(0.0, 0.8, N) / written.RATE
    frequency = 10_000.0 + 100.0 * torque(late)
    for name, stamps in (("wrapped", (even + 57.3) % 60.0), ("uneven", late)):
        table = pl.DataFrame({"t": stamps, "e": np.floor(1e4 * late), "f": frequency})
        table.write_parquet(tmp_path / f"{name}.parquet")
    done = import_recording(tmp_path / "wrapped.parquet", chart, tmp_path / "a.mcap")
    assert set(done.written.values()) == {N}
    with pytest.raises(RecordingError, match=r"edges: rows at uneven times.*rate_Hz in \[time\]"):
        import_recording(tmp_path / "uneven.parquet", chart, tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()

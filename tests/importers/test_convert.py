"""What a channel becomes: counters keep their width, angles and speeds become counts, torques the right frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.importers.channel_map import Mapped
from pmg.pipeline.importers.convert import Conversion
from pmg.pipeline.recording.findings import Code, Findings
from pmg.sim.errors import BenchError, RecordingError
from pmg.sim.signals import REVOLUTION, RPM

from . import written

COUNT = "/daq/encoder_sun/count"
RING = "/daq/torque_ring/frequency"


def conversion(topic: str, unit: str, **more: Any) -> Conversion:  # noqa: ANN401 - whatever the map may say
    mapped = Mapped.model_construct(topic=topic, source="x", unit=unit, **more)
    return Conversion(mapped, "", written.CALIBRATION, "map", "x", "line", Findings("a.csv"))


def samples(made: Conversion, values: npt.ArrayLike, parts: int = 1, rate: float = 500.0) -> npt.NDArray[Any]:
    column = np.asarray(values)
    rows = np.arange(len(column))
    pieces = [np.array_split(array, parts) for array in (column, rows)]
    return np.concatenate([made.samples(v, i, i + 2, rate)[1] for v, i in zip(*pieces, strict=True) if len(i)])


@given(torque=st.lists(st.floats(-12, 12), min_size=1, max_size=20), sign=st.sampled_from([1, -1]))
def test_a_torque_comes_back_from_its_frequency(torque: list[float], sign: int) -> None:
    for unit, scale in (("N m", 1.0), ("mN m", 1e-3)):
        found = samples(conversion(RING, unit, sign=sign), np.array(torque) / scale)
        np.testing.assert_allclose(written.CALIBRATION.ring.torque(found), sign * np.array(torque), atol=1e-9)


@given(zero=st.floats(-2, 2), slope=st.floats(0.01, 5).map(lambda x: round(x, 3)), volts=st.floats(-10, 10))
def test_a_voltage_is_a_torque_above_its_zero(zero: float, slope: float, volts: float) -> None:
    found = samples(conversion(RING, "V", Nm_per_unit=slope, zero=zero), [volts])
    assert written.CALIBRATION.ring.torque(found)[0] == pytest.approx((volts - zero) * slope, abs=1e-9)


@given(
    start=st.floats(-1e4, 1e4),
    rpm=st.floats(-3000, 3000),
    parts=st.integers(1, 5),
    kind=st.sampled_from(["rad", "deg", "rev", "wrapped", "rpm"]),
)
def test_angles_and_speeds_become_counts_to_within_one(start: float, rpm: float, parts: int, kind: str) -> None:
    angle = start + rpm * RPM * np.arange(400) / 500.0
    if kind == "rpm":
        found = samples(conversion(COUNT, "rpm"), np.full(400, rpm), parts)
    elif kind == "wrapped":
        found = samples(conversion(COUNT, "deg", wraps_at=360.0), np.degrees(angle) % 360.0, parts)
    else:
        scale = {"rad": 1.0, "deg": REVOLUTION / 360.0, "rev": REVOLUTION}[kind]
        found = samples(conversion(COUNT, kind), angle / scale, parts)
    steps = (np.diff(found) + 2**31) % 2**32 - 2**31
    gained = np.concatenate(([0], np.cumsum(steps))) * REVOLUTION / 5120
    assert np.abs(gained - (angle - angle[0])).max() <= 1.001 * REVOLUTION / 5120


@given(bits=st.integers(2, 32), start=st.integers(0, 2**32 - 1), step=st.integers(-5, 5))
def test_a_counter_keeps_its_width_and_its_value_however_it_is_signed(bits: int, start: int, step: int) -> None:
    whole = (start + step * np.arange(50)) % 2**bits
    signed = np.where(whole >= 2 ** (bits - 1), whole - 2**bits, whole)
    for values in (whole, signed, signed.astype(np.float64)):
        made = conversion(COUNT, "1", bits=bits)
        assert samples(made, values, 3).tolist() == whole.tolist()
        assert made.metadata(500.0)["bits"] == str(bits)
    turned = samples(conversion(COUNT, "1", bits=bits, sign=-1), whole)
    assert ((turned + whole) % 2**bits == 0).all()


def test_a_counter_wider_than_the_layout_is_cut_to_32_bits() -> None:
    made = conversion(COUNT, "1", bits=48)
    assert samples(made, [2**40 + 7, -1]).tolist() == [7, 2**32 - 1]
    assert made.metadata(500.0)["bits"] == "32"


@pytest.mark.parametrize("value", [0.5, 256, -129, 1e30])
def test_what_is_no_count_of_its_width_is_refused_with_its_place(value: float) -> None:
    with pytest.raises(RecordingError, match=r"x, line 4: .* 8 bits"):
        samples(conversion(COUNT, "1", bits=8), [1.0, 2.0, value])


def test_missing_values_are_left_out_and_told_once() -> None:
    made = conversion(RING, "Hz")
    index, values = made.samples(np.array([1.0, np.nan, np.inf, 4.0]), np.arange(4), np.arange(4) + 2, 500.0)
    assert (index.tolist(), values.tolist()) == ([0, 3], [1.0, 4.0])
    made.samples(np.array([np.nan]), np.array([4]), np.array([6]), 500.0)
    made.finish()
    (told,) = made.findings.listed()
    assert told.code is Code.NOT_FINITE
    assert told.message.startswith("3 values")
    assert told.where.endswith("line 3")


def test_a_speed_is_added_up_over_a_gap_too() -> None:
    made = conversion(COUNT, "rpm")
    rows = np.concatenate((np.arange(100), np.arange(200, 300)))
    _, counts = made.samples(np.full(200, 600.0), rows, rows, 500.0)
    assert counts[-1] == pytest.approx(600 / 60 * 299 / 500 * 5120, abs=1)


@pytest.mark.parametrize(
    ("topic", "more"),
    [(RING, {"unit": "Hz", "sign": -1}), (RING, {"unit": "V"}), (RING, {"unit": ""}), (COUNT, {"unit": "Hz"})],
)
def test_a_channel_that_cannot_be_made_is_refused(topic: str, more: dict[str, Any]) -> None:
    with pytest.raises(BenchError):
        conversion(topic, **more)


def test_units_of_the_file_are_taken_where_the_map_names_none() -> None:
    mapped = Mapped(topic=RING, source="x")
    made = Conversion(mapped, " Nm ", written.CALIBRATION, "map", "x", "line", Findings("a.csv"))
    assert (made.unit, made.kind) == ("N m", "torque")
    wrong = mapped.model_copy(update={"unit": "Hz"})
    with pytest.raises(BenchError, match="one unit"):
        Conversion(wrong, "Nm", written.CALIBRATION, "map", "x", "line", Findings("a.csv"))

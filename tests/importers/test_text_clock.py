"""Times written as text: as seconds since the first, over midnight, with zones; and a file that has them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.importers.clocks.text_clock import clock_of
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.importers.csv_source import CsvSource
from pmg.pipeline.importers.source import Wanted
from pmg.pipeline.recording.findings import Findings
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

zones = st.integers(-14 * 4, 14 * 4).map(lambda quarters: timezone(timedelta(minutes=15 * quarters)))
moments = st.datetimes(datetime(1975, 1, 1), datetime(2100, 1, 1))


@given(moments, zones, st.floats(0.0, 1e5), st.sampled_from("T "))
def test_a_date_with_a_zone_is_a_moment(moment: datetime, zone: timezone, later: float, between: str) -> None:
    first = moment.replace(tzinfo=zone)
    clock = clock_of(first.isoformat(between))
    assert clock is not None
    assert clock.began == first.astimezone(UTC)
    then = first + timedelta(seconds=later)
    assert clock.seconds(then.isoformat(between)) == pytest.approx((then - first).total_seconds(), abs=1e-6)
    elsewhere = then.astimezone(UTC).isoformat().replace("+00:00", "Z")
    assert clock.seconds(elsewhere) == pytest.approx((then - first).total_seconds(), abs=1e-6)


@given(st.integers(0, 86_399_999), st.lists(st.integers(0, 43_000_000), min_size=1, max_size=8))
def test_a_time_of_day_goes_on_after_midnight(first: int, steps: list[int]) -> None:
    def written(milliseconds: int) -> str:
        second, part = divmod(milliseconds % 86_400_000, 1000)
        return f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d},{part:03d}"

    clock = clock_of(written(first))
    assert clock is not None
    assert clock.began is None
    for _ in range(2):
        clock.restart()
        at = np.cumsum(steps)
        found = [clock.seconds(written(first + int(each))) for each in at]
        np.testing.assert_allclose(found, at / 1000.0, atol=1e-9)


def test_a_date_with_points_has_its_day_first() -> None:
    clock = clock_of("03.11.2025 23:59:59,5")
    assert clock is not None
    assert clock.seconds("04.11.2025 00:00:00,25") == pytest.approx(0.75, abs=1e-6)
    assert clock.began is None, "the zone is not written"


@pytest.mark.parametrize(
    "cell", ["", "1.5", "12:60:00", "24:00:00", "12:00", "2025-02-30T10:00:00", "31.02.2025 1:00:00", "x"]
)
def test_what_is_no_time_makes_no_clock(cell: str) -> None:
    assert clock_of(cell) is None


@pytest.mark.parametrize("cell", ["0.5", "2025-11-28T09:10:00Z", "9:10"])
def test_a_cell_of_another_form_is_refused(cell: str) -> None:
    clock = clock_of("09:10:00")
    assert clock is not None
    with pytest.raises(ValueError, match=cell):
        clock.seconds(cell)


def source(folder: Path, text: str, bad_rows: int = 0) -> CsvSource:
    path = folder / "a.csv"
    path.write_text(text, encoding="utf-8")
    return CsvSource(path, CsvForm(bad_rows=bad_rows), Findings("a.csv"))


def values(found: CsvSource, *names: str) -> list[list[float]]:
    wanted = [Wanted(name) for name in names]
    blocks = list(found.blocks(wanted))
    return [np.concatenate([block.columns[want] for block in blocks]).tolist() for want in wanted]


def test_a_file_with_moments_gives_seconds_and_its_start(tmp_path: Path) -> None:
    rows = "".join(f"2025-11-28T09:10:0{k}.5+01:00,{k}.25\n" for k in range(4))
    found = source(tmp_path, f"time,pos [deg]\n{rows}")
    assert [(each.name, each.unit) for each in found.channels] == [("time", "s"), ("pos", "deg")]
    assert found.started_at == datetime(2025, 11, 28, 8, 10, 0, 500000, tzinfo=UTC)
    for _ in range(2):
        time, position = values(found, "time", "pos")
        np.testing.assert_allclose(time, [0.0, 1.0, 2.0, 3.0], atol=1e-6)
        assert position == [0.25, 1.25, 2.25, 3.25]


def test_a_time_that_cannot_be_read_is_told_with_line_and_form(tmp_path: Path) -> None:
    found = source(tmp_path, "Uhrzeit;F [N]\n14:03:00,000;1,5\n14:03:xx;2,5\n")
    with pytest.raises(RecordingError, match=r"line 3, column 'Uhrzeit'.*14:03:xx.*a time such as"):
        values(found, "Uhrzeit", "F")


def test_rows_with_a_bad_time_may_be_gaps(tmp_path: Path) -> None:
    found = source(tmp_path, "Uhrzeit;F [N]\n14:03:00,000;1,5\nnone;2,5\n14:03:02,000;3,5\n", bad_rows=1)
    time, force = values(found, "Uhrzeit", "F")
    np.testing.assert_allclose(time, [0.0, np.nan, 2.0], atol=1e-9)
    assert force == [1.5, 2.5, 3.5]


def test_a_row_without_its_time_is_told_where_the_time_stands_last(tmp_path: Path) -> None:
    found = source(tmp_path, "F [N];Uhrzeit\n1,5;14:03:00,000\n2,5\n3,5;14:03:02,000\n", bad_rows=1)
    _, time = values(found, "F", "Uhrzeit")
    np.testing.assert_allclose(time, [0.0, np.nan, 2.0], atol=1e-9)
    (told,) = found.findings.listed()
    assert told.where.startswith("line 3")
    assert "1 cell; expected 2 cells" in told.message

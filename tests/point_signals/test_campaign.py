"""The signals behind the points of a campaign: from its recordings to what a page unpacks."""

from __future__ import annotations

import base64
import json
import math
import re
import shutil
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from tests.recording.writer import Bench, write

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.fit.budget import Budget, budget_of
from pmg.pipeline.grid.campaign import choose_campaign, measured_grid
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.grid.window_facts import window_facts
from pmg.pipeline.point_signals import encoded as contract
from pmg.pipeline.point_signals.campaign import NO_NUMBER, CampaignSignals, campaign_signals
from pmg.pipeline.point_signals.cell import CellSignals
from pmg.pipeline.point_signals.encoded import Encoded, encode
from pmg.pipeline.point_signals.quantised import UNKNOWN, Numbers
from pmg.pipeline.store.store import Store
from pmg.sim.bench import load_bench
from pmg.sim.errors import GridError, StoreError
from pmg.sim.grid import Grid
from pmg.sim.signals import RPM, Array

BENCH = load_bench()
STEPS: tuple[tuple[int, str, str, dict[str, float]], ...] = (
    (0, "A", "START", {}),
    (500, "A", "MEASURE", {"sun_speed_set_rpm": 600.0, "ring_speed_set_rpm": -230.0}),
    (2500, "A", "END", {}),
)
FILES = {
    "0.mcap": Bench(6.0, steps=STEPS, ripple=0.2, run={"point": None}),
    "1.mcap": Bench(4.0, ripple=0.2, run={"point": "B", "started_at": "2025-04-23T09:00:00Z"}),
    "2.mcap": Bench(4.0, run={"point": "B", "started_at": "2025-04-23T10:00:00Z"}, torque={"sun": 0.9, "ring": -1.5}),
    "3.mcap": Bench(4.0, lines=(900, 950), run={"point": "C", "started_at": "2025-04-23T11:00:00Z"}),
}
"""A sequence, a point and its repeat, and one with the emergency stop pressed."""


def values_of(where: list[float], codes: npt.NDArray[np.int16]) -> Array:
    """The values of an array, as `Numbers.add` says where it stands among all codes."""
    first, count, offset, scale, log = int(where[0]), int(where[1]), where[2], where[3], where[4]
    part = codes[first : first + count]
    values = np.where(part == UNKNOWN, np.nan, offset + scale * part)
    return np.asarray(10.0**values if log else values)


def decode(encoded: Encoded, row: int) -> dict[str, Any]:
    """One cell, as a page sees it: the header, with its arrays as numbers in the units shown."""
    entry = encoded.index["cells"][row]
    plain = zlib.decompress(encoded.data[entry["at"] : entry["at"] + entry["length"]], wbits=-zlib.MAX_WBITS)
    start = struct.calcsize("<I") + struct.unpack_from("<I", plain)[0]
    cell: dict[str, Any] = json.loads(plain[struct.calcsize("<I") : start])
    codes = np.frombuffer(plain, dtype="<i2", offset=start)

    for channel in cell["channels"]:
        channel |= {key: values_of(channel[key], codes) for key in ("low", "high", "filtered")}
        if channel["spectrum"] is not None:
            channel["spectrum"] |= {
                key: values_of(channel["spectrum"][key], codes) for key in ("frequency", "amplitude")
            }
    return cell


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drill")
    for name, bench in FILES.items():
        write(folder / name, bench)
    store = tmp_path_factory.mktemp("drilled") / "store"
    ingest(folder, Store(store), workers=1)
    return store


def measured(store: Store) -> tuple[Grid, Budget]:
    name, manifests = choose_campaign(store, None)
    facts = window_facts(manifests)
    grid = measured_grid(name, manifests, BENCH)
    return grid, budget_of(grid, None, BENCH, facts)


def signals(store: Store) -> CampaignSignals:
    return campaign_signals(store, *measured(store))


@pytest.fixture(scope="module")
def cells(ingested: Path) -> tuple[CellSignals, ...]:
    made = signals(Store(ingested))
    assert not made.findings
    return made.cells


# --- from the store ------------------------------------------------------------------------------------


def test_each_row_of_the_grid_is_a_cell_with_its_own_recording(ingested: Path, cells: tuple[CellSignals, ...]) -> None:
    grid, _ = measured(Store(ingested))
    assert [cell.row for cell in cells] == list(range(len(grid)))
    assert [cell.point for cell in cells] == grid.points.name.tolist()
    assert [cell.file for cell in cells] == list(FILES)
    assert [channel.mean for channel in cells[2].channels[:1]] == pytest.approx([0.9], abs=1e-4)
    rows = np.array([3, 1])
    grid, budget = grid[rows], replace(budget_of(grid[rows], None, BENCH))
    assert [cell.file for cell in campaign_signals(Store(ingested), grid, budget).cells] == ["3.mcap", "1.mcap"]


def test_copies_of_a_window_each_show_their_own_file(tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    for name, compression in (("a.mcap", CompressionType.ZSTD), ("b.mcap", CompressionType.NONE)):
        write(tmp_path / "made" / name, replace(FILES["1.mcap"], compression=compression))
    ingest(tmp_path / "made", Store(tmp_path / "store"), workers=1)
    made = signals(Store(tmp_path / "store"))
    assert [(cell.file, cell.accepted) for cell in made.cells] == [("a.mcap", True), ("b.mcap", False)]
    assert made.cells[1].reasons == ("the same run is in a.mcap",)


def test_the_window_that_is_shaded_is_that_of_the_manifest(ingested: Path, cells: tuple[CellSignals, ...]) -> None:
    for cell, manifest in zip(cells, Store(ingested).manifests(), strict=True):
        (window,) = manifest.document()["windows"]
        assert (cell.first_sample, cell.stop_sample) == (window["first_sample"], window["stop_sample"])
        for channel in cell.channels:
            assert channel.bins.edges[1:3] == (0.0, window["means"]["duration"])
    assert cells[0].channels[0].bins.edges == (-0.6, 0.0, 4.0, 4.6)
    assert cells[0].channels[0].bins.counts[0] > 20
    assert cells[1].channels[0].bins.edges == (0.0, 0.0, 4.0, 4.0)


def test_means_are_those_of_the_grid_and_lie_within_what_is_drawn(
    ingested: Path, cells: tuple[CellSignals, ...]
) -> None:
    grid, _ = measured(Store(ingested))
    for cell in cells:
        sun, ring, speed_sun, speed_ring = cell.channels
        assert (sun.mean, ring.mean) == (grid.torque_sun[cell.row], grid.torque_ring[cell.row])
        assert (speed_sun.mean, speed_ring.mean) == (grid.points.speed_sun[cell.row], grid.points.speed_ring[cell.row])
        for channel in cell.channels:
            assert channel.low.min() <= channel.mean <= channel.high.max()
            assert channel.resolution > 0.0
            assert channel.u < channel.expanded
        assert cell.turns == pytest.approx((10.0, 230.0 / 60.0), rel=1e-4)
        assert speed_sun.filtered == pytest.approx(600.0 * RPM, rel=2e-3)


def test_the_ripple_of_a_recording_stands_in_its_spectrum(cells: tuple[CellSignals, ...]) -> None:
    spectrum = cells[0].channels[0].spectrum
    assert spectrum is not None
    top = int(spectrum.amplitude.argmax())
    assert spectrum.frequency[top] == pytest.approx(7.3, abs=0.02)
    assert spectrum.amplitude[top] == pytest.approx(0.2, rel=0.01)
    assert [channel.spectrum is None for channel in cells[0].channels] == [False, False, True, True]


def test_the_budget_of_a_point_is_that_of_the_campaign(ingested: Path, cells: tuple[CellSignals, ...]) -> None:
    _, budget = measured(Store(ingested))
    for cell in cells:
        for shaft, whole in zip(cell.shafts, budget, strict=True):
            assert [row.key for row in shaft.rows] == [c.key for c in whole.contributions]
            assert shaft.expanded == whole.expanded[cell.row]
            total = math.hypot(*(row.u for row in shaft.rows if not math.isnan(row.u)))
            assert total == pytest.approx(shaft.u)
            own = math.hypot(*(row.u for row in shaft.rows if not row.common and not math.isnan(row.u)))
            assert own == pytest.approx(shaft.independent)


def test_a_rejected_point_carries_its_reason(cells: tuple[CellSignals, ...]) -> None:
    assert [cell.accepted for cell in cells] == [True, True, True, False]
    assert cells[3].reasons == ("emergency stop: pressed at sample 900",)
    assert not cells[1].reasons
    assert decode(encode(cells), 3)["reasons"] == list(cells[3].reasons)
    assert len(cells[3].channels) == 4


def test_flags_of_the_budget_are_told(ingested: Path) -> None:
    store = Store(ingested)
    grid, budget = measured(store)
    assert budget.facts is not None
    none = np.zeros(4, dtype=bool)
    sun = replace(budget.facts.sun, correlated=np.arange(4) == 1, remembered=none)
    ring = replace(budget.facts.ring, correlated=none, remembered=none)
    flagged = replace(budget, facts=replace(budget.facts, sun=sun, ring=ring))
    flags = [cell.flags for cell in campaign_signals(store, grid, flagged).cells]
    assert [len(each) for each in flags] == [0, 1, 0, 0]
    assert flags[1][0].startswith("sun: the torque noise")


# --- what is lacking -----------------------------------------------------------------------------------


@pytest.mark.parametrize("harm", ["missing", "cut", "changed", "columns", "empty"])
def test_a_recording_that_cannot_be_read_is_told_and_takes_no_other_point(
    harm: str, ingested: Path, tmp_path: Path
) -> None:
    store = Store(shutil.copytree(ingested, tmp_path / "store"))
    grid, budget = measured(store)
    (path,) = (store.path / "runs").glob("1-*.parquet")
    if harm == "missing":
        path.unlink()
    elif harm == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    elif harm == "changed":
        pl.read_parquet(path).with_columns(pl.col("torque_sun") + 1e-3).write_parquet(path)
    else:
        manifest = store.read_manifest(path.stem)
        samples = store.samples(manifest)
        store.write(manifest, samples.drop("angle_ring") if harm == "columns" else samples.head(0))
    made = campaign_signals(store, grid, budget)
    assert [bool(cell.lacking) for cell in made.cells] == [False, True, False, False]
    assert [len(cell.channels) for cell in made.cells] == [4, 0, 4, 4]
    assert made.cells[1].shafts[0].torque == grid.torque_sun[1]
    (finding,) = made.findings
    assert finding.severity == "warning"
    assert "1 point without signals: B" in finding.message
    assert (NO_NUMBER in finding.message) == (harm in ("cut", "changed", "columns"))
    page = encode(made.cells)
    assert page.index["cells"][1]["lacking"] == made.cells[1].lacking
    assert len(decode(page, 1)["budget"]) == 2


def test_published_grids_have_no_signals_and_say_so(published_folder: Path, tmp_path: Path) -> None:
    grid = read_published(published_folder, BENCH)
    made = campaign_signals(Store(tmp_path / "none"), grid, budget_of(grid, None, BENCH))
    assert made.cells == ()
    assert [finding.severity for finding in made.findings] == ["info"]
    assert encode(made.cells).index["cells"] == []


def test_a_budget_of_another_grid_and_a_folder_that_is_no_store_are_refused(ingested: Path, tmp_path: Path) -> None:
    grid, budget = measured(Store(ingested))
    with pytest.raises(GridError, match="other points"):
        campaign_signals(Store(ingested), grid[np.arange(2)], budget)
    with pytest.raises(StoreError, match="no such folder"):
        campaign_signals(Store(tmp_path / "none"), grid, budget)


# --- as bytes ------------------------------------------------------------------------------------------

NUMBERS = st.lists(st.one_of(st.floats(-1e30, 1e30), st.just(math.nan)), max_size=40)


@given(NUMBERS, NUMBERS)
@settings(max_examples=200)
def test_a_quantised_number_is_off_by_half_a_step_at_most(one: list[float], other: list[float]) -> None:
    numbers = Numbers()
    arrays = [np.array(one, dtype=float), np.array(other, dtype=float)]
    where = [numbers.add(array, (arrays[1 - place],)) for place, array in enumerate(arrays)]
    codes = np.frombuffer(b"".join(numbers.parts), dtype="<i2")
    both = np.concatenate(arrays)
    known = both[np.isfinite(both)]
    spread = float(np.ptp(known)) if len(known) else 0.0
    size = float(np.abs(known).max()) if len(known) else 0.0
    for place, array in zip(where, arrays, strict=True):
        back = values_of(place, codes)
        assert (np.isnan(back) == np.isnan(array)).all()
        off = np.abs(back - array)[np.isfinite(array)]
        assert (off <= spread / 120000.0 * (1.0 + 1e-9) + 4.0 * np.finfo(float).eps * size + 1e-300).all()


def within_a_step(back: Array, truth: Array, of: Array) -> bool:
    known = of[np.isfinite(of)]
    spread = float(np.ptp(known)) if len(known) else 0.0
    same = bool((np.isnan(back) == np.isnan(truth)).all())
    return same and bool((np.abs(back - truth)[np.isfinite(truth)] <= spread / 119999.0 + 1e-12).all())


def test_a_page_reads_what_the_store_held(cells: tuple[CellSignals, ...]) -> None:
    page = encode(cells)
    assert [each["key"] for each in page.index["channels"]] == ["torque_sun", "torque_ring", "speed_sun", "speed_ring"]
    assert [each["unit"] for each in page.index["channels"]] == ["N m", "N m", "rpm", "rpm"]
    for row, cell in enumerate(cells):
        read = decode(page, row)
        assert (read["row"], read["point"], read["file"]) == (cell.row, cell.point, cell.file)
        assert read["samples"] == [cell.first_sample, cell.stop_sample]
        for got, channel in zip(read["channels"], cell.channels, strict=True):
            display = channel.signal.display
            assert sum(got["bins"]) == len(got["low"])
            both = np.concatenate([display(channel.low), display(channel.high)])
            assert within_a_step(got["low"], display(channel.low), both)
            assert within_a_step(got["high"], display(channel.high), both)
            assert within_a_step(got["filtered"], display(channel.filtered), display(channel.filtered))
            assert got["mean"] == pytest.approx(display(channel.mean), rel=1e-8)
            assert got["expanded"] == pytest.approx(display(channel.expanded), rel=1e-8)
            if channel.spectrum is not None:
                assert got["spectrum"]["frequency"] == pytest.approx(channel.spectrum.frequency, rel=2e-4)
                known = channel.spectrum.amplitude > 0.0
                assert got["spectrum"]["amplitude"][known] == pytest.approx(channel.spectrum.amplitude[known], rel=1e-3)
        for got, shaft in zip(read["budget"], cell.shafts, strict=True):
            assert got["u"] == [None if math.isnan(r.u) else pytest.approx(r.u, rel=1e-8) for r in shaft.rows]
            assert len(got["dof"]) == len(got["u"]) == len(page.index["budget"][0]["rows"])


def test_each_cell_stands_by_itself_in_the_text(cells: tuple[CellSignals, ...]) -> None:
    page = encode(cells)
    for entry in page.index["cells"]:
        at, length = entry["at"], entry["length"]
        assert at % 3 == 0
        text = page.base64[at // 3 * 4 : -(-(at + length) // 3) * 4]
        packed = base64.b64decode(text)[:length]
        assert packed == page.data[at : at + length]
        unpacker = zlib.decompressobj(-zlib.MAX_WBITS)
        unpacker.decompress(packed)
        assert unpacker.eof
        assert not unpacker.unused_data
    assert encode(cells) == page


def test_no_name_can_close_the_script_that_holds_the_index(cells: tuple[CellSignals, ...]) -> None:
    page = encode([replace(cells[0], point="</script><!-- & \u2028")])
    assert not set("<>&\u2028") & set(page.index_json)
    assert json.loads(page.index_json)["cells"][0]["point"] == "</script><!-- & \u2028"


def test_cells_of_different_budgets_are_refused(cells: tuple[CellSignals, ...]) -> None:
    shaft = replace(cells[1].shafts[0], rows=cells[1].shafts[0].rows[1:])
    with pytest.raises(GridError, match="other contributions"):
        encode([cells[0], replace(cells[1], shafts=(shaft, cells[1].shafts[1]))])


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node to run the script that the contract shows")
def test_the_script_of_the_contract_reads_the_same_numbers(cells: tuple[CellSignals, ...], tmp_path: Path) -> None:
    page = encode(cells)
    (tmp_path / "run.mjs").write_text(_script(page), encoding="utf-8")
    done = subprocess.run(["node", str(tmp_path / "run.mjs")], capture_output=True, text=True, check=True, timeout=60)
    for row, read in enumerate(json.loads(done.stdout)):
        expected = decode(page, row)
        assert read["point"] == expected["point"]
        for got, channel in zip(read["channels"], expected["channels"], strict=True):
            for key in ("low", "high", "filtered"):
                values = np.array([math.nan if v is None else v for v in got[key]])
                assert np.allclose(values, channel[key], rtol=1e-12, atol=1e-12, equal_nan=True)
            if channel["spectrum"] is not None:
                values = np.array([math.nan if v is None else v for v in got["spectrum"]["amplitude"]])
                assert np.allclose(values, channel["spectrum"]["amplitude"], rtol=1e-12, equal_nan=True)


def _script(page: Encoded) -> str:
    """The function that the contract shows, run over all cells."""
    assert contract.__doc__
    found = re.search(r"^    async function unpack.*?^    }$", contract.__doc__, re.DOTALL | re.MULTILINE)
    assert found
    return f"""{found[0]}
const index = {page.index_json};
const all = [];
for (let row = 0; row < index.cells.length; row++) {{
  const {{cell, numbers}} = await unpack(index, "{page.base64}", row);
  for (const channel of cell.channels) {{
    for (const key of ["low", "high", "filtered"]) channel[key] = numbers(channel[key]);
    if (channel.spectrum) channel.spectrum.amplitude = numbers(channel.spectrum.amplitude);
  }}
  all.push(cell);
}}
console.log(JSON.stringify(all));
"""

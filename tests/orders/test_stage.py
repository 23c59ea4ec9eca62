"""From a recording with coils and index pulses to what ``pmg orders`` says."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import polars as pl
import pytest
from tests.recording.writer import Bench, block, write
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.orders import ANGLES, run_orders
from pmg.pipeline.orders.flux import linkage_area
from pmg.pipeline.orders.stored_lines import COLUMNS, kept_orders, orders_of_manifest
from pmg.pipeline.recording.auxiliary_channels import NO_AUXILIARY
from pmg.pipeline.recording.container import contents
from pmg.pipeline.recording.container.gathered import WholeRecords
from pmg.pipeline.recording.container.source import ByteSource
from pmg.pipeline.recording.container.walk import walk_records
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.store.store import ORDERS, Store
from pmg.pipeline.windows.limits import Steadiness
from pmg.pipeline.windows.window import Window
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import StoreError
from pmg.sim.signals import RPM

RATE, SECONDS = 2000.0, 6.0
SUN, RING = 624.0, -240.0

pytestmark = pytest.mark.usefixtures("undrawn")

DENSITY = 0.8
SCALE = 1e-4
COIL = "/daq/emf/radial_1"
VOLTAGE = {
    "quantity": "voltage", "unit": "V", "dtype": "i32", "rate_hz": f"{RATE:g}", "clock_id": "0", "scale": str(SCALE)
}  # fmt: skip


def engaged(bench: BenchParameters, **changed: object) -> Bench:
    """An engaged run with a ripple at order 2 of the sun, and a coil that sees the pole pairs, on an offset."""
    t = np.arange(round(RATE * SECONDS)) / RATE
    rate = 5 * SUN * RPM
    voltage = 0.5 + linkage_area(bench, "radial_1") * DENSITY * rate * np.sin(rate * t)
    codes = np.rint(voltage / SCALE).astype(np.int64)
    made = Bench(
        seconds=SECONDS,
        rate_hz=RATE,
        speed={"sun": SUN, "ring": RING},
        ripple=0.02,
        ripple_hz=2 * SUN / 60.0,
        run={"configuration": "engaged", "point": "E1"},
        with_index=True,
        extra={COIL: block(0, "i32", codes)},
        channel={COIL: VOLTAGE},
    )
    return replace(made, **changed)  # type: ignore[arg-type]


def ingested(folder: Path, *recordings: Bench) -> Path:
    place = folder / "recordings"
    place.mkdir(parents=True)
    for number, recording in enumerate(recordings):
        write(place / f"{number}.mcap", recording)
    result = CliRunner().invoke(app, ["ingest", str(place), "--store", str(folder / "store")])
    assert result.exit_code in (0, 3), result.output
    return folder / "store"


def test_ingest_keeps_torque_flux_and_load_angle(tmp_path: Path, bench: BenchParameters) -> None:
    store = ingested(tmp_path, engaged(bench))
    (manifest,) = Store(store).manifests()
    kept = kept_orders(Store(store), manifest)
    assert kept is not None
    assert dict(kept.table.schema) == COLUMNS
    rows = {(row["signal"], row["line"]): row for row in kept.table.iter_rows(named=True)}
    torque = rows["torque_sun", "sun 2"]
    assert torque["amplitude"] == pytest.approx(0.02, rel=2e-3)
    # the torque is A sin(2 theta) and the index stands at count 0
    assert torque["from_index"]
    assert torque["phase"] == pytest.approx(-math.pi / 2, abs=3.0 * math.hypot(torque["u_phase"], torque["u_delay"]))
    flux = rows["flux_radial_1", "sun 5 = ring 13"]
    assert flux["amplitude"] == pytest.approx(DENSITY, rel=2e-3)
    assert flux["phase"] == pytest.approx(0.0, abs=3.0 * math.hypot(flux["u_phase"], flux["u_delay"]))
    silent = rows["torque_sun", "slip"]
    assert silent["amplitude"] is None
    assert silent["reason"].startswith("at rest")
    (angle,) = kept.document["load_angles"]
    assert angle["from_index"]
    assert angle["angle"] == pytest.approx(0.0, abs=4.0 * math.hypot(angle["u"], angle["u_index"]))


def test_the_command_tells_and_writes(tmp_path: Path, bench: BenchParameters) -> None:
    store = ingested(tmp_path, engaged(bench))
    result = CliRunner().invoke(
        app, ["orders", "--store", str(store), "--point", "E1", "--json", "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)["data"]
    assert data["points"] == 1
    assert {row["line"] for row in data["rows"]} >= {"sun 1", "sun 5 = ring 13", "slip"}
    assert pl.read_csv(tmp_path / "out" / "orders.csv").height == len(data["rows"])
    plain = CliRunner().invoke(app, ["orders", "--store", str(store), "--point", "E1"])
    assert "torque_sun  sun 2  20" in plain.stdout
    assert "no number for slip: at rest" in plain.stdout
    with pytest.raises(StoreError, match=r"no point 'E2'; expected one of its points\. Known: E1"):
        run_orders(store, point="E2")


def test_a_campaign_is_told_and_reported(tmp_path: Path, bench: BenchParameters) -> None:
    """Six points at six speeds, with a ripple that is of no line but that of the sun at order 2."""
    runs = [
        engaged(
            bench,
            speed={"sun": speed, "ring": -speed / 2.6},
            ripple_hz=2 * speed / 60.0,
            run={"configuration": "engaged", "point": f"E{number}"},
            extra={},
            channel={},
        )
        for number, speed in enumerate((260.3, 301.7, 344.9, 410.3, 502.1, 623.9))
    ]
    store = ingested(tmp_path, *runs)
    arguments = ["orders", "--store", str(store), "--report", str(tmp_path / "report"), "--json"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)["data"]
    found = {(line["signal"], line["line"]): line for line in data["lines"]}
    for side in ("sun", "ring"):
        ripple = found[f"torque_{side}", "sun 2"]
        assert ripple["beyond"] == ripple["points"] == 6
        assert ripple["amplitude"]["value"] == pytest.approx(0.02, rel=2e-3)
        assert abs(ripple["exponent"]["value"]) < 0.01
    assert found["torque_sun", "sun 2"]["belongs"]["mechanism"] == "coupling_misalignment"
    assert found["torque_ring", "sun 2"]["belongs"] is None
    assert len(data["load_angles"]) == 6
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "Lines that are present" in page
    assert "coupling misalignment" in page


def test_a_store_without_kept_lines_gives_them_from_its_samples(tmp_path: Path, bench: BenchParameters) -> None:
    store = ingested(tmp_path, engaged(bench))
    (manifest,) = Store(store).manifests()
    before = kept_orders(Store(store), manifest)
    for path in (store / ORDERS).iterdir():
        path.unlink()
    assert before is not None
    again = orders_of_manifest(Store(store), manifest, load_bench()).table
    same = before.table.filter(~pl.col("signal").str.starts_with("flux"))
    assert np.allclose(again["amplitude"].drop_nulls(), same["amplitude"].drop_nulls(), rtol=1e-6, atol=1e-12)
    assert not again["from_index"].any()
    assert run_orders(store).data["without_coils_and_index"] == 1
    (store / ORDERS / f"{manifest.identifier}.json").write_text("{")
    with pytest.raises(StoreError, match="Ingest its source again"):
        run_orders(store)


def test_shafts_at_rest_give_reasons_and_no_number(tmp_path: Path, bench: BenchParameters) -> None:
    still = engaged(bench, speed={"sun": 0.0, "ring": 0.0}, run={"configuration": "zero", "point": "Z"}, ripple=1e-3)
    store = ingested(tmp_path, still)
    outcome = run_orders(store, point="Z")
    assert all(row["amplitude"] is None and row["reason"] for row in outcome.data["rows"])
    assert outcome.data["load_angles"] == []
    whole = run_orders(store, out=tmp_path / "out")
    assert whole.lines[0] == ("campaign made: no line has a number at 3 or more accepted points of one configuration")
    header = (tmp_path / "out" / "load_angles.csv").read_text().splitlines()
    assert header == [",".join(ANGLES)]
    store = ingested(tmp_path / "other", engaged(bench))
    (line,) = [line for line in run_orders(store, out=tmp_path / "out").lines if "load angle of" in line]
    assert line.startswith("load angle of 1 window, 1 of them")
    angles = pl.read_csv(tmp_path / "out" / "load_angles.csv", schema=ANGLES)
    assert angles.height == 1
    assert angles["dof"][0] > 0.0


def test_windows_are_judged_once_for_means_and_lines(
    tmp_path: Path, bench: BenchParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the ingest rejects has no lines: both are of the same windows."""

    def none_accepted(recording: Recording, limits: Steadiness) -> tuple[Window, ...]:
        return tuple(replace(window, accepted=False, reasons=("a test",)) for window in find_windows(recording, limits))

    monkeypatch.setattr("pmg.pipeline.commands.ingest_files.find_windows", none_accepted)
    store = ingested(tmp_path, engaged(bench))
    (manifest,) = Store(store).manifests()
    kept = kept_orders(Store(store), manifest)
    assert kept is not None
    assert [window["accepted"] for window in manifest.document()["windows"]] == [False]
    assert kept.table.height == 0


def test_an_ingest_reads_a_file_with_coils_once(
    tmp_path: Path, bench: BenchParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the hash of the inventory; and a reading that does not ask for coils holds none."""
    calls: list[int] = []

    def walked(stream: BinaryIO, size: int, gathered: WholeRecords) -> ByteSource:
        calls.append(size)
        return walk_records(stream, size, gathered)

    monkeypatch.setattr(contents, "walk_records", walked)
    store = ingested(tmp_path, engaged(bench))
    assert len(calls) == 1
    (manifest,) = Store(store).manifests()
    kept = kept_orders(Store(store), manifest)
    assert kept is not None
    assert "flux_radial_1" in set(kept.table["signal"])
    assert read_recording(write(tmp_path / "a.mcap", engaged(bench))).auxiliary == NO_AUXILIARY


def test_a_coil_of_another_kind_or_unit_is_told_and_the_rest_goes_on(tmp_path: Path, bench: BenchParameters) -> None:
    odd = engaged(bench, channel={COIL: VOLTAGE | {"unit": "mV"}})
    auxiliary = read_recording(write(tmp_path / "a.mcap", odd), coils=True).auxiliary
    assert auxiliary.coils == ()
    assert [(finding.where, finding.severity.value) for finding in auxiliary.findings] == [(COIL, "error")]
    axial = "/daq/emf/axial_1"
    other = engaged(bench, extra={axial: engaged(bench).extra[COIL]}, channel={axial: VOLTAGE})
    store = ingested(tmp_path, other)
    rows = run_orders(store, point="E1").data["rows"]
    assert {row["reason"] for row in rows if row["signal"] == "flux_axial_1"} >= {
        "of another rate than the torque, or of no known kind"
    }
    assert any(row["amplitude"] is not None for row in rows if row["signal"] == "torque_sun")

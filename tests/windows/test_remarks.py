"""What is reported of windows that are accepted all the same, and of the transducers behind an analysis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import lfilter
from tests.points import measured, points
from tests.recording.damages import recorded
from tests.recording.writer import CALIBRATION, Bench

from pmg.pipeline.analysis.outputs import write_analysis
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.design import run_design
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.residuals import run_residuals
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import THESIS_OPTIONS, AnalysisOptions
from pmg.pipeline.grid.completeness import holes, lack_findings
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.store.manifest import Manifest
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.grid import Grid

LATER, LATEST = "2025-04-23T09:00:00Z", "2025-04-23T10:00:00Z"

pytestmark = pytest.mark.usefixtures("undrawn")

TORQUE = "/daq/torque_sun/frequency"


def ingested(folder: Path, **files: Bench) -> Outcome:
    recordings = folder / "r"
    recordings.mkdir()
    for name, bench in files.items():
        (recordings / f"{name}.mcap").write_bytes(recorded(bench))
    return run_ingest(recordings, folder / "s", ALONE)


def slow(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Noise of half a second's memory, 5 Hz or 5 mN m of standard deviation."""
    keep = np.exp(-1.0 / 250.0)
    push = np.random.default_rng(3).standard_normal(len(values)) * np.sqrt(1.0 - keep**2)
    return values + 5.0 * lfilter([1.0], [1.0, -keep], push)


def test_a_remark_on_an_accepted_window_is_in_every_list(tmp_path: Path) -> None:
    """A drift of 0.7 of its limit, and noise that lasts; a quiet window has none."""
    outcome = ingested(
        tmp_path,
        quiet=Bench(),
        drifts=Bench(torque_slope=0.0175, run={"point": "P2", "started_at": LATER}),
        noisy=Bench(4.0, spoil={TORQUE: slow}, run={"point": "P3", "started_at": LATEST}),
    )
    told = {f.where: f for f in outcome.findings if f.message.startswith("accepted")}
    assert set(told) == {"drifts.mcap: P2", "noisy.mcap: P3"}
    assert (
        "half the limits would reject it: torque not settled: sun changes over the" in told["drifts.mcap: P2"].message
    )
    assert "the noise of the torque of the sun may not be flat" in told["noisy.mcap: P3"].message
    assert outcome.data["rejected"] == 0
    assert not outcome.partial
    analysed = run_analyse(tmp_path / "s", AnalysisOptions(), grids=None, campaign=None)
    assert "3 of 3 points accepted" in analysed.lines[0]
    assert {f.where for f in analysed.findings if "remark" in f.message} == {"window P2", "window P3"}
    run_compare(tmp_path / "s", tmp_path / "report")
    table = (tmp_path / "report" / "tables" / "remarked-windows.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in table[1:]] == ["P2", "P3"]
    assert float(table[2].split(",")[-2]) > 1.0, "the noise is in its uncertainty [mN m]"


def test_a_hole_is_told_with_the_window_that_was_rejected_there() -> None:
    """And with recordings that lost data only where no window is known."""
    sun, ring = (axis.ravel() for axis in np.meshgrid([100.0, 200.0, 300.0], [100.0, 200.0], indexing="ij"))
    grid = measured(points("neutral", sun, ring), np.ones(6), np.ones(6))
    gone = np.arange(6) == 2
    grid = replace(grid, accepted=~gone, reason=np.where(gone, "emergency stop: pressed", ""))
    cut = Finding(Severity.ERROR, "byte 12", "cut", "cut.mcap", Code.TRUNCATED, "copy it again")
    manifest = Manifest("cut", "cut.mcap", findings=(cut,))
    (hole,) = holes(grid)
    (found, rejected) = lack_findings(grid, [hole], (), [manifest])
    assert found.message == f"no accepted point at {hole}; rejected there: window {grid.points.name[2]}"
    assert rejected.where == f"window {grid.points.name[2]}"
    (found, *_) = lack_findings(grid, ["neutral, sun 5 rpm, ring 5 rpm"], (), [manifest])
    assert found.message.endswith("; it may be in what was lost of cut.mcap")


@pytest.mark.parametrize("recorded_Nm", [10.0, 50.0])
def test_design_and_residuals_take_the_nominal_torque_that_was_recorded(
    tmp_path: Path, published_folder: Path, monkeypatch: pytest.MonkeyPatch, recorded_Nm: float
) -> None:
    """And say so where it is not the bench's."""
    stated = CALIBRATION.replace("nominal_torque_Nm = 10.0", f"nominal_torque_Nm = {recorded_Nm}")
    ingested(tmp_path, a=Bench(calibration=stated, torque={"sun": 0.8, "ring": 1.5}))
    bench = load_bench()
    grid = replace(read_published(published_folder, bench), origin="measured", campaign="made")
    write_analysis(analyse(grid, THESIS_OPTIONS, bench), tmp_path / "s", bench)
    used: list[float] = []

    def told(grid: Grid, options: AnalysisOptions, bench: BenchParameters) -> Analysis:
        used.append(float(bench.transducer_ring.nominal_torque))
        return analyse(grid, options, bench)

    monkeypatch.setattr("pmg.pipeline.commands.design.analyse", told)
    monkeypatch.setattr("pmg.pipeline.commands.residuals.analyse", told)
    outcomes = run_design(None, tmp_path / "s"), run_residuals(tmp_path / "s", None, fit="curves", draws=19)
    assert used == [recorded_Nm, recorded_Nm]
    for outcome in outcomes:
        found = [f.message for f in outcome.findings if f.where == "transducer of the ring"]
        assert len(found) == (recorded_Nm != 10.0)
        assert all("states a nominal torque of 50 N m; expected 10 N m" in message for message in found)

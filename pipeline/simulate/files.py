"""Files of a simulation: tables as CSV and Parquet, recordings as MCAP, and how a folder of them is written."""

from __future__ import annotations

import io
import json
import re
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.recording.write import SimulatedRun, rated_calibration, recording_bytes
from pmg.pipeline.report.write import SUMMARY, report_files, write_report
from pmg.pipeline.simulate.simulation import encoder_angles, recordable
from pmg.pipeline.simulate.steady_points import BEGIN
from pmg.pipeline.simulate.tables import points_frame, response_frame, transient_frame
from pmg.pipeline.wording.spreadsheet import spreadsheet_csv
from pmg.sim.errors import RecordingError, StoreError
from pmg.sim.grid import Configuration
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import polars as pl

    from pmg.pipeline.report.document import Report
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.simulation import Run, Simulation
    from pmg.pipeline.simulate.steady_points import SteadyPoints
    from pmg.sim.bench import BenchParameters

LISTING = "simulation-files.json"
"""Files that a simulation wrote; the next one removes those it no longer makes, and writes over nothing else."""

RECORDINGS = "recordings"

_OURS = re.compile(r"(points|transient|response)\.(csv|parquet)|transient\.mcap|recordings/\d{4,}\.mcap")


def simulation_files(
    simulation: Simulation, scenario: Scenario, bench: BenchParameters
) -> tuple[dict[str, bytes], tuple[Remark, ...]]:
    """Tables and recordings of a simulation by their name, and findings on what could not be recorded.

    A value beyond the range of the bench's transducers cannot be recorded by them: that recording is left out.
    """
    files: dict[str, bytes] = {}
    frames: dict[str, pl.DataFrame] = {}
    if simulation.points is not None:
        frames["points"] = points_frame(simulation.points, scenario)
    if simulation.run is not None:
        frames["transient"] = transient_frame(simulation.run.trace)
    if simulation.answer is not None:
        frames["response"] = response_frame(simulation.answer)
    for name, frame in frames.items():
        if "csv" in scenario.output.formats:
            files[f"{name}.csv"] = spreadsheet_csv(frame).encode()
        if "parquet" in scenario.output.formats:
            buffer = io.BytesIO()
            frame.write_parquet(buffer, compression="zstd", statistics=False)
            files[f"{name}.parquet"] = buffer.getvalue()
    missing = []
    if "mcap" in scenario.output.formats and recordable(scenario):
        calibration = rated_calibration(bench)
        for name, run in _recordings(simulation, scenario):
            try:
                files[name] = recording_bytes(run, calibration)
            except RecordingError as error:
                message = f"not recorded: {error.came}; expected {error.expected}"
                missing.append(Remark("warning", error.where, message))
    return files, tuple(missing)


def _recordings(simulation: Simulation, scenario: Scenario) -> Iterator[tuple[str, SimulatedRun]]:
    """Names of recordings, and the runs in them."""
    points, run, n = simulation.points, simulation.run, 0
    if points is not None:
        n = len(points.grid)
        for i in range(n):
            yield f"{RECORDINGS}/{i:04d}.mcap", _steady_recording(points, i, scenario)
    if run is not None and run.recorded is not None:
        yield "transient.mcap", _recorded_run(run, scenario, BEGIN + n * scenario.output.seconds)


def _moment(seconds: float) -> datetime:
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)


def _steady_recording(points: SteadyPoints, i: int, scenario: Scenario) -> SimulatedRun:
    """A steady point as it would be recorded: constant readings of torque, angles that advance evenly."""
    at, output = points.grid.points, scenario.output
    time = np.arange(round(output.seconds * output.rate_hz)) / output.rate_hz
    setpoints = {
        "sun_speed_set_rpm": float(SPEED_SUN.display(at.speed_sun[i])),
        "ring_speed_set_rpm": float(SPEED_RING.display(at.speed_ring[i])),
    }
    if at.engaged[i]:
        setpoints["ring_torque_set_Nm"] = float(at.load_set[i])
    return SimulatedRun(
        campaign=output.campaign,
        point=str(at.name[i]),
        configuration=Configuration(at.configuration[i]),
        gear=int(at.gear[i]),
        started_at=_moment(float(at.started_at[i])),
        drive=str(at.drive[i]),
        rate=output.rate_hz,
        torque_sun=np.full(len(time), points.readings.sun[i]),
        torque_ring=np.full(len(time), points.readings.ring[i]),
        angle_sun=at.speed_sun[i] * time,
        angle_ring=at.speed_ring[i] * time,
        setpoints=setpoints,
        note=_note(scenario),
    )


def _recorded_run(run: Run, scenario: Scenario, started: float) -> SimulatedRun:
    """A run in time as a recorder would have seen it."""
    trace = run.recorded
    assert trace is not None  # the caller has looked
    angle_sun, angle_ring = encoder_angles(trace)
    shown = trace.readings
    ring_drives = trace.torque_ring[-1] * trace["speed_ring_motor"][-1] > 0.0
    engaged = scenario.bench.configuration is Configuration.ENGAGED
    return SimulatedRun(
        campaign=scenario.output.campaign,
        point="transient",
        configuration=scenario.bench.configuration,
        gear=scenario.bench.gear,
        started_at=_moment(started),
        drive="ring" if engaged and ring_drives else "sun",
        rate=scenario.output.rate_hz,
        torque_sun=shown.sun,
        torque_ring=shown.ring,
        angle_sun=angle_sun,
        angle_ring=angle_ring,
        setpoints={},
        note=_note(scenario),
    )


def _note(scenario: Scenario) -> str:
    return f"simulated: {scenario.title}" if scenario.title else "simulated"


def write_simulation(
    folder: Path, files: dict[str, bytes], report: Report, summary: dict[str, Any]
) -> tuple[Path, ...]:
    """Write tables, recordings and report, and last of all the summary: where it is there, the rest is.

    Files that an earlier simulation left there and this one does not make are removed; no other file is touched.

    Raises
    ------
    StoreError
        When a file of another origin stands where one is to be written; nothing has been changed then.
    """
    earlier = _listed(folder / LISTING)
    now = {*files, *report_files(report, summed_up=False), SUMMARY, LISTING}
    foreign = sorted(name for name in now - earlier if (folder / name).exists())
    if foreign:
        came = f"stands there and was not written by 'pmg simulate' ({len(foreign)} such files)"
        do = "Name another folder for --out; nothing was changed."
        raise StoreError(str(folder / foreign[0]), came, "a folder without files of these names", do)
    write_atomic(folder / LISTING, _listing(earlier | now))
    (folder / SUMMARY).unlink(missing_ok=True)
    for name, data in files.items():
        write_atomic(folder / name, data)
    write_report(report, folder, summed_up=False)
    for name in sorted(earlier - now):
        if _OURS.fullmatch(name):
            (folder / name).unlink(missing_ok=True)
    with suppress(OSError):  # it stays while anything is in it
        (folder / RECORDINGS).rmdir()
    write_atomic(folder / SUMMARY, _encoded(summary))
    write_atomic(folder / LISTING, _listing(now))
    return tuple(folder / name for name in sorted(now))


def _encoded(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()


def _listing(names: set[str]) -> bytes:
    return _encoded({"files": sorted(names)})


def _listed(path: Path) -> set[str]:
    """Files that an earlier simulation wrote."""
    if not path.exists():
        return set()
    try:
        return set(map(str, read_json(path)["files"]))
    except (ValueError, KeyError, TypeError) as error:
        came = f"not a listing of files ({type(error).__name__})"
        raise StoreError(str(path), came, '{"files": [...]}', "Name another folder for --out.") from error

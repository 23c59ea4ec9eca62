"""`./pmgw bench size`: time and peak memory of each stage against the number of points, on recordings made for it.

The points are those of the example that ships: torque, speed and what the recorder says of the run are taken from its
recordings and written anew, longer and faster. So the campaign can be analysed and compared when it has enough of them.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from pmg.pipeline.recording.read import Recording, read_recording
from tests.bench.kill import EXAMPLE, ROOT
from tests.bench.recorded import Column, counted, record

RATE_HZ = 10_000.0
SECONDS = 10.0
BLOCK = 1000
COILS = tuple(f"{way}_{number}" for way in ("radial", "tangential") for number in (1, 2, 3))
CHANNELS = 4 + len(COILS)
NOISE_HZ = 20.0
"""Noise of a torque transducer's output in one sample [Hz]."""
POLE_PAIRS = 5
STAGES = ("ingest", "analyse", "compare")


def columns(source: Recording, rng: np.random.Generator) -> list[Column]:
    """Ten channels that hold the mean torques and speeds of a recording."""
    rows = round(SECONDS * RATE_HZ)
    made, speeds = [], {}
    for side in ("sun", "ring"):
        torque = float(source.samples[f"torque_{side}"].mean())  # type: ignore[arg-type]
        angle = source.samples[f"angle_{side}"]
        speeds[side] = (angle[-1] - angle[0]) * source.rate_hz / (len(angle) - 1)
        frequency = source.calibration[side].frequency(np.full(rows, torque))
        noisy = np.round(frequency + NOISE_HZ * rng.standard_normal(rows), 2)
        made.append(Column(f"/daq/torque_{side}/frequency", "f64", noisy, {"quantity": "frequency", "unit": "Hz"}))
    for side, speed in speeds.items():
        made.append(counted(side, speed, rows, RATE_HZ, source.calibration.counts_per_rev[side]))
    phase = POLE_PAIRS * speeds["sun"] * np.arange(rows) / RATE_HZ
    for number, coil in enumerate(COILS):
        codes = 3000.0 * np.sin(phase + number) + 5.0 * rng.standard_normal(rows)
        metadata = {"quantity": "voltage", "unit": "V", "scale": "0.00030517578125"}
        made.append(Column(f"/daq/emf/{coil}", "i32", np.round(codes).astype(np.int32), metadata))
    return made


def write_campaign(folder: Path, points: int, seed: int) -> int:
    """Write so many recordings and give their bytes; past the points of the example they come again, a month later."""
    folder.mkdir()
    sources = sorted(EXAMPLE.glob("*.mcap"))
    order = [int(k * len(sources) / points) for k in range(points)] if points < len(sources) else range(points)
    for number, k in enumerate(order):
        turn, path = divmod(k, len(sources))[0], sources[k % len(sources)]
        source = read_recording(path)
        with path.open("rb") as stream:
            reader = make_reader(stream)
            run = dict(next(m.metadata for m in reader.iter_metadata() if m.name == "pmg.run"))
            calibration = next(a.data for a in reader.iter_attachments() if a.name == "calibration.toml")
        started = datetime.fromisoformat(run["started_at"]) + timedelta(days=30 * turn)
        run["started_at"] = started.isoformat().replace("+00:00", "Z")
        made = columns(source, np.random.default_rng([seed, number]))
        record(folder / f"{number:05}.mcap", made, run, calibration, RATE_HZ, BLOCK)
    return sum(path.stat().st_size for path in folder.iterdir())


@dataclass(frozen=True)
class Cost:
    """What a command took: wall time [s], processor time [s], memory of its largest process [bytes], exit code."""

    wall: float
    processor: float
    memory: int
    code: int


def carried_out(words: list[str]) -> Cost:
    """A command of pmg in a process of its own, with that of its workers counted in."""
    path = f"{ROOT / '.typing'}{os.pathsep}{ROOT}"
    environment = {**os.environ, "PYTHONPATH": path}
    start = time.perf_counter()
    with Path(os.devnull).open("r+b") as nowhere:
        actions = [(os.POSIX_SPAWN_DUP2, nowhere.fileno(), descriptor) for descriptor in (0, 1, 2)]
        arguments = [sys.executable, "-m", "pmg.pipeline", *words]
        number = os.posix_spawn(sys.executable, arguments, environment, file_actions=actions)
        _, status, used = os.wait4(number, 0)
    wall = time.perf_counter() - start
    # The system counts memory in kilobytes on Linux.
    return Cost(wall, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, os.waitstatus_to_exitcode(status))


def stages(recordings: Path, folder: Path, workers: int) -> dict[str, Cost]:
    """Every stage on a campaign; one that cannot run ends the row."""
    store = str(folder / "store")
    words = {
        "ingest": ["ingest", str(recordings), "--store", store, "--workers", str(workers)],
        "analyse": ["analyse", "--store", store],
        "compare": ["compare", "--store", store, "--report", str(folder / "report")],
    }
    found: dict[str, Cost] = {}
    for stage in STAGES:
        found[stage] = carried_out(words[stage])
        if found[stage].code not in (0, 3):
            break
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="pmgw bench size", description=__doc__)
    parser.add_argument("--points", type=int, default=16, help="points of the smallest campaign")
    parser.add_argument("--times", default="1,2,4", help="sizes, in campaigns of so many points")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes of the ingest")
    parser.add_argument("--seed", type=int, default=20260503)
    given = parser.parse_args()
    out = sys.stdout.write
    samples = round(SECONDS * RATE_HZ) * CHANNELS
    out(f"Points of {SECONDS:g} s at {RATE_HZ:g} S/s on {CHANNELS} channels; memory is that of the largest process.\n")
    out(f"The ingest has {given.workers} processes. A stage that cannot run on so few points shows its exit code.\n\n")
    heads = (
        "points",
        "samples",
        "file [MB]",
        "made [s]",
        *(f"{s} {u}" for s in STAGES for u in ("[s]", "CPU", "[MB]")),
    )
    out("".join(f"{head:>13}" for head in heads) + "\n")
    walls: list[tuple[int, dict[str, Cost]]] = []
    for times in map(int, given.times.split(",")):
        points = given.points * times
        with tempfile.TemporaryDirectory() as name:
            start = time.perf_counter()
            size = write_campaign(Path(name, "recordings"), points, given.seed)
            made = time.perf_counter() - start
            found = stages(Path(name, "recordings"), Path(name), given.workers)
        row = [f"{points}", f"{points * samples:.2e}", f"{size / 1e6:.0f}", f"{made:.1f}"]
        for stage in STAGES:
            cost = found.get(stage)
            if cost is None or cost.code not in (0, 3):
                row += ["-" if cost is None else f"exit {cost.code}", "-", "-"]
            else:
                row += [f"{cost.wall:.1f}", f"{cost.processor:.1f}", f"{cost.memory / 1e6:.0f}"]
        out("".join(f"{cell:>13}" for cell in row) + "\n")
        sys.stdout.flush()
        walls.append((points, found))
    first = walls[0][1]["ingest"]
    walled = [f"{points}: {found['ingest'].wall / first.wall:.2f}" for points, found in walls]
    worked = [f"{points}: {found['ingest'].processor / first.processor:.2f}" for points, found in walls]
    out(f"\ningest over that of {walls[0][0]} points: wall {', '.join(walled)}; processor {', '.join(worked)}\n")


if __name__ == "__main__":
    main()

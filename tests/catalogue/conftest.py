"""A store of a few runs: two speeds, two loads, one file that is none, one window that is rejected."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.recording.writer import Bench, write

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.store.store import Store

LOADS = {"a": (600.0, 0.78), "b": (1200.0, 1.56), "c": (1200.0, 1.57), "d": (1800.0, 1.56)}


def run_of(
    folder: Path, name: str, number: int, sun: float, load: float, torque: float = 0.8, slope: float = 0.0
) -> Path:
    ring = -sun * 0.4
    words = {
        "configuration": "engaged",
        "point": f"E_{name}",
        "started_at": f"2025-04-23T08:{number:02}:00.250000Z",
        "sun_speed_set_rpm": f"{sun:g}",
        "ring_speed_set_rpm": f"{ring:g}",
        "ring_torque_set_Nm": f"{load:g}",
    }
    bench = Bench(run=words, speed={"sun": sun, "ring": ring}, torque={"sun": torque, "ring": load}, torque_slope=slope)
    return write(folder / f"{name}.mcap", bench)


@pytest.fixture(scope="session")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("catalogued")
    recordings = folder / "recordings"
    recordings.mkdir()
    for number, (name, (sun, load)) in enumerate(LOADS.items()):
        run_of(recordings, name, number, sun, load)
    run_of(recordings, "falling", 20, 1200.0, 1.56, slope=0.5)
    (recordings / "notes.mcap").write_text("not a recording")
    ingest(recordings, Store(folder / "store"), workers=1)
    return folder / "store"


@pytest.fixture
def store(ingested: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(ingested, tmp_path / "store"))

"""Records of a machine with clocks as they are: what is kept of each fault, what is said, and what it does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance import gearbox
from tests.balance.test_machine import changed
from tests.bench.clocks import FAULTS, mf4, parquet, told

from pmg.pipeline.commands.machines.machine import check_machine
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.machine.machine_file import read_machine
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.sim.signals import Array

H = 1.0 / gearbox.RATE
"""Step of the clock [s]."""


def rewritten(path: Path, columns: Callable[[Array], Array], names: str = "") -> None:
    """A recording with its columns (n, k) changed, times first."""
    head = names or path.read_text().splitlines()[0]
    values = columns(np.loadtxt(path, delimiter=",", skiprows=1))
    np.savetxt(path, values, delimiter=",", header=head, comments="", fmt="%.7f")


def with_time(change: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda v: np.asarray(np.c_[change(v[:, 0]), v[:, 1:]])


def paused(values: Array) -> Array:
    later = values[len(values) // 2 :].copy()
    later[:, 0] += 30.0
    return np.vstack([values[: len(values) // 2], later])


def jittered(values: Array) -> Array:
    """Time stamps of arrival: late by up to 0.6 of a sample, the samples even."""
    late = np.random.default_rng(1).uniform(0.0, 0.6, len(values)) * H
    return np.asarray(np.c_[values[:, 0] + late, values[:, 1:]])


def fitted(records: Path, machine: Path = gearbox.SHIPPED) -> Recorded:
    return read_recordings(case_of(read_machine(machine), records))[0]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Recorded]:
    folder = gearbox.make_records(tmp_path_factory.mktemp("sound") / "records", seconds=40.0)
    return folder / "first.csv", fitted(folder)


@pytest.mark.parametrize(
    ("change", "words", "off", "stretches"),
    [
        (with_time(lambda t: (t + 50.0) % 60.0), "60 s", 1e-6, 1),
        (with_time(lambda t: t * (1.0 + 2e-4)), "-200 ppm", 2e-3, 1),
        (jittered, "scatter by 0.17", 1e-2, 1),
        (lambda v: np.delete(v, [4000, 9000, 9001], axis=0), "3", 2e-2, 1),
        (lambda v: np.vstack([v[:5000], v[4999:]]), "1", 1e-6, 1),
        (paused, "30", None, 2),
        (lambda v: np.vstack([v, np.c_[v[:200, 0] + 100.0, v[:200, 1:]]]), "left out", 1e-6, 1),
    ],
    ids=["wrapped seconds", "slow clock", "jitter", "lost samples", "a row twice", "pause", "tail"],
)
def test_a_clock_is_used_as_far_as_it_goes_and_its_fault_told(
    tmp_path: Path,
    sound: tuple[Path, Recorded],
    change: Callable[[Array], Array],
    words: str,
    off: float | None,
    stretches: int,
) -> None:
    first, plain = sound
    records = tmp_path / "records"
    records.mkdir()
    for name in ("first.csv", "withheld.csv"):
        (records / name).write_bytes((first.parent / name).read_bytes())
    rewritten(records / "first.csv", change)
    found = fitted(records)
    assert len(found.names) == stretches
    assert any(words in str(finding) for finding in found.findings), [str(f) for f in found.findings]
    if off is None:
        return
    assert len(found.force) == pytest.approx(len(plain.force), abs=2)
    n = min(len(found.force), len(plain.force))
    scale = float(np.std(plain.force))
    assert np.sqrt(np.mean((found.force - plain.force)[:n] ** 2)) < off * scale + 1e-9


def test_rows_out_of_order_and_another_rate_are_refused(tmp_path: Path, sound: tuple[Path, Recorded]) -> None:
    first, _ = sound
    for change, words in (
        (lambda v: np.vstack([v[:100], v[300:200:-1], v[300:]]), "order"),
        (with_time(lambda t: 1.5 * t), "rate"),
    ):
        path = tmp_path / "first.csv"
        path.write_bytes(first.read_bytes())
        rewritten(path, change)
        machine = changed(tmp_path, ('withheld = ["withheld*"]', ""))
        with pytest.raises(RecordingError, match=words):
            read_recordings(case_of(read_machine(machine), path))


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The gearbox with every record to fit: its times in a channel, and left to the file's own clock."""
    home = tmp_path_factory.mktemp("machines")
    named = changed(home, ('withheld = ["withheld*"]', ""))
    unnamed = home / "unnamed.toml"
    unnamed.write_text(named.read_text().replace('time = { name = "t", unit = "s" }\n', ""))
    return named, unnamed


@pytest.mark.parametrize("fault", FAULTS)
def test_mf4_keeps_and_says_of_its_own_clock_what_other_formats_do_of_a_channel(
    tmp_path: Path, sound: tuple[Path, Recorded], machines: tuple[Path, Path], fault: str
) -> None:
    values = FAULTS[fault](np.loadtxt(sound[0], delimiter=",", skiprows=1)[:12000])
    for folder, write, name in (("others", parquet, "log.parquet"), ("mdf", mf4, "log.mf4")):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder / name, values)
    expected, found = (told(tmp_path / f, m) for f, m in zip(("others", "mdf"), machines, strict=True))
    assert found == expected
    assert (fault == "none") == (found[1] == "nothing")


def test_files_on_clocks_of_their_own_are_brought_together(tmp_path: Path, sound: tuple[Path, Recorded]) -> None:
    """The brake's logger starts 3.21 s late, counts from zero, runs 80 ppm fast at another rate."""
    first, plain = sound
    records = tmp_path / "records"
    records.mkdir()
    for name in ("first", "withheld"):
        values = np.loadtxt(first.parent / f"{name}.csv", delimiter=",", skiprows=1)
        own, other = records / f"{name}_motor.csv", records / f"{name}_brake.csv"
        np.savetxt(own, values[:, :3], delimiter=",", header="t,n_motor,T_motor", comments="", fmt="%.6f")
        there = np.arange(3.21, values[-1, 0], 1.0 / 400.0)
        columns = [np.interp(there, values[:, 0], values[:, k]) for k in (3, 4)]
        late = np.c_[(there - 3.21) * (1.0 + 8e-5), *columns]
        np.savetxt(other, late, delimiter=",", header="t,n_brake,T_brake", comments="", fmt="%.6f")
    second = 'zeros = "common"\n[records.second]\nreplace = ["_motor", "_brake"]\ntime = { name = "t", unit = "s" }'
    machine = changed(tmp_path, ("keep_every = 10", f"keep_every = 10\n{second}"), ('withheld = ["withheld*"]', ""))
    text = machine.read_text()
    machine.write_text(text.replace("keep_every = 10\n", 'keep_every = 10\nwithheld = ["withheld*"]\n', 1))
    found = fitted(records, machine)
    told = next(str(f) for f in found.findings if "second file" in str(f))
    offset, error = (float(told.split("is ")[1].split(" ")[k]) for k in (0, 2))
    assert abs(offset - (3.21 - 8e-5 * 18.4)) < 3.0 * error + 1e-4, "in the middle of what both recorded"
    late = len(plain.force) - len(found.force)
    tail = found.force - plain.force[late:] if late else found.force - plain.force
    assert np.std(tail[200:-200]) < 0.25 * np.std(plain.force)
    done = check_machine(str(machine), records)
    assert [row["name"] for row in done.data["recordings"]] == ["first_motor.csv", "withheld_motor.csv"]
    (records / "first_brake.csv").unlink()
    with pytest.raises(RecordingError, match="no such file"):
        fitted(records, machine)

"""Every format with every fault of its clock, read for a machine: what is kept, and what is said."""

from __future__ import annotations

import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from scipy.io import savemat

from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.machine.machine_file import read_machine
from pmg.sim.errors import PmgError
from tests.balance import gearbox

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

NAMES = ("t", "n_motor", "T_motor", "n_brake", "T_brake")
H = 1.0 / gearbox.RATE
"""Step of the clock [s]."""


def _jittered(values: Array, share: float) -> Array:
    late = np.random.default_rng(1).uniform(0.0, share, len(values)) * H
    return np.asarray(np.c_[values[:, 0] + late, values[:, 1:]])


def _taken(values: Array) -> Array:
    """Samples that were really taken at scattered times."""
    when = values[:, 0] + np.random.default_rng(1).normal(0.0, 0.3, len(values)) * H
    when = np.sort(when)
    return np.asarray(np.column_stack([when, *(np.interp(when, values[:, 0], column) for column in values.T[1:])]))


def _paused(values: Array) -> Array:
    later = values[len(values) // 2 :].copy()
    later[:, 0] += 30.0
    return np.vstack([values[: len(values) // 2], later])


def _with_times(values: Array, times: Array) -> Array:
    return np.asarray(np.c_[times, values[:, 1:]])


FAULTS: dict[str, Callable[[Array], Array]] = {
    "none": lambda v: v,
    "seconds wrapped at 60": lambda v: _with_times(v, (v[:, 0] + 50.0) % 60.0),
    "clock 200 ppm slow": lambda v: _with_times(v, v[:, 0] * (1.0 + 2e-4)),
    "times rounded to 10 ms": lambda v: _with_times(v, np.round(v[:, 0], 2)),
    "stamps late by up to 0.6 sample": lambda v: _jittered(v, 0.6),
    "stamps late by up to 3 samples": lambda v: _jittered(v, 3.0),
    "taken 0.3 sample off": _taken,
    "1 % of rows lost": lambda v: v[np.random.default_rng(2).random(len(v)) > 0.01],
    "a row twice": lambda v: np.vstack([v[:5000], v[4999:]]),
    "pause of 30 s": _paused,
    "tail of the next test": lambda v: np.vstack([v, np.c_[v[:200, 0] + 100.0, v[:200, 1:]]]),
    "times missing in 3 rows": lambda v: _with_times(v, np.where(np.arange(len(v)) % 7000 == 100, np.nan, v[:, 0])),
    "rows out of order": lambda v: np.vstack([v[:100], v[300:200:-1], v[300:]]),
    "another rate": lambda v: _with_times(v, 1.5 * v[:, 0]),
}
"""What is done to rows (n, 5) of a sound recording, times first."""


def _csv(path: Path, values: Array) -> None:
    pl.DataFrame(dict(zip(NAMES, values.T, strict=True))).write_csv(path, float_precision=7)


def _german(path: Path, values: Array) -> None:
    text = pl.DataFrame(dict(zip(NAMES, values.T, strict=True))).write_csv(float_precision=7)
    path.write_text(text.replace(",", ";").replace(".", ","))


def _mat(path: Path, values: Array) -> None:
    savemat(path, {name: column[:, None] for name, column in zip(NAMES, values.T, strict=True)})


def parquet(path: Path, values: Array) -> None:
    pl.DataFrame(dict(zip(NAMES, values.T, strict=True))).write_parquet(path)


def _tdms(path: Path, values: Array) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject("log", name, column) for name, column in zip(NAMES, values.T, strict=True)])


def _hdf5(path: Path, values: Array) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, column in zip(NAMES, values.T, strict=True):
            file[name] = column


def mf4(path: Path, values: Array) -> None:
    """The times are those of the file's own clock, the master of the group."""
    from asammdf import MDF, Signal

    with MDF() as file:
        signals = zip(NAMES[1:], values.T[1:], strict=True)
        file.append([Signal(column, values[:, 0], name=name) for name, column in signals], common_timebase=True)
        file.save(path, overwrite=True)


FORMATS: dict[str, tuple[str, str, Callable[[Path, Array], None]]] = {
    "CSV": ("csv", "polars", _csv),
    "CSV, decimal comma": ("csv", "polars", _german),
    "MAT": ("mat", "scipy", _mat),
    "Parquet": ("parquet", "polars", parquet),
    "TDMS": ("tdms", "nptdms", _tdms),
    "HDF5": ("h5", "h5py", _hdf5),
    "MF4": ("mf4", "asammdf", mf4),
}
"""Ending, library and writer of each format."""


def told(folder: Path, machine: Path) -> tuple[str, str]:
    """Samples that are kept, in how many stretches, and what is said about times."""
    try:
        found, _ = read_recordings(case_of(read_machine(machine), folder))
    except PmgError as refused:
        return "refused", f"{refused.came}; expected {refused.expected}"
    said = "; ".join(f.message for f in found.findings if f.where == "time") or "nothing"
    return f"{len(found.motion.time)} in {len(found.names)}", said


def main() -> None:
    """Print one table for all formats, and where a format says or keeps something else."""
    rng = np.random.default_rng(7)
    m = gearbox.driven(rng, 40.0)
    with tempfile.TemporaryDirectory() as scratch:
        home = Path(scratch)
        gearbox.record(home / "sound.csv", m, gearbox.read(m, gearbox.plain(m)), rng)
        sound = np.loadtxt(home / "sound.csv", delimiter=",", skiprows=1)
        text = gearbox.SHIPPED.read_text().replace('withheld = ["withheld*"]', "")
        machines = {"": home / "plain.toml", "TDMS": home / "tdms.toml", "MF4": home / "mf4.toml"}
        machines[""].write_text(text)
        machines["MF4"].write_text(text.replace('time = { name = "t", unit = "s" }\n', ""))
        for name in NAMES:
            text = text.replace(f'name = "{name}"', f'name = "log/{name}"')
        machines["TDMS"].write_text(text)
        spoilt = len(sound) - int(_kept(home, machines[""], sound))
        print(f"{len(sound)} rows; filters take {spoilt} of them at both ends\n")
        print("| fault | kept | said |\n|---|---|---|")
        for fault, change in FAULTS.items():
            rows: dict[tuple[str, str], list[str]] = {}
            for title, (ending, library, write) in FORMATS.items():
                if find_spec(library) is None:
                    continue
                folder = home / f"{fault} {title}"
                folder.mkdir()
                write(folder / f"log.{ending}", change(sound))
                rows.setdefault(told(folder, machines.get(title, machines[""])), []).append(title)
            for (kept, said), titles in rows.items():
                where = "" if len(rows) == 1 else f" ({', '.join(titles)})"
                print(f"| {fault}{where} | {kept} | {said} |")
        absent = [title for title, (_, library, _) in FORMATS.items() if find_spec(library) is None]
        print(
            f"\nFormats: {', '.join(t for t in FORMATS if t not in absent)}"
            + (f"; not installed: {absent}" if absent else "")
        )


def _kept(home: Path, machine: Path, sound: Array) -> str:
    folder = home / "whole"
    folder.mkdir()
    _csv(folder / "log.csv", sound)
    return told(folder, machine)[0].split()[0]


if __name__ == "__main__":
    main()

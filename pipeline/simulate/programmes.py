"""Programmes of the motors of a scenario: what is asked for over time, given by a form or read from a CSV file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.programme import Programme
from pmg.sim.errors import BenchError, near_miss
from pmg.sim.signals import REVOLUTION, SPEED_SUN

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.simulate.scenario_file import ScenarioFile
    from pmg.pipeline.simulate.scenario_words import Motor, RecordedProgramme
    from pmg.sim.signals import Array


def programme_of(file: ScenarioFile, side: str, motor: Motor | None, control: Control) -> Programme:
    """Demand on a motor [N m] or [rad/s]."""
    if motor is None:
        return Programme.hold(0.0)
    unit = SPEED_SUN.scale if control is Control.SPEED else 1.0
    where = f"{file.path}: transient.{side}"
    if motor.ramp is not None:
        r = motor.ramp
        made = Programme.ramp(r.to * unit, r.over_s, begin=r.begin_s, start=r.start * unit)
    elif motor.step is not None:
        s = motor.step
        made = Programme.step(s.to * unit, s.at_s, start=s.start * unit, rise=s.rise_s)
    elif motor.points is not None:
        made = Programme.sampled(np.array(motor.points.times_s), np.array(motor.points.values) * unit)
    elif motor.recorded is not None:
        times, values = _recorded(file.resolve(motor.recorded.file), motor.recorded, f"{where}.recorded")
        made = Programme.sampled(times, values * unit)
    else:
        made = Programme.hold((motor.hold or 0.0) * unit)
    if motor.sweep is not None:
        w = motor.sweep
        ends = w.from_hz * REVOLUTION, w.to_hz * REVOLUTION
        made = made.sweep(w.amplitude * unit, *ends, begin=w.begin_s, over=w.over_s)
    return made


def _recorded(path: Path, given: RecordedProgramme, where: str) -> tuple[Array, Array]:
    """Times [s] and values of two columns of a CSV file."""
    if not path.is_file():
        raise BenchError(f"{where}.file", f"no file {path}", "a CSV file next to the scenario", "Check the path.")
    try:
        frame = pd.read_csv(path, skipinitialspace=True)
    except (ValueError, UnicodeDecodeError) as error:
        raise BenchError(str(path), f"not a table ({error})", "comma-separated values", "Check the file.") from error
    columns = []
    for key, name in (("time", given.time), ("value", given.value)):
        known = [str(column) for column in frame.columns]
        if name not in known:
            raise BenchError(f"{where}.{key}", f"no column '{name}'", f"a column of {path}", near_miss(name, known))
        column = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
        holes = np.flatnonzero(~np.isfinite(column))
        if len(holes):
            at = f"{path}: line {holes[0] + 2}, column {name}"
            raise BenchError(at, repr(str(frame[name].iloc[holes[0]])), "a finite number", "Fill the cell.")
        columns.append(column)
    times, values = columns
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if not len(times) or len(back):
        at = f"{path}: line {back[0] + 3}, column {given.time}" if len(back) else str(path)
        came = f"{times[back[0] + 1]:g} s after {times[back[0]]:g} s" if len(back) else "no rows"
        raise BenchError(at, came, "times that increase", "Sort the rows and drop repeated times.")
    return times, values

"""A campaign of another machine as its engineer would hand it over: records in some format, and a machine file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.trials.machines.campaign import MachineCampaign
    from pmg.pipeline.trials.machines.kinds import MadeMachine
    from pmg.pipeline.trials.machines.readings import MadeReadings
    from pmg.sim.signals import Array

NAMES = ("run_1", "run_2", "run_3")
"""Names of the records; the last is withheld."""

FORMATS = ("csv", "csv", "csv", "csv;", "parquet", "mat")
"""Formats that are drawn: with commas, with semicolons and decimal commas, and two that are no text."""

CLOCKS = ("even", "even", "even", "even", "pause", "stamps", "ms", "late")
"""Clocks that are drawn: even, with a pause of some seconds, with uncertain stamps, in ms, far from zero."""

MACHINE_FILE = "machine.toml"

_HEAD = """schema = "pmg.machine/1"
title = "Machine {number}"
source = "data sheet"
"""

_GEAR = """
[gear]
kind = "{kind}"
input = "first"
output = "second"
{numbers}
"""

_RECORDS = """
[records]
time = {{ name = "t", unit = "{unit}" }}
rate_Hz = {rate}
low_pass_Hz = {low_pass}
keep_every = {keep}
withheld = ["{withheld}*"]

[model]
baseline = ["inertia", "viscous", "coulomb"]
"""


def write_campaign(campaign: MachineCampaign, folder: Path) -> Path:
    """Records in a folder of their own, and the machine file, whose path is given back.

    Parameters
    ----------
    campaign : MachineCampaign
        What was drawn.
    folder : Path
        Folder that is made.
    """
    rng = np.random.default_rng(np.random.SeedSequence(campaign.seed, spawn_key=(5, campaign.number)))
    form, clock = str(rng.choice(FORMATS)), str(rng.choice(CLOCKS))
    records = folder / "records"
    records.mkdir(parents=True)
    for name, shown in zip(NAMES, campaign.records, strict=True):
        rows = _timed(_columns(campaign.machine, shown), clock, campaign.machine.rate, rng)
        _write(records / name, rows, form)
    path = folder / MACHINE_FILE
    path.write_text(_machine_text(campaign.machine, campaign.number, "ms" if clock == "ms" else "s"), encoding="utf-8")
    return path


def _machine_text(machine: MadeMachine, number: int, unit: str) -> str:
    """The machine file: what a data sheet says, rounded."""
    text = _HEAD.format(number=number)
    inertia = machine.plant.inertia
    two = bool(machine.ratio)
    if two:
        poles = f"pole_pairs_input = {_of(machine.poles[0])}\npole_pairs_output = {_of(machine.poles[1])}"
        numbers = poles if machine.kind == "magnetic" else f"ratio = {_of(machine.ratio)}"
        text += _GEAR.format(kind="magnetic" if machine.kind == "magnetic" else "rigid", numbers=numbers)
    text += "\n[shaft.first]\n" + ('moves = "slides"\n' if machine.kind == "slide" else "")
    kg = "kg" if machine.kind == "slide" else "kg m2"
    stated_inertia = inertia if machine.known_inertia else float(f"{inertia:.1g}")
    text += f'inertia = {{ value = {stated_inertia:.6g}, unit = "{kg}" }}\n\n[shaft.first.channel]\n'
    if machine.kind == "slide":
        text += 'position = { name = "x", unit = "mm" }\n'
        text += f'force = {{ name = "u", unit = "V", newton_per_unit = {machine.per_unit} }}\n'
    elif machine.kind == "joint":
        text += 'position = { name = "q", unit = "deg" }\n'
        text += f'torque = {{ name = "I", unit = "A", newton_metre_per_unit = {machine.per_unit} }}\n'
    else:
        text += 'velocity = { name = "n", unit = "rpm" }\n'
        text += "" if machine.kind == "wheel" else 'torque = { name = "T", unit = "N m" }\n'
    if two:
        text += '\n[shaft.second.channel]\nvelocity = { name = "n_out", unit = "rpm" }\n'
        text += 'torque = { name = "T_out", unit = "N m" }\n'
    text += _RECORDS.format(
        unit=unit, rate=machine.rate, low_pass=machine.low_pass, keep=machine.keep, withheld=NAMES[-1]
    )
    if machine.known_inertia and machine.kind != "wheel":
        text += f"fixed = {{ inertia = {inertia:.6g} }}\n"
    return text


def _of(value: float) -> str:
    return f'{{ value = {value:.10g}, unit = "1" }}'


def _columns(machine: MadeMachine, shown: MadeReadings) -> dict[str, Array]:
    """Channels in the units of the file."""
    if machine.kind == "slide":
        return {"t": shown.time, "x": 1e3 * shown.way, "u": shown.push / machine.per_unit}
    if machine.kind == "joint":
        return {"t": shown.time, "q": np.degrees(shown.way), "I": shown.push / machine.per_unit}
    found = {"t": shown.time, "n": shown.speed / RPM}
    if machine.kind != "wheel":
        found["T"] = shown.push
    if machine.ratio:
        found["n_out"] = shown.speed / RPM / machine.ratio
        found["T_out"] = shown.load * machine.ratio
    return found


def _timed(columns: dict[str, Array], clock: str, rate: int, rng: np.random.Generator) -> dict[str, Array]:
    """Channels with the times that a clock of that kind gives them."""
    time = columns["t"]
    if clock == "pause":
        begins = round(rng.uniform(0.35, 0.65) * len(time))
        kept = np.r_[0:begins, begins + round(rng.uniform(1.0, 3.0) * rate) : len(time)]
        return {name: values[kept] for name, values in columns.items()}
    if clock == "stamps":
        time = time + rng.uniform(-0.2, 0.2, len(time)) / rate
    elif clock == "ms":
        time = 1e3 * time
    elif clock == "late":
        time = time + 41_200.0
    return columns | {"t": time}


def _write(stem: Path, columns: dict[str, Array], form: str) -> None:
    if form == "parquet":
        import polars as pl

        pl.DataFrame(columns).write_parquet(stem.with_suffix(".parquet"))
    elif form == "mat":
        from scipy.io import savemat

        savemat(stem.with_suffix(".mat"), {name: values[:, None] for name, values in columns.items()})
    else:
        sign = ";" if form == "csv;" else ","
        lines = (sign.join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True))
        text = "\n".join(lines)
        text = text.replace(".", ",") if form == "csv;" else text
        stem.with_suffix(".csv").write_text(f"{sign.join(columns)}\n{text}\n", encoding="utf-8")

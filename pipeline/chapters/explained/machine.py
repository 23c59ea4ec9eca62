"""A machine's own chapters: what its file states beside what was found, its losses and its efficiency."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.findings import Severity
from pmg.pipeline.report.document import Cell, Chart, Column, Figure, Measured, Section, Series, Table, Text
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.balance.causes import NamedCause
    from pmg.pipeline.diagnosis.balance.machine.found_and_stated import FoundAndStated
    from pmg.pipeline.diagnosis.balance.machine.power import SteadyPoint
    from pmg.pipeline.machine.machine import Machine
    from pmg.pipeline.recording.remark import Remark

OF_READING = frozenset(("input_torque_gain", "output_torque_gain", "constant_offset"))
"""Terms that make the losses other than both torques as they were read say."""

MOST_CURVES = 8
"""Speeds or loads of which a figure draws a curve."""


def machine_sections(
    machine: Machine,
    points: tuple[SteadyPoint, ...],
    compared: tuple[FoundAndStated, ...],
    causes: tuple[NamedCause, ...] = (),
) -> tuple[Section, ...]:
    """Losses of a machine with two torques, and the numbers of its file beside those that were found."""
    return (*_power(machine, points, causes), *_stated(compared))


def readings_section(remarks: Sequence[Remark]) -> tuple[Section, ...]:
    """What was said of the recordings as they were read, but for what stands as a warning on top; none without any."""
    rows = tuple(dict.fromkeys((each.place, each.message) for each in remarks if each.severity == Severity.INFO))
    if not rows:
        return ()
    columns = (Column("place", "Where"), Column("message", "What"))
    table = Table(
        "readings", "As they were read", "Clocks, channels, and what takes no part in the fit.", columns, rows
    )
    return (Section("readings-section", "How the recordings were read", (table,)),)


def _stated(compared: tuple[FoundAndStated, ...]) -> tuple[Section, ...]:
    if not compared:
        return ()
    rows: list[tuple[Cell, ...]] = [
        (
            row.name,
            row.stated.unit,
            Measured(row.stated.value, math.nan if row.stated.u is None else row.stated.u),
            Measured(row.found, row.standard_error),
            None if math.isnan(row.apart) else row.apart,
            "they differ" if row.differs else "they agree" if not math.isnan(row.apart) else "no uncertainty stated",
            row.stated.source,
        )
        for row in compared
    ]
    table = Table(
        "machine-stated",
        "Stated and found",
        "What the machine file states, and what the records say with the named terms in the model.",
        (
            Column("number", "Number"),
            Column("unit", "Unit"),
            Column("stated", "Stated", uncertain=True),
            Column("found", "Found", uncertain=True),
            Column("apart", "Apart", "standard uncertainties", digits=1),
            Column("verdict", "Verdict"),
            Column("source", "Source"),
        ),
        tuple(rows),
    )
    return (Section("machine-stated-section", "The machine as stated and as found", (table,)),)


def _power(machine: Machine, points: tuple[SteadyPoint, ...], causes: tuple[NamedCause, ...]) -> tuple[Section, ...]:
    if machine.gear is None or not points:
        return ()
    one, other = machine.gear.input, machine.gear.output
    rows: list[tuple[Cell, ...]] = [
        (
            p.speed / RPM,
            p.torque_input,
            p.torque_output,
            Measured(p.loss, p.u_loss),
            p.u_repeat,
            None if math.isnan(p.efficiency) else Measured(100.0 * p.efficiency, 100.0 * p.u_efficiency),
            "above 1" if p.above_one else "",
            p.seconds,
            p.visits,
        )
        for p in points
    ]
    table = Table(
        "machine-losses",
        "Losses and efficiency",
        "Means over the stretches in which speed and torque hold still. The first uncertainty is that by repetition "
        "and the tolerances of both transducers, which all points share; the second that by repetition alone.",
        (
            Column("speed", f"Speed of {one}", "rpm", digits=1),
            Column("torque_input", f"Torque of {one}", "N m", digits=3),
            Column("torque_output", f"Torque of {other}", "N m", digits=3),
            Column("loss", "Loss", "W", uncertain=True),
            Column("repeat", "by repetition", "W", digits=3),
            Column("efficiency", "Efficiency", "%", uncertain=True),
            Column("remark", "Remark"),
            Column("seconds", "Time", "s", digits=1),
            Column("visits", "Visits"),
        ),
        tuple(rows),
    )
    odd = [p for p in points if p.above_one]
    text = f"{len(points)} operating points."
    if odd:
        text += f" At {len(odd)} of them the efficiency lies above 1: an instrument, a sign or the ratio is wrong."
    if all("transducer.tolerance" not in end.numbers for end in machine.ends):
        text += " The machine file states no tolerance of a transducer: uncertainties are those by repetition alone."
    if doubts := [cause for cause in causes if cause.identifier in OF_READING]:
        groups = [[c for c in doubts if c.group == k] for k in sorted({c.group for c in doubts})]
        sets = (" and ".join(f"{uncapitalised(c.title)}, {c.remark or c.size}" for c in each) for each in groups)
        text += f" The verdict is not taken out of these torques: {'; or '.join(sets)}. Losses are off by that."
    return (
        Section("machine-power-section", "Losses and efficiency", (Text(text), _figure(points, one, other), table)),
    )


def _figure(points: tuple[SteadyPoint, ...], one: str, other: str) -> Figure:
    speed = np.array([abs(p.speed) / RPM for p in points])
    load = np.array([abs(p.torque_output) for p in points])
    loss, u_loss = np.array([p.loss for p in points]), np.array([p.u_loss for p in points])
    share, u_share = (100.0 * np.array([getattr(p, k) for p in points]) for k in ("efficiency", "u_efficiency"))
    told = np.isfinite(share)
    by_speed = Chart(
        f"speed of {one} [rpm]", "loss [W]", (Series("", speed, loss, 2.0 * u_loss, "markers", 0),), title="Loss"
    )
    curves = []
    for colour, level in enumerate(_levels(speed)):
        rows = told & (np.abs(speed - level) < 0.03 * float(speed.max()))
        order = np.flatnonzero(rows)[np.argsort(load[rows])]
        curves.append(Series(f"{level:.0f} rpm", load[order], share[order], 2.0 * u_share[order], "markers", colour))
    by_load = Chart(f"torque of {other} [N m]", "efficiency [%]", tuple(curves), title="Efficiency")
    return Figure("machine-power", "Losses and efficiency", "Bars: 95 %.", (by_speed, by_load))


def _levels(values: np.ndarray) -> list[float]:
    """Values that stand for those near them, at most `MOST_CURVES`."""
    found: list[float] = []
    for value in np.sort(values):
        if not found or value - found[-1] > 0.03 * float(values.max()):
            found.append(float(value))
    return found[:MOST_CURVES]

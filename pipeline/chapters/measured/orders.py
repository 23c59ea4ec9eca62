"""Chapter on orders: what repeats with the turn of a shaft, what it follows, how far the gear is wound up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.orders import band, flux, load_angle
from pmg.pipeline.orders.angle import RESAMPLING_SOURCE
from pmg.pipeline.orders.statement import unit_of
from pmg.pipeline.orders.survey import NOTHING_FOLLOWED
from pmg.pipeline.report.document import Chart, Column, Figure, Measured, Section, Series, Table, Text
from pmg.pipeline.wording.units import MILLI
from pmg.sim.signals import SPEED_RING, SPEED_SUN, TORQUES

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl

    from pmg.pipeline.orders.example import Example
    from pmg.pipeline.orders.survey import LineSurvey, UncertainValue
    from pmg.pipeline.report.table import Cell
    from pmg.sim.signals import Array

SPEEDS = {"torque_sun": SPEED_SUN, "torque_ring": SPEED_RING}


def orders_section(
    followed: Sequence[LineSurvey],
    table: pl.DataFrame,
    angles: Sequence[dict[str, Any]],
    example: Example | None,
) -> Section:
    """Order analysis of a campaign.

    Parameters
    ----------
    followed : sequence of LineSurvey
        Lines of the campaign.
    table : polars.DataFrame
        Lines of all accepted points, with their speeds.
    angles : sequence of dict
        Load angles.
    example : Example or None
        One window to be shown whole.
    """
    present = [line for line in followed if line.present]
    items: list[Text | Table | Figure] = [
        Text(
            "Lines of both shafts are fitted together at the samples of each window. A line is present where more "
            "points exceed the band of the noise than chance gives, corrected for multiple testing. Where it is not, "
            "no mechanism is named: an effect below the band cannot be distinguished from none."
        )
    ]
    if present:
        items.append(_present(present, len(followed)))
        items += _growth(present, table)
    else:
        none = f"None of {len(followed)} lines is beyond its band." if followed else f"{NOTHING_FOLLOWED}.".capitalize()
        items.append(Text(none, "finding"))
    if example is not None:
        items += [_spectrum(example), _turn(example)]
    if angles:
        items.append(_angles(angles))
    sources = (band.SOURCE, RESAMPLING_SOURCE, flux.SOURCE, load_angle.SOURCE)
    return Section("orders", "Order analysis", tuple(items), sources)


def _measured(given: UncertainValue | None, scale: float = 1.0) -> Cell:
    if given is None or math.isnan(given.value):
        return None
    return Measured(given.value / scale, given.u / scale)


def _present(present: Sequence[LineSurvey], tried: int) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for line in present:
        unit, scale = unit_of(line.signal)
        rows.append(
            (
                line.signal.replace("_", " "),
                line.line,
                f"{line.configuration}, gear {line.gear}",
                "" if line.belongs is None else line.belongs.mechanism.replace("_", " "),
                _measured(line.amplitude, scale),
                unit,
                line.band / scale,
                f"{line.beyond} of {line.points}",
                _measured(line.exponent),
                _measured(line.per_load, scale),
            )
        )
    named = sum(line.belongs is not None for line in present)
    return Table(
        "order-lines",
        "Lines that are present",
        f"{len(present)} of {tried} lines are beyond what noise gives; {named} have the order and the growth of a "
        "mechanism of the catalogue.",
        (
            Column("signal", "Signal"),
            Column("line", "Line"),
            Column("where", "Where"),
            Column("mechanism", "Order and growth of"),
            Column("amplitude", "Amplitude", uncertain=True),
            Column("unit", "Unit"),
            Column("band", "Noise band (median)", digits=3),
            Column("beyond", "Points beyond"),
            Column("exponent", "Power of speed", uncertain=True),
            Column("per_load", "Growth per N m of load", uncertain=True),
        ),
        tuple(rows),
    )


def _growth(present: Sequence[LineSurvey], table: pl.DataFrame) -> list[Figure]:
    """Amplitudes against speed, of the torque lines that are present in most points."""
    import polars as pl

    panels = []
    for signal in TORQUES:
        lines = [line for line in present if line.signal == signal.name and line.beyond > line.points / 2]
        chosen = sorted(lines, key=lambda line: -line.points)[:6]
        series = []
        for colour, line in enumerate(chosen):
            part = table.filter(
                pl.col("amplitude").is_not_null(),
                signal=line.signal,
                line=line.line,
                configuration=line.configuration,
                gear=line.gear,
            )
            speed = np.abs(SPEEDS[signal.name].display(part[SPEEDS[signal.name].name].to_numpy()))
            name = f"{line.line}, {line.configuration}"
            amplitude, u = (part[column].to_numpy() / MILLI for column in ("amplitude", "u"))
            series.append(_by_speed(name, speed, amplitude, u, colour))
        if series:
            label = f"amplitude in the {signal.meaning} [mN m]"
            panels.append(Chart(SPEEDS[signal.name].label, label, tuple(series), title=signal.meaning))
    if not panels:
        return []
    growing = [line for line in present if line.exponent is not None and line.exponent.value > 2.0 * line.exponent.u]
    torque = sum(line.signal.startswith("torque") and line.exponent.value > 0.2 for line in growing if line.exponent)
    return [
        Figure(
            "order-growth",
            "Amplitude against speed",
            f"{torque or 'No'} lines of torque grow with speed to a power above 0.2. Means of the points at one "
            "speed; bars are 2 u.",
            tuple(panels),
            columns=2,
        )
    ]


def _by_speed(name: str, speed: Array, amplitude: Array, u: Array, colour: int) -> Series:
    """Means of the points at one speed; their scatter counts where it is more than their noise."""
    places = np.unique(np.round(speed))
    rows = []
    for place in places:
        here = np.round(speed) == place
        count = int(np.count_nonzero(here))
        scatter = float(amplitude[here].std(ddof=1)) if count > 1 else 0.0
        rows.append((amplitude[here].mean(), max(float(np.sqrt((u[here] ** 2).mean())), scatter) / math.sqrt(count)))
    mean, uncertainty = np.array(rows).T
    return Series(name, places, mean, uncertainty, style="both", colour=colour)


def _spectrum(example: Example) -> Figure:
    panels = []
    for place, shaft in enumerate(example.shafts):
        shown = shaft.orders > 0.0
        curve = Series("", shaft.orders[shown], shaft.magnitudes[shown] / MILLI, style="line", colour=place)
        panels.append(Chart(f"order of the {shaft.side}", "amplitude [mN m]", (curve,), title=shaft.side, y_log=True))
    highest = {s.side: float(s.orders[1:][np.argmax(s.magnitudes[1:])]) for s in example.shafts if len(s.orders) > 1}
    text = ", ".join(f"{order:.2f} ({side})" for side, order in highest.items())
    return Figure(
        "order-spectrum",
        "Order spectrum of a point",
        f"Torque of point {example.point} over equal steps of its shaft's angle: highest at order {text}.",
        tuple(panels),
        columns=2,
    )


def _turn(example: Example) -> Figure:
    panels = []
    for place, shaft in enumerate(example.shafts):
        turn = shaft.turn
        swing = (turn.mean - turn.mean.mean()) / MILLI
        degrees = np.degrees(shaft.angle)
        series = (
            Series("U = 2u", degrees, swing, turn.u / MILLI, style="band", colour=place),
            Series("average", degrees, swing, style="line", colour=place),
        )
        panels.append(
            Chart(f"angle of the {shaft.side} [deg]", "torque less its mean [mN m]", series, title=shaft.side)
        )
    text = ", ".join(
        f"{np.ptp(s.turn.mean) / MILLI:.1f} mN m over {s.turn.turns} turns ({s.side})" for s in example.shafts
    )
    return Figure(
        "order-turn",
        "The average turn",
        f"From the lowest to the highest torque of the average turn of point {example.point}: {text}.",
        tuple(panels),
        columns=2,
    )


def _angles(angles: Sequence[dict[str, Any]]) -> Table:
    indexed = sum(bool(angle["from_index"]) for angle in angles)
    rows: list[tuple[Cell, ...]] = [
        (
            angle["point"],
            angle["torque_ring_Nm"],
            Measured(angle["angle"], math.nan if angle["u"] is None else angle["u"]) if angle["from_index"] else None,
            angle["u_index"] if angle["from_index"] else None,
            angle["swing"],
            "index pulses" if angle["from_index"] else "this file's counts",
            angle["slipped"],
        )
        for angle in angles
    ]
    return Table(
        "order-load-angles",
        "Load angle",
        f"{len(angles)} engaged windows, {indexed} of them with index pulses of both shafts and so with a common zero. "
        "Only a change is a measurement, and without a common zero only that within the window; twist of the shafts is "
        "part of it.",
        (
            Column("point", "Point"),
            Column("torque_ring", "Ring torque", "N m", digits=3),
            Column("angle", "Load angle", "rad", uncertain=True),
            Column("u_index", "u by the index", "rad", digits=4),
            Column("swing", "Swing in the window", "rad", digits=4),
            Column("zero", "Zero from"),
            Column("slipped", "Poles slipped", digits=2),
        ),
        tuple(rows),
    )

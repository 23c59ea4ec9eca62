"""Chapter on the torque map: what the magnetic gear can carry, and where its points lie on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import names_of
from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.report.document import Chart, Facts, Figure, Section, Series, Text
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.plurals import counted
from pmg.sim import sources
from pmg.sim.errors import BenchError
from pmg.sim.maps.analytic import analytic_map

if TYPE_CHECKING:
    from pmg.sim.grid import Grid
    from pmg.sim.maps.torque_map import TorqueMap
    from pmg.sim.signals import Array, Mask
    from pmg.sim.steady.gearbox import Gearbox

DRAWN = 91
"""Angles at which the map is drawn."""


def torque_map_sections(gearbox: Gearbox, grid: Grid) -> tuple[Section, ...]:
    """The chapter for the engaged points of a grid, a panel for each gear; none where no pull-out torque is known.

    Parameters
    ----------
    gearbox : Gearbox
        Gives the torque that each rotor passes on.
    grid : Grid
        Engaged points only.
    """
    at = grid.points
    carried = gearbox.transmitted(at)
    panels, facts = list[Chart](), list[tuple[str, str]]()
    slipped = 0
    for stage in np.unique(at.gear):
        gear = gearbox.bench.gear(int(stage))
        try:
            torque_map = analytic_map(gear)
            limit = torque_map.pull_out
        except BenchError:
            continue
        rows = np.asarray(at.gear == stage)
        within = rows & (carried > limit.torque_low) & (carried < limit.torque_high)
        slipped += int((rows & ~within).sum())
        most = float(np.abs(carried[rows]).max())
        share = f"{numerals.number(100.0 * most / limit.torque_high, 1)} %"
        facts.append((f"Gear {stage}: pull-out torque of the sun [N m]", numerals.number(limit.torque_high, 2)))
        facts.append(
            (
                f"Gear {stage}: largest torque carried by the sun [N m]",
                f"{numerals.number(most, 3)}, {share} of the pull-out",
            )
        )
        panels.extend(
            _panels(
                torque_map, grid, np.asarray(within), carried, f"Gear {stage}: " if len(np.unique(at.gear)) > 1 else ""
            )
        )
    if not panels:
        return ()
    beyond = (
        (Text(f"{counted(slipped, 'point')} carry more than the pull-out torque and are not drawn.", kind="warning"),)
        if slipped
        else ()
    )
    figure = Figure(
        "torque-map",
        "Torque map and working points",
        f"Torque that the field passes to the sun against the electrical angle between the rotors; the "
        f"largest is {facts[1][1]}. The map is a sine through the published pull-out torques: the source draws "
        "maps, but prints their peaks only. Beyond the pull-out the rotors slip; the grey branch is unstable."
        + (" Figure 5.7 of the source, along one line." if grid.origin == "published" else ""),
        tuple(panels),
        columns=2,
    )
    return (
        Section(
            "torque-map-points",
            "Torque map",
            (Facts(tuple(facts)), *beyond, figure),
            (sources.THESIS.at("section 5.2.1"),),
        ),
    )


def _panels(torque_map: TorqueMap, grid: Grid, within: Mask, carried: Array, title: str) -> tuple[Chart, Chart]:
    """The whole map, and the part of it that the points lie on."""
    limit, at = torque_map.pull_out, grid.points
    around = 0.5 * (limit.phase_high - limit.phase_low)
    stable = np.linspace(limit.phase_low, limit.phase_high, DRAWN)
    before, after = stable[: DRAWN // 2] - around, stable[-(DRAWN // 2) :] + around
    slipping = np.concatenate([before, [np.nan], after])
    ends = np.array([limit.phase_low, limit.phase_high])
    curve = Series("stable", np.degrees(stable), torque_map.mean_torque(stable)[0], None, "line", 0)
    points = []
    for i, (load, rows) in enumerate(by_load(at)):
        shown = np.asarray(rows & within)
        if shown.any():
            angle = np.degrees(torque_map.load_angle(carried[shown]))
            points.append(Series(load, angle, carried[shown], None, "markers", i + 2, points=names_of(at.name[shown])))
    whole = (
        curve,
        Series("unstable", np.degrees(slipping), torque_map.mean_torque(slipping)[0], None, "line", 7),
        Series("pull-out", np.degrees(ends), np.array([limit.torque_low, limit.torque_high]), None, "markers", 1),
        *points,
    )
    labels = "electrical angle [degrees]", "torque on the sun [N m]"
    across = _around([s.x for s in points])
    low, high = (limit.phase_low, limit.phase_high) if across is None else np.clip(np.radians(across), *ends)
    near = np.linspace(float(low), float(high), DRAWN)
    shown_part = Series("stable", np.degrees(near), torque_map.mean_torque(near)[0], None, "line", 0)
    detail = Chart(*labels, (shown_part, *points), (("", 0.0),), "Load", f"{title}working points", across)
    return Chart(*labels, whole, (("", 0.0),), title=f"{title}whole map"), detail


def _around(values: list[Array]) -> tuple[float, float] | None:
    """Axis from zero to a little beyond the values."""
    if not values:
        return None
    every = np.concatenate([*values, [0.0]])
    margin = 0.15 * float(np.ptp(every))
    return float(every.min()) - margin, float(every.max()) + margin

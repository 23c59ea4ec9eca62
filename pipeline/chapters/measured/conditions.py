"""Chapter on the conditions of the test, and the one on what was measured: the grids."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.cells import names_of
from pmg.pipeline.grid.conditions import NOT_RECORDED, UNRECORDED
from pmg.pipeline.report.document import Chart, Facts, Figure, Section, Series, Text
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pmg.pipeline.grid.conditions import Conditions
    from pmg.sim.grid import Grid


def conditions_section(conditions: Conditions, note: str) -> Section:
    """Under which conditions the campaign was run; what nobody wrote down is named as such."""
    rows = (*conditions.rows, ("Note", note or "none"))
    missing = sum(value == NOT_RECORDED for _, value in rows)
    text = (
        f"{missing} of {len(rows)} conditions are not recorded. Those that move the losses, "
        f"{UNRECORDED[1].lower()} and {UNRECORDED[2].lower()} before all, are the first suspects when tests of "
        "different days differ."
    )
    items = (Facts(rows), *((Text(text, kind="note"),) if missing else ()))
    return Section("conditions", "Test conditions", items)


def grids_section(grid: Grid, *, opens: bool) -> Section:
    """Where the bench was measured: accepted and rejected points; `opens` says that the page holds their signals."""
    at = grid.points
    neutral = (
        ("neutral, accepted", at.neutral & grid.accepted, 0),
        ("neutral, rejected", at.neutral & ~grid.accepted, 1),
    )
    engaged = (
        ("engaged, accepted", at.engaged & grid.accepted, 2),
        ("engaged, rejected", at.engaged & ~grid.accepted, 1),
    )
    panels = []
    for chosen, y, y_label, title in (
        (neutral, SPEED_SUN.display(at.speed_sun), SPEED_SUN.label, "Neutral: sun speed over ring speed"),
        (engaged, SPEED_SUN.display(at.speed_sun), SPEED_SUN.label, "Engaged: sun speed over load"),
    ):
        x = SPEED_RING.display(at.speed_ring) if chosen is neutral else np.asarray(at.load_set)
        x_label = SPEED_RING.label if chosen is neutral else "load asked for [N m]"
        series = tuple(
            Series(name, x[rows], y[rows], None, "markers", colour, points=names_of(at.name[rows]))
            for name, rows, colour in chosen
            if rows.any()
        )
        if series:
            panels.append(Chart(x_label, y_label, series, title=title))
    rejected = int((~grid.accepted).sum())
    text = (
        f"{int(at.neutral.sum())} neutral and {int(at.engaged.sum())} engaged points, {int(at.zero.sum())} zero "
        f"checks; {rejected} rejected."
        + (" Each point opens its signals, its spectrum and its uncertainty budget." if opens else "")
    )
    if not panels:
        return Section("grids", "Measured grids", (Text(text),))
    return Section(
        "grids", "Measured grids", (Figure("grid-points", "Points of the campaign", text, tuple(panels), columns=2),)
    )

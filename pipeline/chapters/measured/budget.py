"""The part of the chapter on data that says what a mean torque is uncertain by, and how windows were judged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.budget_document import median, shown_point, typical_rows
from pmg.pipeline.report.document import Column, Facts, Table, Text
from pmg.pipeline.windows.limits import SPEEDS
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.units import MILLI
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.grid.contributions import Contribution, ShaftBudget
    from pmg.pipeline.grid.window_facts import LimitSet
    from pmg.pipeline.report.table import Cell

MOST_NAMED = 12
"""Windows that are named one by one."""


def budget_items(budget: Budget) -> tuple[Text | Table | Facts, ...]:
    """The budget of one point and its median over the campaign; nothing where no point was accepted.

    Parameters
    ----------
    budget : Budget
        Of the points of a grid.
    """
    row = shown_point(budget)
    if row is None:
        return ()
    return (_words(budget, row), _table(budget, row), _grounds(budget), *_windows(budget))


def _words(budget: Budget, row: int) -> Text:
    at = budget.grid.points
    rows = typical_rows(budget) & (at.engaged == at.engaged[row]) & (at.drive == at.drive[row])
    what = f"engaged points that the {at.drive[row]} drives" if at.engaged[row] else "neutral points"
    means = [shaft.of_mean(rows) for shaft in budget]
    parts = [
        f"{shaft.side}: independent {independent / MILLI:.2f} mN m, common {common / MILLI:.2f} mN m"
        for shaft, (independent, common) in zip(budget, means, strict=True)
    ]
    return Text(
        "What the mean torque of a point is uncertain by. Independent contributions differ from point to point and "
        "average out over points; common ones are shared by all readings of a transducer and do not. In the mean "
        f"torque of the {int(rows.sum())} {what} they are, as standard uncertainties, {'; '.join(parts)}."
    )


def _table(budget: Budget, row: int) -> Table:
    sun, ring = budget
    typical = typical_rows(budget)
    lines: list[tuple[Cell, ...]] = []
    for s, r in zip(sun.contributions, ring.contributions, strict=True):
        values = [_milli(c.u[row]) for c in (s, r)] + [_milli(median(c.u[typical])) for c in (s, r)]
        kind = "common" if s.common else "independent"
        lines.append((s.name, _evaluated(s, row), *values, _dof(s, r, row), kind))
    for name, kind, of_sun, of_ring in (
        ("independent", "independent", sun.independent, ring.independent),
        ("common", "common", sun.common, ring.common),
        ("together", "both", sun.u, ring.u),
        ("expanded, 95 %", "both", sun.expanded, ring.expanded),
    ):
        values = [_milli(u[row]) for u in (of_sun, of_ring)] + [_milli(median(u[typical])) for u in (of_sun, of_ring)]
        dof = _pair(sun.dof[row], ring.dof[row]) if kind == "both" else None
        lines.append((name, None, *values, dof, kind))
    caption = (
        f"At {budget.grid.points.name[row]} the torques are {sun.torque[row]:.4f} ± {sun.expanded[row]:.4f} N m (sun) "
        f"and {ring.torque[row]:.4f} ± {ring.expanded[row]:.4f} N m (ring), expanded to 95 %; "
        f"{_largest(sun, row)} is the largest contribution at the sun, {_largest(ring, row)} at the ring."
    )
    return Table(
        id="budget",
        title="Uncertainty of a mean torque",
        caption=caption,
        columns=(
            Column("contribution", "Contribution"),
            Column("evaluated", "Evaluated"),
            Column("u_sun", "u sun, this point", "mN m", digits=3),
            Column("u_ring", "u ring, this point", "mN m", digits=3),
            Column("median_u_sun", "u sun, median", "mN m", digits=3),
            Column("median_u_ring", "u ring, median", "mN m", digits=3),
            Column("dof", "Degrees of freedom"),
            Column("shared", "Over points"),
        ),
        rows=tuple(lines),
    )


def _evaluated(contribution: Contribution, row: int) -> str:
    """Type of the evaluation, and distribution and divisor where the contribution is known."""
    if np.isnan(contribution.u[row]):
        return contribution.kind
    divisor = "" if contribution.divisor == 1.0 else f" / {contribution.divisor:.3f}"
    return f"{contribution.kind}, {contribution.distribution}{divisor}"


def _grounds(budget: Budget) -> Facts:
    """Where each contribution comes from."""
    rows = []
    for s, r in zip(budget.sun.contributions, budget.ring.contributions, strict=True):
        rows.append((s.name.capitalize(), s.remark if s.remark == r.remark else f"{s.remark} (ring: {r.remark})"))
    return Facts(tuple((name, remark) for name, remark in rows if remark))


def _windows(budget: Budget) -> tuple[Text | Table, ...]:
    if budget.facts is None:
        return ()
    flagged = budget.grid.points.name[budget.facts.correlated]
    items: list[Text | Table] = []
    if len(flagged):
        named = ", ".join(map(str, flagged[:MOST_NAMED])) + (" ..." if len(flagged) > MOST_NAMED else "")
        points = f"At {len(flagged)} of {counted(len(budget.grid), 'point')}"
        if budget.facts.correlated_by_chance:
            items.append(Text(f"{points} noise looks slow, as it does by chance in as many: {named}."))
        else:
            slow = f"{points} low-frequency noise makes the mean less certain: {named}. Use longer windows."
            items.append(Text(slow, kind="warning"))
    sets = budget.facts.limits
    if len(sets) > 1:
        words = f"Windows were judged by {len(sets)} sets of limits: ingest all recordings by one to compare like."
        items.append(Text(words, kind="warning"))
    items += [_limits_table(each, number, len(sets)) for number, each in enumerate(sets, 1)]
    return tuple(items)


def _limits_table(of: LimitSet, number: int = 1, sets: int = 1) -> Table:
    """A set of limits by which windows were judged, speeds in rpm.

    Parameters
    ----------
    of : LimitSet
        As the store keeps them, in SI.
    number, sets : int
        Which one it is, from 1, and of how many.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, value in sorted(of.limits.items()):
        speed = name in SPEEDS
        unit = "rpm" if speed else LIMIT_UNITS.get(name, "")
        rows.append((name, value / RPM if speed else value, unit))
    return Table(
        id="window-limits" + (f"-{number}" if number > 1 else ""),
        title="Limits by which windows were judged" + (f", set {number} of {sets}" if sets > 1 else ""),
        caption=(f"{of.windows} windows of {of.recordings} recordings: " if sets > 1 else "")
        + f"{len(rows)} limits, fixed before any window was looked at; no window was chosen for its figures.",
        columns=(Column("limit", "Limit"), Column("value", "Value", format=".6g"), Column("unit", "Unit")),
        rows=tuple(rows),
    )


LIMIT_UNITS = {
    "completeness": "of the length announced",
    "speed_change_relative": "of the speed",
    "speed_offset_relative": "of the set-point",
    "counts": "encoder counts",
    "torque_drift": "of the nominal torque",
    "torque_drift_sigmas": "standard errors",
    "step_torque": "of the nominal torque",
    "shortest": "s",
    "settle": "s",
    "step_beside": "s",
    "frequency_low": "Hz",
    "frequency_high": "Hz",
}


def _milli(value: float) -> float | None:
    return None if math.isnan(value) else float(value) / MILLI


def _pair(sun: float, ring: float) -> str:
    shown = [_whole(value) for value in (sun, ring)]
    return shown[0] if shown[0] == shown[1] else f"{shown[0]}, {shown[1]}"


def _whole(value: float) -> str:
    return "not known" if math.isnan(value) else "∞" if value > 1e6 else f"{value:.0f}"


def _dof(sun: Contribution, ring: Contribution, row: int) -> str | None:
    return None if np.isnan(sun.u[row]) else _pair(float(sun.dof[row]), float(ring.dof[row]))


def _largest(shaft: ShaftBudget, row: int) -> str:
    return max(shaft.contributions, key=lambda c: float(np.nan_to_num(c.u[row]))).name

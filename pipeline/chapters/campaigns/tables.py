"""Tables of two campaigns side by side: conditions, constants, points, and points without a partner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.conditions import NOT_RECORDED, conditions
from pmg.pipeline.grid.levels import by_speed
from pmg.pipeline.report.document import Column, Measured, Table
from pmg.pipeline.wording.plurals import counted
from pmg.sim.signals import RESIDUAL, SPEED_RING, SPEED_SUN, TORQUE_RING, TORQUE_SUN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.campaign_comparison.constants import ConstantDifference
    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.matching import Unmatched
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.report.document import Cell
    from pmg.sim.signals import Signal


def conditions_table(versus: Versus) -> Table:
    """Conditions of both campaigns, and which differ."""
    rows: list[tuple[Cell, ...]] = []
    of_a, of_b = (dict(conditions(side.manifests).rows) for side in (versus.a, versus.b))
    for label in dict.fromkeys((*of_a, *of_b)):
        value, other = (of_side.get(label, NOT_RECORDED) for of_side in (of_a, of_b))
        silent = NOT_RECORDED in (value, other)
        rows.append((label, value, other, "not known" if silent else "differs" if value != other else "same"))
    for label, words in (
        ("Origin", [side.grid.origin for side in (versus.a, versus.b)]),
        ("Points accepted", [f"{int(s.grid.accepted.sum())} of {len(s.grid)}" for s in (versus.a, versus.b)]),
    ):
        rows.append((label, *words, "differs" if words[0] != words[1] else "same"))
    unknown = sum(row[3] == "not known" for row in rows)
    return Table(
        "conditions-of-both",
        "Conditions of both campaigns",
        f"{unknown} of {len(rows)} conditions are not known of both; lubricant and temperatures are the first suspects "
        "when tests of different days differ.",
        (Column("condition", "Condition"), Column("a", "A"), Column("b", "B"), Column("compared", "Compared")),
        tuple(rows),
    )


def constants_table(constants: tuple[ConstantDifference, ...]) -> Table:
    """Constants of both calibrations, and their difference."""
    rows: list[tuple[Cell, ...]] = []
    beyond: int = 0
    for one in constants:
        known = bool(np.isfinite(one.u))
        out = known and not one.state and abs(one.value) > 2.0 * one.u
        beyond += int(out)
        rows.append(
            (
                one.name,
                one.unit,
                Measured(one.a, one.u_a) if np.isfinite(one.u_a) else one.a,
                Measured(one.b, one.u_b) if np.isfinite(one.u_b) else one.b,
                Measured(one.value, one.u) if known else one.value,
                one.own if known else None,
                one.common if known else None,
                one.state or ("beyond U" if out else "within U"),
            )
        )
    return Table(
        "fitted-constants",
        "Fitted constants of both",
        f"{counted(beyond, 'constant')} beyond U = 2u. The scatter of the readings is independent; the common part is "
        "what the transducers' tolerances leave.",
        (
            Column("constant", "Constant"),
            Column("unit", "Unit"),
            Column("a", "A"),
            Column("b", "B"),
            Column("difference", "B − A", uncertain=True),
            Column("u_independent", "u, independent", format=".2g"),
            Column("u_common", "u, common left", format=".2g"),
            Column("judged", "Judged"),
        ),
        tuple(rows),
    )


def point_table(versus: Versus, shown: Mapping[str, Signal]) -> Table:
    """Every matched point: both values, the difference, and whether it is beyond U."""
    at, partners = versus.at, versus.b.grid.points.name[versus.matching.b]
    columns = [
        Column("point", "Point of A"),
        Column("partner", "Point of B"),
        Column("configuration", "Configuration"),
        Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
        Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=1),
        Column("load_set", "load asked for", "N m", digits=2),
    ]
    signals = {"torque_sun": TORQUE_SUN, "torque_ring": TORQUE_RING, **shown}
    for name in versus.quantities:
        signal, difference = signals[name], shown.get(name, RESIDUAL)
        columns += [
            Column(f"{name}_a", f"{signal.meaning}, A", signal.display_unit, digits=4),
            Column(f"{name}_b", f"{signal.meaning}, B", signal.display_unit, digits=4),
            Column(f"{name}_difference", "B − A", difference.display_unit, uncertain=True),
            Column(f"{name}_u_independent", "u without common part", difference.display_unit, format=".2g"),
            Column(f"{name}_judged", "judged"),
        ]
    rows: list[tuple[Cell, ...]] = []
    for i in by_speed(at):
        row: list[Cell] = [
            str(at.name[i]),
            str(partners[i]),
            str(at.configuration[i]),
            float(SPEED_SUN.display(at.speed_sun[i])),
            float(SPEED_RING.display(at.speed_ring[i])),
            float(at.load_set[i]),
        ]
        for name, found in versus.quantities.items():
            if not found.compared[i]:
                row += [None] * 5
                continue
            signal, difference = signals[name], shown.get(name, RESIDUAL)
            row += [
                float(signal.display(found.a[i])),
                float(signal.display(found.b[i])),
                Measured(float(difference.display(found.value[i])), float(found.u[i]) / difference.scale),
                float(found.own[i]) / difference.scale,
                "beyond U" if found.beyond[i] else "within U",
            ]
        rows.append(tuple(row))
    return Table(
        "versus-by-point",
        "A and B, by point",
        f"{counted(len(rows), 'matched point')}. B − A is at the speeds and load of A; its u holds both parts. "
        "Engaged, the ring torque is the load that was applied, an input.",
        tuple(columns),
        tuple(rows),
    )


def unmatched_table(side: CampaignSide, other: CampaignSide, left: tuple[Unmatched, ...]) -> Table:
    """Points of one campaign without a partner, each with what comes nearest."""
    at = side.grid.points
    rows: list[tuple[Cell, ...]] = [
        (
            str(at.name[one.row]),
            str(at.configuration[one.row]),
            float(SPEED_SUN.display(at.speed_sun[one.row])),
            float(SPEED_RING.display(at.speed_ring[one.row])),
            float(at.load_set[one.row]),
            None if one.nearest is None else str(other.grid.points.name[one.nearest]),
            float(SPEED_SUN.display(one.speed_sun)),
            float(SPEED_RING.display(one.speed_ring)),
            one.load,
            one.why,
        )
        for one in left
    ]
    return Table(
        f"only-{side.label.lower()}",
        f"Only in {side.name}",
        f"{counted(len(rows), 'point')} without a partner in {other.name}, and the nearest of its kind there.",
        (
            Column("point", "Point"),
            Column("configuration", "Configuration"),
            Column("speed_sun", SPEED_SUN.meaning, SPEED_SUN.display_unit, digits=1),
            Column("speed_ring", SPEED_RING.meaning, SPEED_RING.display_unit, digits=1),
            Column("load_set", "load asked for", "N m", digits=3),
            Column("nearest", f"Nearest in {other.label}"),
            Column("apart_sun", "sun speed apart", SPEED_SUN.display_unit, digits=1),
            Column("apart_ring", "ring speed apart", SPEED_RING.display_unit, digits=1),
            Column("apart_load", "load apart", "N m", digits=3),
            Column("why", "Why"),
        ),
        tuple(rows),
    )

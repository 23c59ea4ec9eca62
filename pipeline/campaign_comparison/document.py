"""A comparison of two campaigns as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.campaign_comparison.statement import alike, statement
from pmg.pipeline.files.json_values import with_nulls

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.constants import ConstantDifference
    from pmg.pipeline.campaign_comparison.difference import PointDifference, Versus
    from pmg.pipeline.campaign_comparison.family import LinearEstimate
    from pmg.pipeline.campaign_comparison.matching import Unmatched
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.campaign_comparison.verdict import ComparisonVerdict, GroupResult
    from pmg.sim.grid import Grid

SCHEMA = "pmg.versus/1"


def versus_document(
    versus: Versus, judged: ComparisonVerdict | None, constants: tuple[ConstantDifference, ...]
) -> dict[str, Any]:
    """The comparison in SI units; B minus A throughout, each with both parts of its standard uncertainty."""
    at, partners = versus.at, versus.b.grid.points.name[versus.matching.b]
    points = [
        {
            "a": str(at.name[i]),
            "b": str(partners[i]),
            "configuration": str(at.configuration[i]),
            "gear": int(at.gear[i]),
            "drive": str(at.drive[i]),
            "speed_sun": float(at.speed_sun[i]),
            "speed_ring": float(at.speed_ring[i]),
            "load_set": float(at.load_set[i]),
            "differences": {name: _point(q, i) for name, q in versus.quantities.items() if q.compared[i]},
        }
        for i in range(len(at))
    ]
    shared = versus.shared
    return {
        "schema": SCHEMA,
        "a": _side(versus.a),
        "b": _side(versus.b),
        "tolerances": {"speed": versus.matching.reach.speed, "load": versus.matching.reach.load},
        "transducers": {"sun_same": shared.sun, "ring_same": shared.ring, "told": shared.description},
        "set_points_corrected": versus.corrected,
        "statement": statement(versus, judged),
        "p_value": None if judged is None else judged.p_value,
        "p_value_of_readings": None if judged is None else judged.p_readings,
        "draws": None if judged is None else judged.draws,
        "groups": [] if judged is None else [_group(group) for group in judged.groups],
        "means": [mean_document(versus, name, kind) for name, kind in kinds_compared(versus)],
        "constants": [with_nulls(asdict(one) | {"difference": one.value, "u": one.u}) for one in constants],
        "points": points,
        "only_a": [_unmatched(one, versus.a.grid, versus.b.grid) for one in versus.matching.only_a],
        "only_b": [_unmatched(one, versus.b.grid, versus.a.grid) for one in versus.matching.only_b],
    }


def kinds_compared(versus: Versus) -> list[tuple[str, str]]:
    """Quantities and configurations in which they are compared."""
    kinds = [str(kind) for kind in ("neutral", "engaged", "zero") if (versus.at.configuration == kind).any()]
    return [
        (name, kind)
        for kind in kinds
        for name, found in versus.quantities.items()
        if (found.compared & (versus.at.configuration == kind)).any()
    ]


def mean_document(versus: Versus, name: str, configuration: str) -> dict[str, Any]:
    """Mean of a quantity over one configuration, and how many points are beyond U."""
    found, rows = versus.quantities[name], np.asarray(versus.at.configuration == configuration)
    value, own, common = found.mean(rows)
    known = rows & found.compared
    return {
        "quantity": name,
        "configuration": configuration,
        "points": int(known.sum()),
        "mean": value,
        "u_independent": own,
        "u_common": common,
        "beyond_U": int(found.beyond[rows].sum()),
        "beyond_U_independent": int(found.beyond_own[rows].sum()),
        "u_common_were_nothing_shared": float(np.sqrt(np.mean(found.unshared[known] ** 2))),
    }


def _side(side: CampaignSide) -> dict[str, Any]:
    grid = side.grid
    return {
        "campaign": grid.campaign,
        "origin": grid.origin,
        "recordings": len(side.manifests),
        "accepted": int(grid.accepted.sum()),
        "points": len(grid),
    }


def _point(found: PointDifference, i: int) -> dict[str, Any]:
    return {
        "a": float(found.a[i]),
        "b": float(found.b[i]),
        "correction": float(found.correction[i]),
        "difference": float(found.value[i]),
        "u_independent": float(found.own[i]),
        "u_common": float(found.common[i]),
        "beyond_U": bool(found.beyond[i]),
    }


def _estimate(one: LinearEstimate) -> dict[str, float]:
    return {"value": one.value, "u_independent": one.own, "u_common": one.common, "p_value": one.p_value}


def _group(group: GroupResult) -> dict[str, Any]:
    return {
        "configuration": group.configuration,
        "shaft": group.shaft,
        "points": group.points,
        "mean_Nm": _estimate(group.mean),
        "chi_square": group.chi_square,
        "p_value": group.p_value,
        "beyond_U": group.beyond,
        "beyond_U_independent": group.beyond_own,
        "follows": [one.covariate.words for one in alike(group)],
        "slopes": [
            {"covariate": one.covariate.words, "per": one.covariate.unit, "share": one.share} | _estimate(one.slope)
            for one in group.followed
        ],
    }


def _unmatched(one: Unmatched, grid: Grid, other: Grid) -> dict[str, Any]:
    found = {
        "point": str(grid.points.name[one.row]),
        "nearest": None if one.nearest is None else str(other.points.name[one.nearest]),
        "speed_sun": one.speed_sun,
        "speed_ring": one.speed_ring,
        "load": one.load,
        "why": one.why,
    }
    return with_nulls(found)

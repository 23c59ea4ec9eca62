"""Budgets as a table of every point, and as JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pmg.pipeline.fit.document import number

if TYPE_CHECKING:
    from pmg.pipeline.fit.budget import Budget
    from pmg.pipeline.grid.contributions import ShaftBudget
    from pmg.sim.signals import Array, Mask


def shown_point(budget: Budget) -> int | None:
    """Row of the point that is shown: accepted, engaged before neutral, largest load, sun driving, highest speed."""
    at = budget.grid.points
    rows = np.flatnonzero(budget.grid.accepted & ~at.zero)
    if not len(rows):
        return None
    keys = (np.abs(at.speed_sun), at.drive == "sun", np.round(np.abs(at.load_set), 3), at.engaged)
    return int(rows[np.lexsort([key[rows] for key in keys])[-1]])


def typical_rows(budget: Budget) -> Mask:
    """Rows over which medians are taken: accepted points that are no zero checks (n,)."""
    return np.asarray(budget.grid.accepted & ~budget.grid.points.zero)


def median(values: Array) -> float:
    """Median of what is known; NaN of nothing."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else math.nan


def budget_frame(budget: Budget) -> pd.DataFrame:
    """One row a point: standard uncertainty by contribution, both parts, together, and expanded [N m]."""
    columns: dict[str, Any] = {"point": budget.grid.points.name}
    for shaft in budget:
        side = shaft.side
        columns[f"torque_{side}_Nm"] = shaft.torque
        for contribution in shaft.contributions:
            columns[f"u_{contribution.key}_{side}_Nm"] = contribution.u
        columns[f"u_independent_{side}_Nm"] = shaft.independent
        columns[f"u_common_{side}_Nm"] = shaft.common
        columns[f"u_{side}_Nm"] = shaft.u
        columns[f"u_expanded_{side}_Nm"] = shaft.expanded
        columns[f"u_dof_{side}"] = np.where(np.isfinite(shaft.dof), shaft.dof, np.nan)
    return pd.DataFrame(columns)


def budget_document(budget: Budget) -> dict[str, Any]:
    """The budget of the point that is shown and the medians of the campaign, as JSON; null where nothing is stated."""
    row, typical = shown_point(budget), typical_rows(budget)
    document: dict[str, Any] = {
        "point": None if row is None else str(budget.grid.points.name[row]),
        "shafts": {shaft.side: _shaft_document(shaft, row, typical) for shaft in budget},
    }
    if budget.facts is not None:
        facts = budget.facts
        document["windows"] = {
            "all": len(budget.grid),
            "correlated": [str(name) for name in budget.grid.points.name[facts.correlated]],
            "from_memory": int(np.count_nonzero(facts.sun.remembered | facts.ring.remembered)),
            "limits": [
                {"recordings": each.recordings, "windows": each.windows, "limits": dict(each.limits)}
                for each in facts.limits
            ],
        }
    return document


def _shaft_document(shaft: ShaftBudget, row: int | None, typical: Mask) -> dict[str, Any]:
    def both(values: Array) -> dict[str, float | None]:
        return {
            "point": None if row is None else number(float(values[row])),
            "median": number(median(values[typical])),
        }

    return {
        "contributions": [
            {
                "key": c.key,
                "name": c.name,
                "type": c.kind,
                "distribution": c.distribution,
                "common": c.common,
                "divisor": c.divisor,
                "u_Nm": both(c.u),
                "degrees_of_freedom": None if row is None else number(float(c.dof[row])),
                "remark": c.remark,
            }
            for c in shaft.contributions
        ],
        "u_independent_Nm": both(shaft.independent),
        "u_common_Nm": both(shaft.common),
        "u_combined_Nm": both(shaft.u),
        "u_expanded_Nm": both(shaft.expanded),
        "effective_degrees_of_freedom": both(shaft.dof),
        "coverage_factor": both(shaft.factor),
    }

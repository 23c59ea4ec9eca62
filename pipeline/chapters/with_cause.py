"""The simulation without and with the cause that was found: figures that switch, and the values behind each point."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.comparison import compare
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.report.document import Figure, Section
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.analysis.comparison import Residuals
    from pmg.pipeline.analysis.tolerance import Agreements
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

POINT_DIGITS = 6
"""Significant digits of a value behind a point."""


@dataclass(frozen=True)
class SimulatedTwice:
    """A campaign simulated without and with the cause.

    Parameters
    ----------
    plain : Residuals
        Measured less simulated as the report compares them.
    boxes : tuple of (name, Gearbox)
        The models: the plain one, and where a cause was named, the one with it.
    caused : Residuals or None
        Measured less simulated with the cause; None where none was named.
    """

    plain: Residuals
    boxes: tuple[tuple[str, Gearbox], ...]
    caused: Residuals | None


def simulate_twice(
    judged: ComparedCampaign | None, calibration: FittedBaseline | None, bench: BenchParameters
) -> SimulatedTwice | None:
    """The comparison that was made, and the same with the mechanisms of the model that came of it; None without one.

    Where a model was given, the comparison is with it already, and there is no second one.
    """
    if judged is None or calibration is None:
        return None
    if judged.carried is not None:
        return SimulatedTwice(judged.residuals, (("simulated", judged.carried.gearbox),), None)
    plain = Gearbox.calibrated(bench, calibration.model)
    if not judged.model.parts:
        return SimulatedTwice(judged.residuals, (("simulated", plain),), None)
    mechanisms = (*baseline_mechanisms(judged.model.baseline, bench), *judged.model.mechanisms(bench))
    name = "with the cause" if judged.diagnosis.verdict is Verdict.NAMED else "with the first possible cause"
    box, grid = Gearbox(bench, mechanisms), judged.residuals.grid
    caused = compare(grid, steady(box, grid.points, grid.campaign), bench, calibration)
    return SimulatedTwice(
        judged.residuals,
        (("plain model", plain), (name, box)),
        caused,
    )


def with_switch(make: Callable[[Residuals], Section], twice: SimulatedTwice) -> Section:
    """A section made of residuals, whose figures can be switched to those made of the residuals with the cause."""
    return _switched(make(twice.plain), None if twice.caused is None else make(twice.caused))


def _switched(section: Section, caused: Section | None) -> Section:
    """The section whose figures can be switched to those of the same section made with the cause."""
    if caused is None:
        return section
    others = {item.id: item for item in caused.unfolded if isinstance(item, Figure)}

    def both(item: Any) -> Any:  # noqa: ANN401 - whatever a section holds
        other = others.get(item.id) if isinstance(item, Figure) else None
        if other is None or len(other.panels) != len(item.panels):
            return item
        return replace(item, switched=other.panels, switched_caption=other.caption)

    return replace(section, items=tuple(both(item) for item in section.items))


def behind_points(twice: SimulatedTwice, agreed: Agreements) -> str:
    """What is simulated at each row of the grid, as JSON for the page: torques, tolerances, losses by mechanism.

    Mechanisms of one title, as one on each shaft, are added up.
    """
    at, runs = twice.plain.grid.points, [twice.plain] + ([] if twice.caused is None else [twice.caused])
    models = []
    for (name, box), residuals in zip(twice.boxes, runs, strict=True):
        losses: dict[str, Array] = {}
        for mechanism, torques in zip(box.mechanisms, box.contributions(at), strict=True):
            losses[mechanism.title] = losses.get(mechanism.title, np.zeros(len(at))) - torques.power(at)
        simulated = [_numbers(one.simulated) for one in (residuals.torque_sun, residuals.torque_ring)]
        shown = {title: _numbers(loss) for title, loss in losses.items()}
        models.append({"name": name, "torque": simulated, "loss": shown})
    compared = (("torque_sun", twice.plain.torque_sun), ("torque_ring", twice.plain.torque_ring))
    tolerance = [_numbers(np.where(agreed.of[name].compared, agreed.of[name].bound, np.nan)) for name, _ in compared]
    expanded = [_numbers(COVERAGE_FACTOR * one.u) for _, one in compared]
    behind = {"models": models, "tolerance": tolerance, "expanded": expanded}
    return json.dumps(behind, allow_nan=False, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")


def _numbers(values: Array) -> list[float | None]:
    return [
        float(f"{value:.{POINT_DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, dtype=float)
    ]

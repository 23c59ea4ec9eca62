"""Matched points subtracted, B minus A, quantity by quantity, with the uncertainty of the difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.campaign_comparison.matching import match
from pmg.pipeline.campaign_comparison.setpoints import carried
from pmg.pipeline.campaign_comparison.shared_errors import Sharing, left_over, sharing
from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.fit.common_errors import transducer_causes
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim import signals
from pmg.sim.signals import TORQUES

if TYPE_CHECKING:
    from pmg.pipeline.campaign_comparison.matching import Matching, Reach
    from pmg.pipeline.campaign_comparison.setpoints import Changes
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.fit.common_errors import TransducerCause
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array, Mask, Signal

DERIVED: tuple[Signal, ...] = (
    signals.LOSS_TOTAL,
    signals.LOSS_BEARINGS,
    signals.LOSS_MAGNETIC,
    signals.EFFICIENCY_TOTAL,
    signals.EFFICIENCY_MAGNETIC,
)
COMPARED: tuple[Signal, ...] = (*TORQUES, *DERIVED)
"""Every quantity that is subtracted. The ring torque of an engaged point is its load: an input, not an outcome."""


@dataclass(frozen=True)
class PointDifference:
    """One quantity at m matched points, SI; NaN where it does not apply.

    Parameters
    ----------
    a, b : (m,) array
        As measured.
    correction : (m,) array
        What B would have changed by at the speeds and load of A.
    own : (m,) array
        Standard uncertainty of the difference that is independent from point to point, of both.
    left : (m, s) array
        What one standard uncertainty of each common error leaves in the difference.
    unshared : (m,) array
        Standard uncertainty from common errors, were all of them two errors.
    """

    a: Array
    b: Array
    correction: Array
    own: Array
    left: Array
    unshared: Array

    @property
    def value(self) -> Array:
        """B minus A, B carried to the speeds and load of A."""
        return self.b + self.correction - self.a

    @property
    def common(self) -> Array:
        """Standard uncertainty from what the common errors leave."""
        return np.asarray(np.linalg.norm(self.left, axis=-1))

    @property
    def u(self) -> Array:
        """Standard uncertainty, both parts together."""
        return np.hypot(self.own, self.common)

    @property
    def compared(self) -> Mask:
        """Points at which the difference is known."""
        return np.isfinite(self.value) & np.isfinite(self.u)

    @property
    def beyond(self) -> Mask:
        """Points at which it is larger than U = 2u."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.compared & (np.abs(self.value) > COVERAGE_FACTOR * self.u))

    @property
    def beyond_own(self) -> Mask:
        """Points at which it is larger than twice the independent part alone."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.compared & (np.abs(self.value) > COVERAGE_FACTOR * self.own))

    def mean(self, rows: Mask) -> tuple[float, float, float]:
        """Mean over some of the compared points, its independent and its common standard uncertainty."""
        chosen = rows & self.compared
        n = int(chosen.sum())
        own = float(np.sqrt(np.sum(self.own[chosen] ** 2))) / n
        return float(self.value[chosen].mean()), own, float(np.linalg.norm(self.left[chosen].mean(axis=0)))


@dataclass(frozen=True)
class Versus:
    """Two campaigns, matched and subtracted.

    Parameters
    ----------
    a, b : CampaignSide
        The campaigns.
    matching : Matching
        Which points belong together.
    shared : Sharing
        Which transducers are the same.
    quantities : dict of str to PointDifference
        By signal name, (m,) each.
    corrected : bool
        Whether set-points that differ were corrected for.
    """

    a: CampaignSide
    b: CampaignSide
    matching: Matching
    shared: Sharing
    quantities: dict[str, PointDifference]
    corrected: bool

    @property
    def at(self) -> OperatingPoints:
        """The matched points, as A ran them."""
        return self.a.grid.points[self.matching.a]

    @property
    def in_both(self) -> str:
        """Which recordings are those of both campaigns, in words; empty where none are."""
        shared = self.a.contents & self.b.contents
        if shared and self.a.contents == self.b.contents:
            return "A and B are the same recordings"
        return f"of the recordings of A and B, the same in both: {len(shared)}" if shared else ""


def subtract(a: CampaignSide, b: CampaignSide, reach: Reach, stated: Transducers = Transducers.AUTO) -> Versus:
    r"""Match two campaigns and subtract them.

    Parameters
    ----------
    a, b : CampaignSide
        The campaigns.
    reach : Reach
        How far apart two points may lie.
    stated : Transducers
        Whether the transducers are the same ones; ``auto``: as the calibrations say.

    Notes
    -----
    Independent parts add in quadrature. Common ones add in quadrature, but for errors that are one and the same in
    both campaigns (`pmg.pipeline.campaign_comparison.shared_errors`). A point of B is carried to the speeds of A,
    and engaged to the ring torque of A, by the calibrated models (`pmg.pipeline.campaign_comparison.setpoints`),
    since set-points match only within tolerances. So the sun torque of an engaged point is compared at one load, and
    both ring readings enter its uncertainty, divided by the ratio of the stage.
    """
    matching, shared = match(a.grid, b.grid, reach), sharing(a, b, stated)
    at_a, at_b = a.grid.points[matching.a], b.grid.points[matching.b]
    changes, errors = carried((a, b), at_b, at_a)
    quantities = {signal.name: _torque(signal.name, (a, b), matching, shared, changes, errors) for signal in TORQUES}
    for signal in DERIVED:
        found = _derived(signal.name, (a, b), matching, shared, changes, errors)
        if found is not None:
            quantities[signal.name] = found
    return Versus(a, b, matching, shared, quantities, bool(changes))


def _torque(
    name: str,
    sides: tuple[CampaignSide, CampaignSide],
    matching: Matching,
    shared: Sharing,
    changes: Changes,
    errors: Changes,
) -> PointDifference:
    """A torque; shafts at rest are left out, but at the zero checks."""
    values, own, effects = [], [], []
    shaft = name.removeprefix("torque_")
    sun = shaft == "sun"
    for side, rows in zip(sides, (matching.a, matching.b), strict=True):
        grid = side.grid[rows]
        at = grid.points
        ratio = side.bench.ratio(at.gear)
        by_load = np.where(at.engaged & sun & bool(changes), 1.0 / ratio, 0.0)
        known = ~at.rest[shaft] | at.zero
        values.append(np.where(known, grid.torque[shaft], np.nan))
        own.append(np.hypot(grid.u_sun, by_load * grid.u_ring) if sun else grid.u_ring)
        causes = _transducers(side)
        columns = [(cause.sun[rows] - by_load * cause.ring[rows]) if sun else cause.ring[rows] for cause in causes]
        effects.append((causes, np.stack(columns, axis=-1) if columns else np.zeros((len(rows), 0))))
    at = sides[0].grid.points[matching.a]
    outcome = np.ones(len(matching), dtype=bool) if sun else ~at.engaged
    nothing = np.zeros(len(matching))
    correction = np.where(outcome, changes.get(name, nothing), 0.0)
    error = np.where(outcome, errors.get(name, nothing), 0.0)
    return _made(values, np.hypot(*own), correction, error, shared, (effects[0], effects[1]))


def _derived(
    name: str,
    sides: tuple[CampaignSide, CampaignSide],
    matching: Matching,
    shared: Sharing,
    changes: Changes,
    errors: Changes,
) -> PointDifference | None:
    """A loss or efficiency of the engaged points; None where a campaign has no balance or a model lacks."""
    values, own, effects = [], [], []
    for side, rows in zip(sides, (matching.a, matching.b), strict=True):
        balance = side.analysis.balance
        if balance is None or name not in changes:
            return None
        usable = side.grid.points.engaged & side.grid.accepted
        place = np.full(len(side.grid), -1)
        place[usable] = np.arange(int(usable.sum()))
        found = place[rows]
        known = found >= 0

        def spread(column: Array, known: Mask = known, found: Array = found) -> Array:
            whole = np.full((len(known), *column.shape[1:]), np.nan)
            whole[known] = column[found[known]]
            return whole

        values.append(spread(balance.values[name]))
        own.append(spread(balance.spread.independent(name)))
        at = balance.spread.names.index(name)
        effects.append((_transducers(side), spread(sum(part[at] for part in balance.spread.shared.values()))))
    return _made(values, np.hypot(*own), changes[name], errors[name], shared, (effects[0], effects[1]))


def _made(
    values: list[Array],
    own: Array,
    correction: Array,
    error: Array,
    shared: Sharing,
    effects: tuple[tuple[tuple[TransducerCause, ...], Array], tuple[tuple[TransducerCause, ...], Array]],
) -> PointDifference:
    left = np.concatenate([left_over(shared, *effects), error[:, None]], axis=-1)
    none = Sharing(sun=False, ring=False, description="")
    apart = np.concatenate([left_over(none, *effects), error[:, None]], axis=-1)
    return PointDifference(values[0], values[1], correction, own, left, np.linalg.norm(apart, axis=-1))


def _transducers(side: CampaignSide) -> tuple[TransducerCause, ...]:
    causes = side.analysis.causes
    return transducer_causes(side.grid, side.bench) if causes is None else causes.transducers

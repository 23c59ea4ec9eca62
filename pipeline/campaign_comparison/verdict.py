"""Whether two campaigns differ, where, and what the difference follows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.campaign_comparison.family import DifferenceFamily, DifferenceGroup, LinearEstimate
from pmg.pipeline.fit.whitening import undo, whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.errors import GridError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, other_side
from pmg.sim.signals import MINUTE, RPM

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.campaign_comparison.difference import Versus
    from pmg.pipeline.campaign_comparison.side import CampaignSide
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array, Mask

SIGNIFICANCE = 0.05
DRAWS = 1999
"""Synthetic pairs of campaigns behind a p-value."""
PERMUTATION_SEED = 20260102

GROUPS: tuple[tuple[Configuration, str], ...] = (
    (Configuration.ZERO, "sun"),
    (Configuration.ZERO, "ring"),
    (Configuration.NEUTRAL, "sun"),
    (Configuration.NEUTRAL, "ring"),
    (Configuration.ENGAGED, "sun"),
)
"""Readings that are outcomes, by configuration and shaft."""

FEWEST = 4
"""Points of a group from which a slope is fitted."""


@dataclass(frozen=True)
class DifferenceCovariate:
    """Covariate that a difference may follow: in words, the unit of one step, and the SI value of that step."""

    words: str
    unit: str
    step: float


OWN_SPEED = DifferenceCovariate("speed of the shaft", "1000 rpm", 1000.0 * RPM)
OTHER_SPEED = DifferenceCovariate("speed of the other shaft", "1000 rpm", 1000.0 * RPM)
TORQUE = DifferenceCovariate("torque of the shaft (sensitivity)", "N m", 1.0)
TIME_A = DifferenceCovariate("time in A", "h", 60.0 * MINUTE)
TIME_B = DifferenceCovariate("time in B", "h", 60.0 * MINUTE)


@dataclass(frozen=True)
class DifferenceTrend:
    """Slope of a group's difference against a covariate.

    Parameters
    ----------
    covariate : DifferenceCovariate
        What it is followed against.
    slope : LinearEstimate
        Torque per step [N m].
    share : float
        Part of the weighted variance of the differences that a straight line against it takes up.
    """

    covariate: DifferenceCovariate
    slope: LinearEstimate
    share: float


@dataclass(frozen=True)
class GroupResult:
    """One configuration and shaft.

    Parameters
    ----------
    configuration, shaft : str
        Which readings.
    points : int
        How many.
    mean : LinearEstimate
        Mean difference of the torque in the direction of rotation [N m].
    followed : tuple of DifferenceTrend
        Slopes, that of the largest share first.
    chi_square, p_value : float
        Of all differences of the group together, and its nominal p-value.
    beyond, beyond_own : int
        Points beyond U, and beyond U of the independent part alone.
    """

    configuration: str
    shaft: str
    points: int
    mean: LinearEstimate
    followed: tuple[DifferenceTrend, ...]
    chi_square: float
    p_value: float
    beyond: int
    beyond_own: int

    @property
    def words(self) -> str:
        """Such as ``sun torque, engaged``."""
        return f"{self.shaft} torque, {'zero checks' if self.configuration == 'zero' else self.configuration}"


@dataclass(frozen=True)
class ComparisonVerdict:
    """Results of the tests.

    Parameters
    ----------
    groups : tuple of GroupResult
        With what common errors leave in their uncertainty.
    p_value : float
        Of a difference as clear as the clearest anywhere, where there is none; common errors allowed for.
    p_readings : float
        The same with independent errors alone: whether the readings differ, whatever the cause.
    draws : int
        Synthetic pairs behind both.
    """

    groups: tuple[GroupResult, ...]
    p_value: float
    p_readings: float
    draws: int

    @property
    def differ(self) -> bool:
        """Whether the campaigns differ by more than noise and transducer tolerances can explain."""
        return self.p_value <= SIGNIFICANCE

    @property
    def readings_differ(self) -> bool:
        """Whether the readings differ by more than noise."""
        return self.p_readings <= SIGNIFICANCE


def judge(versus: Versus, rng: np.random.Generator, draws: int = DRAWS) -> ComparisonVerdict | None:
    """Test the differences; None where no reading is matched.

    Raises
    ------
    GridError
        A campaign has no noise at all.

    Notes
    -----
    The noise of each campaign is that of its noise floor, correlated between neighbours in the order of the test as
    far as that was found. A shaft that turns backwards has the sign of its difference changed, so that more drag
    counts as more in both directions.
    """
    ready = _ready_family(versus)
    if ready is None:
        return None
    family, differences, groups = ready
    own = np.sqrt(np.diag(family.covariance))
    alone = replace(family, left=np.zeros((len(differences), 0)))
    p_value = family.p_value(differences, draws, rng)
    p_readings = alone.p_value(differences, draws, rng)
    results = []
    kinds = zip(groups, family.blocks, family.estimates(differences), family.chi_squares(differences), strict=True)
    for (configuration, shaft, covariates), block, (mean, *slopes), (chi_square, _, p) in kinds:
        points = versus.quantities[f"torque_{shaft}"]
        shares = _shares(differences[block.rows], own[block.rows], block.weights[1:, block.rows])
        follows = tuple(DifferenceTrend(*triple) for triple in zip(covariates, slopes, shares, strict=True))
        chosen = np.asarray(versus.at.configuration == configuration)
        results.append(
            GroupResult(
                str(configuration),
                shaft,
                int(block.rows.sum()),
                mean,
                tuple(sorted(follows, key=lambda one: -one.share)),
                chi_square,
                p,
                int(points.beyond[chosen].sum()),
                int(points.beyond_own[chosen].sum()),
            )
        )
    return ComparisonVerdict(tuple(results), p_value, p_readings, draws)


def _shares(differences: Array, own: Array, slopes: Array) -> list[float]:
    """Part of the weighted variance that each straight line takes up."""
    weight = own**-2.0
    total = float(np.sum(weight * (differences - np.average(differences, weights=weight)) ** 2))
    if total <= 0.0:
        return [0.0] * len(slopes)
    return [min(float((row @ differences) ** 2 / np.sum(row**2 / weight)) / total, 1.0) for row in slopes]


Kind = tuple[Configuration, str, tuple[DifferenceCovariate, ...]]


def _ready_family(versus: Versus) -> tuple[DifferenceFamily, Array, tuple[Kind, ...]] | None:
    """The family of tests, the differences (m,) in the direction of rotation [N m], and what its blocks are."""
    at = versus.at
    n = len(at)
    shaft_of, row_of = np.repeat([True, False], n), np.tile(np.arange(n), 2)
    both = [versus.quantities[f"torque_{shaft}"] for shaft in SIDES]
    known = np.concatenate([q.compared for q in both]) & (shaft_of | ~at.engaged[row_of])
    shaft_of, row_of = shaft_of[known], row_of[known]
    if not len(row_of):
        return None
    speed = np.where(shaft_of, at.speed_sun[row_of], at.speed_ring[row_of])
    turn = np.where((speed < 0.0) & ~at.zero[row_of], -1.0, 1.0)
    differences = turn * np.concatenate([q.value for q in both])[known]
    left = turn[:, None] * np.concatenate([q.left for q in both])[known]
    noise = []
    for side, rows in ((versus.a, versus.matching.a), (versus.b, versus.matching.b)):
        noise += _noise(side, rows[row_of], shaft_of, turn)
    blocks, kinds = [], []
    own = np.sqrt(np.sum([np.sum(effect**2, axis=1) for effect, _ in noise], axis=0))
    for configuration, shaft in GROUPS:
        chosen = np.asarray((at.configuration[row_of] == configuration) & (shaft_of == (shaft == "sun")))
        if not chosen.any():
            continue
        covariates, weights = _linear_tests(versus, configuration, shaft, chosen, row_of, own)
        blocks.append(DifferenceGroup(chosen, weights))
        kinds.append((configuration, shaft, covariates))
    return DifferenceFamily(tuple(noise), left, tuple(blocks)), differences, tuple(kinds)


def _noise(side: CampaignSide, rows: npt.NDArray[np.intp], shaft_of: Mask, turn: Array) -> list[tuple[Array, float]]:
    """Effects of unit errors of a campaign's readings on the differences, shaft by shaft."""
    readings = take_readings(side.grid, side.bench)
    root, place = _root(side, readings), {}
    for i, (row, sun) in enumerate(zip(readings.row, readings.sun, strict=True)):
        place[int(row), bool(sun)] = i
    found = np.array([place[int(row), bool(sun)] for row, sun in zip(rows, shaft_of, strict=True)], dtype=np.intp)
    effect = turn[:, None] * root[found]
    floor = side.analysis.floor
    parts = []
    for shaft, mine in readings.of_shaft.items():
        dof = np.inf if floor is None else floor[shaft].dof
        parts.append((effect * mine, float(dof) if dof > 0 else np.inf))
    return parts


def _root(side: CampaignSide, readings: Readings) -> Array:
    """A root of the covariance of a campaign's readings (m, m) [N m]."""
    if side.analysis.floor is None:
        return np.diag(readings.u)
    white = whitener(readings, side.bench, side.analysis.floor)
    if not (white.scale > 0.0).all():
        raise GridError(
            side.name,
            "readings without any noise, as a simulation gives them",
            "readings of a bench, whose noise decides what differs",
            "Compare simulations by their tables, points.csv.",
        )
    return np.asarray((readings.u / white.scale)[:, None] * undo(white, np.eye(len(readings))))


def _linear_tests(
    versus: Versus, configuration: Configuration, shaft: str, rows: Mask, row_of: npt.NDArray[np.intp], own: Array
) -> tuple[tuple[DifferenceCovariate, ...], Array]:
    """Weights (k, m) of the mean and of the slope of a straight line against each covariate that varies."""
    n = int(rows.sum())
    mean = np.zeros(len(rows))
    mean[rows] = 1.0 / n
    weights, covariates = [mean], []
    for covariate, x in _covariates(versus, configuration, shaft, row_of[rows]):
        varies = np.isfinite(x).all() and np.ptp(x) > 1e-6 * max(float(np.abs(x).max()), 1e-30)
        if n < FEWEST or not varies:
            continue
        weight = own[rows] ** -2.0
        centred = x - np.average(x, weights=weight)
        row = np.zeros(len(rows))
        row[rows] = weight * centred / np.sum(weight * centred**2)
        weights.append(row)
        covariates.append(covariate)
    return tuple(covariates), np.stack(weights)


def _covariates(
    versus: Versus, configuration: Configuration, shaft: str, rows: npt.NDArray[np.intp]
) -> list[tuple[DifferenceCovariate, Array]]:
    """Covariates of the difference of a group, in steps of each; engaged, the ring's speed is that of the sun."""
    at, there = versus.at[rows], versus.b.grid.points[versus.matching.b[rows]]
    times = [(TIME_A, at.started_at), (TIME_B, there.started_at)]
    found = [(covariate, (x - np.nanmin(x)) / covariate.step) for covariate, x in times if np.isfinite(x).all()]
    if configuration == Configuration.ZERO:
        return found
    own, other = at.speed[shaft], at.speed[other_side(shaft)]
    torque = np.where(own < 0.0, -1.0, 1.0) * versus.quantities[f"torque_{shaft}"].a[rows]
    moving = [(OWN_SPEED, np.abs(own) / OWN_SPEED.step), (TORQUE, torque)]
    if configuration == Configuration.NEUTRAL:
        moving.append((OTHER_SPEED, np.abs(other) / OTHER_SPEED.step))
    return moving + found

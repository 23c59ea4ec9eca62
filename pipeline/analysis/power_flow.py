"""The power flow of every engaged point, with the uncertainty of each branch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pmg.pipeline.fit.calibration import CONSTANTS, parameter_values, with_parameters
from pmg.pipeline.fit.propagation import propagate_uncertainty, slope, slopes
from pmg.pipeline.wording.probability import COVERAGE_FACTOR
from pmg.sim.bench import SourcedQuantity
from pmg.sim.signals import SPEED_SUN
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import MotorConvention, power_chain
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.fit.common_errors import CommonErrorSources
    from pmg.pipeline.fit.propagation import Spread
    from pmg.sim.bench import BearingParameters, BenchParameters, MotorParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Mask
    from pmg.sim.steady.power_chain import PowerChain

BRANCHES = (
    "electric_in",
    "loss_motor_in",
    "mechanical_in",
    "loss_sun_bearings",
    "loss_relative_sun",
    "loss_gear",
    "loss_relative_ring",
    "loss_ring_bearings",
    "unexplained",
    "mechanical_out",
    "loss_motor_out",
    "electric_out",
)
"""The branches of a power chain, in the order of the flow."""

_CONSTANTS = tuple(
    ("motor", name) for name in ("resistance", "torque_constant", "back_emf_constant", "damping")
) + tuple(
    ("bearings", name)
    for name in (
        "share_sun_1",
        "share_sun_2",
        "share_sun_relative",
        "share_ring_relative",
        "share_ring_4",
        "share_ring_5",
        "share_ring_6",
        "share_ring_7",
    )
)
"""Numbers of the bench that a branch may depend on."""

_TOLD = {"motor": "motors", "bearings": "bearing shares"}

_TORQUE_STEP = 1e-4
"""Step of the torques in the difference quotients [N m]: the powers are of second degree in them."""

_RELATIVE_STEP = 1e-4
"""Step of the constants of the bench, relative."""

_CURVE_STEP = 0.01
"""Step of a curve's coefficient [N m]: the powers are linear in it."""


@dataclass(frozen=True)
class Flow:
    """Power flow of n engaged points.

    Parameters
    ----------
    grid : Grid
        The points, with the torques that were used.
    origin : str
        ``measured`` or ``simulated``: whose torques they are. Simulated, the sun torque is the model's answer to the
        measured ring torque.
    convention : MotorConvention
        How the electric side is reckoned.
    chain : PowerChain
        The powers.
    spread : Spread
        Their uncertainty.
    """

    grid: Grid
    origin: str
    convention: MotorConvention
    chain: PowerChain
    spread: Spread

    def watts(self, branch: str) -> Array:
        """Power of a branch [W]."""
        return np.asarray(getattr(self.chain, branch))

    def expanded(self, branch: str) -> Array:
        """Its expanded uncertainty U = 2u [W]."""
        return COVERAGE_FACTOR * self.spread.u(branch)

    def expanded_sum(self, branches: tuple[str, ...]) -> Array:
        """U of the sum of some branches [W]."""
        return COVERAGE_FACTOR * self.spread.total(dict.fromkeys(branches, 1.0))

    @property
    def beyond(self) -> Mask:
        """Points whose unexplained branch is beyond U.

        None with simulated torques: they leave open only what the rounding of the measured speeds does.
        """
        if self.origin == "simulated":
            return np.zeros(len(self.grid), dtype=bool)
        return np.asarray(np.abs(self.chain.unexplained) > self.expanded("unexplained"))


def power_flows(
    gearbox: Gearbox,
    measured: Grid,
    simulated: Grid,
    bench: BenchParameters,
    calibration: FittedBaseline,
    causes: CommonErrorSources,
) -> tuple[Flow, ...]:
    """Power flows of the accepted engaged points: measured and simulated torques, both conventions of the motors.

    Parameters
    ----------
    gearbox : Gearbox
        The simulator; its baseline is the calibration's.
    measured, simulated : Grid
        The same points.
    bench : BenchParameters
        Motor constants and bearing shares.
    calibration : FittedBaseline
        The fitted parameters.
    causes : Causes
        What the points share, row by row of the grids.

    Notes
    -----
    Derivatives are central differences through `power_chain` and `steady` themselves, which are linear in the fitted
    parameters and of second degree in the torques. A constant of the bench without a stated uncertainty contributes
    nothing; `Spread.without` names it for each branch that it moves.
    """
    rows = np.flatnonzero(measured.points.engaged & measured.accepted)
    grids = {"measured": measured[rows], "simulated": simulated[rows]}
    of_rows = causes[rows]
    return tuple(
        _flow(gearbox, grids[origin], measured[rows], origin, convention, bench, calibration, of_rows)
        for origin in grids
        for convention in MotorConvention
    )


def _flow(
    gearbox: Gearbox,
    grid: Grid,
    given: Grid,
    origin: str,
    convention: MotorConvention,
    bench: BenchParameters,
    calibration: FittedBaseline,
    causes: CommonErrorSources,
) -> Flow:
    at = given.points

    def chain(torque_sun: Array, torque_ring: Array, box: Gearbox, of: BenchParameters) -> PowerChain:
        points = replace(at, torque_ring=torque_ring)
        if origin == "simulated":
            torque_sun = steady(box, points).torque_sun
        return power_chain(
            box, replace(grid, points=points, torque_sun=torque_sun, torque_ring=torque_ring), of, convention
        )

    def branches(sun: Array, ring: Array, box: Gearbox = gearbox, of: BenchParameters = bench) -> Array:
        found = chain(sun, ring, box, of)
        return np.stack([getattr(found, name) for name in BRANCHES])

    sun, ring = grid.torque_sun, given.torque_ring
    free, theta = calibration.free, parameter_values(calibration.model, calibration.free)

    def with_theta(values: Array) -> Array:
        return branches(sun, ring, _with_baseline(gearbox, bench, with_parameters(calibration.model, free, values)))

    def with_constant(section: str, name: str) -> tuple[Array, float | None]:
        number: SourcedQuantity = getattr(getattr(bench, section), name)

        def moved(value: Array) -> Array:
            part = replace(getattr(bench, section), **_moved(getattr(bench, section), name, float(value)))
            of = replace(bench, **{section: part})
            return branches(sun, ring, _with_baseline(gearbox, of, calibration.model), of)

        return slope(moved, np.array(float(number)), _RELATIVE_STEP * abs(float(number))), number.u

    constants, without = [], []
    for section, name in _CONSTANTS:
        derivative, u = with_constant(section, name)
        if u is not None:
            constants.append((_TOLD[section], derivative * u))
            continue
        touched = np.abs(derivative).max(axis=1, initial=0.0) * abs(float(getattr(getattr(bench, section), name)))
        without += [(branch, _TOLD[section]) for branch, size in zip(BRANCHES, touched, strict=True) if size > 1e-6]
    spread = propagate_uncertainty(
        BRANCHES,
        (slope(lambda t: branches(t, ring), sun, _TORQUE_STEP), slope(lambda t: branches(sun, t), ring, _TORQUE_STEP)),
        slopes(with_theta, theta, [CONSTANTS[n].typical if n in CONSTANTS else _CURVE_STEP for n in calibration.names]),
        causes,
        tuple(constants),
        tuple(dict.fromkeys(without)),
    )
    return Flow(grid, origin, convention, chain(sun, ring, gearbox, bench), spread)


def _moved(section: MotorParameters | BearingParameters, name: str, value: float) -> dict[str, SourcedQuantity]:
    """One constant with another value; shares of a shaft still make up the whole, so the others give way."""
    old: dict[str, SourcedQuantity] = {name: getattr(section, name)}
    moved = {name: SourcedQuantity(value, old[name].unit)}
    shaft = next((shaft for shaft in ("share_sun", "share_ring") if name.startswith(shaft)), None)
    if shaft is not None:
        others = [other for other in section.__dataclass_fields__ if other.startswith(shaft) and other != name]
        factor = (1.0 - value) / (1.0 - float(old[name]))
        moved |= {other: SourcedQuantity(float(getattr(section, other)) * factor, "1") for other in others}
    return moved


def _with_baseline(gearbox: Gearbox, bench: BenchParameters, model: LossModel) -> Gearbox:
    """The gearbox with other numbers in its baseline; whatever else acts in it stays."""
    fresh = {type(mechanism): mechanism for mechanism in baseline_mechanisms(model, bench)}
    return Gearbox(bench, tuple(fresh.get(type(mechanism), mechanism) for mechanism in gearbox.mechanisms))


def flow_frame(flows: tuple[Flow, ...]) -> pd.DataFrame:
    """Every branch by point: power, independent and common standard uncertainty, and the common part by cause [W]."""
    frames = []
    for flow in flows:
        at = flow.grid.points
        columns: dict[str, Any] = {
            "point": at.name,
            SPEED_SUN.display_name: SPEED_SUN.display(at.speed_sun),
            "load_set_Nm": at.load_set,
            "drive": at.drive,
            "torques": np.full(len(at), flow.origin),
            "motors": np.full(len(at), str(flow.convention)),
        }
        for branch in BRANCHES:
            columns[f"{branch}_W"] = flow.watts(branch)
            columns[f"u_{branch}_W"] = flow.spread.independent(branch)
            columns[f"u_common_{branch}_W"] = flow.spread.common(branch)
            for group in flow.spread.groups:
                columns[f"u_{group.replace(' ', '_')}_{branch}_W"] = flow.spread.part(branch, group)
        columns["unexplained_beyond_U"] = flow.beyond
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def flow_document(flows: tuple[Flow, ...]) -> dict[str, Any]:
    """The same as JSON, for motors reckoned consistently."""
    points = []
    for flow in flows:
        if flow.convention is not MotorConvention.CONSISTENT:
            continue
        own = {branch: flow.spread.independent(branch) for branch in BRANCHES}
        common = {branch: flow.spread.common(branch) for branch in BRANCHES}
        parts = {
            (branch, group): flow.spread.part(branch, group) for branch in BRANCHES for group in flow.spread.groups
        }
        points += [
            {
                "point": str(flow.grid.points.name[i]),
                "torques": flow.origin,
                "unexplained_beyond_U": bool(flow.beyond[i]),
                "branches": {
                    branch: {
                        "value_W": float(flow.watts(branch)[i]),
                        "u_independent_W": float(own[branch][i]),
                        "u_common_W": float(common[branch][i]),
                        "u_common_by_cause_W": {g: float(parts[branch, g][i]) for g in flow.spread.groups},
                    }
                    for branch in BRANCHES
                },
            }
            for i in range(len(flow.grid))
        ]
    return {
        "schema": "pmg.power_flow/1",
        "motors": str(MotorConvention.CONSISTENT),
        "no_uncertainty_stated": {
            branch: list(flows[0].spread.lacking(branch)) for branch in BRANCHES if flows[0].spread.lacking(branch)
        },
        "points": points,
    }

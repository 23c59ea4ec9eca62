"""Steady points of a scenario, all at once: speeds, torques, losses by mechanism, powers and efficiencies."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim import signals
from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.power import flows
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration, Grid, OperatingPoints
from pmg.sim.mechanisms import Component, Torques
from pmg.sim.mechanisms.instruments import distorted
from pmg.sim.mechanisms.warmth import warmth_at
from pmg.sim.shafts import Member
from pmg.sim.steady.forward import forward
from pmg.sim.steady.power_chain import MotorConvention, power_chain
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.sim.signals import Array
    from pmg.sim.steady.power_chain import PowerChain

BEGIN = 1_577_836_800.0
"""Start of the first simulated point, 2020-01-01T00:00:00Z [s since 1970]: a simulation has no date of its own."""

BEARINGS = (Component.SUN_BEARINGS, Component.RING_BEARINGS, Component.RELATIVE_BEARING)


@dataclass(frozen=True)
class SteadyPoints:
    """Steady points.

    Parameters
    ----------
    grid : Grid
        Points and torques.
    speed_ring_motor, speed_carrier : (n,) array
        Speed of the ring motor's shaft, which is the carrier's where the ring is held, and of the carrier [rad/s].
    load_angle : (n,) array
        Electrical phase between the rotors [rad]; NaN in neutral.
    losses : dict of str to (n,) array
        Loss of each mechanism [W], by its identifier.
    values : dict of str to (n,) array
        Powers, losses, efficiencies by the name of their signal, SI; NaN where there is none.
    chains : dict of MotorConvention to PowerChain
        Power chain in both conventions of the motors; empty in neutral and with the ring held.
    balances : (n,) array of int
        Speeds at which given torques balance, as far as the scan sees; 1 where the speed was given.
    readings : Torques
        What the transducers show [N m]: the torques, and what their faults add.
    """

    grid: Grid
    speed_ring_motor: Array
    speed_carrier: Array
    load_angle: Array
    losses: dict[str, Array]
    values: dict[str, Array]
    chains: dict[MotorConvention, PowerChain]
    balances: npt.NDArray[np.int64]
    readings: Torques


def steady_points(scenario: Scenario, inputs: Inputs) -> SteadyPoints:
    """Solve the point, the grid and the pairs of a scenario."""
    at, torque_sun = _asked(scenario, inputs)
    if scenario.bench.held is Member.RING:
        return _free_carrier(scenario, inputs, at, torque_sun)
    gearbox, campaign = inputs.gearbox, scenario.output.campaign
    balances = np.ones(len(at), dtype=np.int64)
    given = np.isfinite(torque_sun)
    began = at.started_at
    if scenario.bench.history == "settled":
        at = replace(at, started_at=np.full(len(at), np.nan))
    if given.any():
        speeds = forward(gearbox, at[given], torque_sun[given])
        at, balances[given] = _with_speeds(at, given, speeds.points), speeds.balances
    grid = steady(gearbox, at, campaign)
    torque_ring = grid.torque_ring + 0.0  # no negative zeros
    at = replace(at, torque_ring=torque_ring, drive=_drive(at, torque_ring, at.speed_ring))
    grid = replace(grid, points=at, torque_sun=grid.torque_sun + 0.0, torque_ring=at.torque_ring)
    losses = {
        mechanism.identifier: -torques.power(at)
        for mechanism, torques in zip(gearbox.mechanisms, gearbox.contributions(at), strict=True)
    }
    engaged = bool(at.engaged.all())
    load_angle = np.full(len(at), np.nan)
    chains: dict[MotorConvention, PowerChain] = {}
    if engaged:
        load_angle = _load_angle(inputs, at, gearbox.transmitted(at))
        chains = {convention: power_chain(gearbox, grid, inputs.bench, convention) for convention in MotorConvention}
    on_sun = {
        mechanism.identifier: -torques.sun * at.speed_sun
        for mechanism, torques in zip(gearbox.mechanisms, gearbox.contributions(at), strict=True)
    }
    values = _balance(grid, at.speed_ring, _bearings(inputs, losses), _bearings(inputs, on_sun), engaged)
    readings = _readings(inputs, grid)
    grid = replace(grid, points=replace(at, started_at=began))
    return SteadyPoints(grid, at.speed_ring, np.zeros(len(at)), load_angle, losses, values, chains, balances, readings)


def _readings(inputs: Inputs, grid: Grid) -> Torques:
    """Readings of the transducers at the points of a grid [N m]."""
    true = Torques(grid.torque_sun, grid.torque_ring)
    faults = inputs.drivetrain.instruments
    if not faults:
        return true
    error_sun, error_ring = distorted(faults, grid.points, true)
    return Torques(true.sun + error_sun, true.ring + error_ring)


def _asked(scenario: Scenario, inputs: Inputs) -> tuple[OperatingPoints, Array]:
    """The points with what is given of them; sun torques where these are given instead of the speed, else NaN."""
    mode, point, grid, pairs = scenario.bench, scenario.point, scenario.grid, scenario.pairs
    neutral = mode.configuration is Configuration.NEUTRAL
    rpm = signals.SPEED_SUN.scale
    ratio = -inputs.bench.gear(mode.gear).ratio
    if mode.held is Member.RING:
        ratio = inputs.drivetrain.constants.Q / inputs.drivetrain.constants.p_s
    rows: list[tuple[str, float, float, float, float]] = []  # name, both speeds, ring torque, sun torque
    if point is not None:
        sun = (point.speed_sun_rpm or 0.0) * rpm
        ring = (point.speed_ring_rpm or 0.0) * rpm if neutral else sun / ratio
        given = np.nan if point.torque_sun_nm is None else point.torque_sun_nm
        rows.append(("point", sun, ring, point.torque_ring_nm or 0.0, given))
    if grid is not None:
        for sun_rpm in grid.speed_sun_rpm:
            for second in (grid.speed_ring_rpm if neutral else grid.load_nm) or ():
                sun = sun_rpm * rpm
                if neutral:
                    rows.append((f"N_s{sun_rpm:g}_r{second:g}", sun, second * rpm, 0.0, np.nan))
                    continue
                against = -1.0 if grid.drive == "sun" else 1.0
                torque = against * (np.sign(sun / ratio) or np.sign(ratio)) * second
                name = f"E_s{sun_rpm:g}_l{second:g}" + ("" if grid.drive == "sun" else "_reversed")
                rows.append((name, sun, sun / ratio, torque, np.nan))
    if pairs is not None:
        for i, (sun_rpm, torque) in enumerate(zip(pairs.speed_sun_rpm, pairs.torque_ring_nm, strict=True), 1):
            rows.append((f"P{i}_s{sun_rpm:g}_t{torque:g}", sun_rpm * rpm, sun_rpm * rpm / ratio, torque, np.nan))
    names, speed_sun, speed_ring, torque_ring, torque_sun = zip(*rows, strict=True)
    n = len(rows)
    at = OperatingPoints(
        name=_each_once(names),
        configuration=np.full(n, str(mode.configuration)),
        gear=np.full(n, mode.gear, dtype=np.int64),
        drive=np.full(n, "sun", dtype="<U4"),
        speed_sun=np.array(speed_sun) + 0.0,
        speed_ring=np.array(speed_ring) + 0.0,
        torque_ring=np.array(torque_ring) + 0.0,
        load_set=np.zeros(n) if neutral else np.array(torque_ring) + 0.0,
        started_at=BEGIN + scenario.output.seconds * np.arange(n, dtype=np.float64),
        rest_sun=np.array(speed_sun) == 0.0,
        rest_ring=np.array(speed_ring) == 0.0,
    )
    return at, np.array(torque_sun, dtype=np.float64)


def _each_once(names: tuple[str, ...]) -> npt.NDArray[np.str_]:
    """Names, a level that was given twice distinguished by a number."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name}_{seen[name]}")
    return np.array(found, dtype=np.str_)


def _with_speeds(at: OperatingPoints, rows: npt.NDArray[np.bool_], solved: OperatingPoints) -> OperatingPoints:
    columns = {name: getattr(at, name).copy() for name in ("speed_sun", "speed_ring", "rest_sun", "rest_ring")}
    for name, column in columns.items():
        column[rows] = getattr(solved, name)
    return replace(at, **columns)


def _drive(at: OperatingPoints, torque_ring: Array, speed_ring_motor: Array) -> npt.NDArray[np.str_]:
    """The side that puts power in: the ring where its motor does, else the sun."""
    return np.where(at.engaged & (torque_ring * speed_ring_motor > 0.0), "ring", "sun")


def _load_angle(inputs: Inputs, at: OperatingPoints, transmitted: Array) -> Array:
    """Electrical phase of each point [rad]; a load beyond pull-out is refused by name."""
    coupling = inputs.drivetrain.coupling
    assert coupling is not None  # engaged points only
    limits, mechanisms = coupling.pull_out, inputs.gearbox.mechanisms
    left = [math.prod(m.field_left(warmth) for m in mechanisms) for warmth in warmth_at(mechanisms, at)]
    transmitted = transmitted * inputs.drivetrain.field_left / np.array(left)  # as if the magnets were at their start
    slips = np.flatnonzero((transmitted <= limits.torque_low) | (transmitted >= limits.torque_high))
    if len(slips):
        raise BenchError(
            f"point {at.name[slips[0]]}" + (f" and {len(slips) - 1} more" if len(slips) > 1 else ""),
            f"{transmitted[slips[0]]:.4g} N m through the coupling, measured on the sun",
            f"between {limits.torque_low:.4g} and {limits.torque_high:.4g} N m, its pull-out",
            "Lower the load.",
        )
    return coupling.load_angle(transmitted)


def _bearings(inputs: Inputs, losses: dict[str, Array]) -> Array | float:
    """Loss of all bearings [W]."""
    return sum((losses[m.identifier] for m in inputs.drivetrain.mechanisms if m.component in BEARINGS), 0.0)


def _balance(
    grid: Grid, speed_ring_motor: Array, bearings: Array | float, bearing_sun: Array | float, engaged: bool
) -> dict[str, Array]:
    """Powers, losses and efficiencies as the thesis defines them; in neutral all power that is put in is lost."""
    at = grid.points
    bearings, bearing_sun = (np.broadcast_to(loss, (len(at),)) for loss in (bearings, bearing_sun))
    power_sun, power_ring = grid.torque_sun * at.speed_sun, grid.torque_ring * speed_ring_motor
    total = power_sun + power_ring
    none = np.full(len(at), np.nan)
    reverse = at.drive == "ring"
    power_in = np.where(reverse, power_ring, power_sun) if engaged else total
    power_out = -np.where(reverse, power_sun, power_ring) if engaged else np.zeros(len(at))
    bearing_in = np.where(reverse, bearings - bearing_sun, bearing_sun)
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = power_out / power_in if engaged else none
        eta_magnetic = (power_out + bearings - bearing_in) / (power_in - bearing_in) if engaged else none
        eta_bearings = eta / eta_magnetic
    found = {
        signals.POWER_IN: power_in,
        signals.POWER_OUT: power_out,
        signals.LOSS_TOTAL: total,
        signals.LOSS_BEARINGS: bearings,
        signals.LOSS_MAGNETIC: total - bearings if engaged else none,
        signals.EFFICIENCY_TOTAL: eta,
        signals.EFFICIENCY_MAGNETIC: eta_magnetic,
        signals.EFFICIENCY_BEARINGS: eta_bearings,
    }
    return {signal.name: np.where(np.isfinite(column), column, np.nan) for signal, column in found.items()}


def _free_carrier(scenario: Scenario, inputs: Inputs, at: OperatingPoints, torque_sun: Array) -> SteadyPoints:
    """Points with the ring held and the ring motor on the carrier, by the states of the whole drivetrain."""
    given = np.isfinite(torque_sun)
    states = np.zeros((len(STATES), len(at)))
    balances = np.ones(len(at), dtype=np.int64)
    sun_torque = torque_sun.copy()
    for rows, control, asked in ((given, Control.TORQUE, torque_sun), (~given, Control.SPEED, at.speed_sun)):
        if rows.any():
            train = replace(inputs.drivetrain, control_sun=control, control_ring=Control.TORQUE)
            found = equilibrium(train, asked[rows], at.torque_ring[rows])
            states[:, rows], balances[rows] = found.state, found.balances
            sun_torque[rows] = np.asarray(
                train.motion(found.state, SetPoints(asked[rows], at.torque_ring[rows])).sun.torque_out
            )
    column = dict(zip(STATES, states, strict=True))
    still = np.zeros(len(at))
    at = replace(
        at,
        speed_sun=column["speed_sun"],
        speed_ring=still,
        rest_sun=column["speed_sun"] == 0.0,
        rest_ring=np.ones(len(at), dtype=bool),
        drive=_drive(at, at.torque_ring, column["speed_ring_motor"]),
    )
    whole = steady(inputs.gearbox, at, scenario.output.campaign)
    grid = replace(whole, torque_sun=sun_torque, torque_ring=at.torque_ring)
    dissipated = flows(inputs.drivetrain, states).dissipated
    losses = {
        m.identifier: np.asarray(dissipated[m.title]) if m.title in dissipated else still
        for m in inputs.drivetrain.mechanisms
    }
    bearings = _bearings(inputs, losses)
    values = _balance(grid, column["speed_ring_motor"], bearings, bearings, True)
    return SteadyPoints(
        grid,
        column["speed_ring_motor"],
        column["speed_carrier"],
        column["phase"],
        losses,
        values,
        {},
        balances,
        _readings(inputs, grid),
    )

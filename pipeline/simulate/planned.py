"""A campaign that is to be run: its points in their order, and the noise to reckon with, as a grid without readings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.plans import join_points, make_points
from pmg.pipeline.fit.noise import NO_CORRELATION, NoiseFloor, ShaftNoise
from pmg.sim.errors import BenchError
from pmg.sim.grid import Grid
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pmg.pipeline.simulate.scenario import PlannedCampaign
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.signals import Array

SEED = 20260102
"""Seed of the random order of a planned campaign, and of which of its points are repeated."""

REVERSED_FLOW_SPEEDS, REVERSED_ROTATIONS = 6, 6
"""Points of the extensions: speeds at which the flow is reversed, and points turned backwards."""


def planned_grid(plan: PlannedCampaign, bench: BenchParameters) -> Grid:
    """The points of a plan in the order they are to be run; torques are placeholders.

    Raises
    ------
    BenchError
        Engaged speeds without loads, loads without speeds, no neutral point that turns, or an extension without the
        points that it needs.
    """
    sun, ring = (np.array(levels) * RPM for levels in (plan.neutral_sun_rpm, plan.neutral_ring_rpm))
    speed, load = np.array(plan.engaged_sun_rpm) * RPM, np.array(plan.engaged_load_nm)
    if bool(len(speed)) != bool(len(load)):
        came = "engaged speeds without loads" if len(speed) else "loads without engaged speeds"
        raise BenchError("plan", came, "both engaged_sun_rpm and engaged_load_Nm, or neither", "Add what is missing.")
    if plan.reversed_flow and not len(speed):
        raise BenchError("plan.reversed_flow", "true, without engaged points", "engaged points", "Add them.")
    rng = np.random.default_rng(SEED)
    s, r = (axis.ravel() for axis in np.meshgrid(sun, ring, indexing="ij"))
    moving = (s != 0.0) | (r != 0.0)
    if not moving.any():
        raise BenchError("plan", "no neutral speed but 0", "neutral points that turn", "Add speeds above 0 rpm.")
    if plan.reversed_rotation and not ((s != 0.0) & (r != 0.0)).any():
        came = "true, without neutral points at which both shafts turn"
        raise BenchError("plan.reversed_rotation", came, "such points", "Add speeds above 0 rpm for both shafts.")
    neutral = _neutral(s[moving], r[moving])
    if plan.order != "random":
        sense = 1 if plan.order == "rising" else -1
        neutral = neutral[np.lexsort((np.abs(neutral.speed_ring), np.abs(neutral.speed_sun)))[::sense]]
    parts = [neutral]
    if len(speed):
        v, t = (axis.ravel() for axis in np.meshgrid(speed, load, indexing="ij"))
        gear = bench.stages[0]
        engaged = make_points("E", "engaged", v, -v / bench.gear(gear).ratio, t, gear=gear, begin=0.0)
        if plan.order == "falling":
            engaged = engaged[np.arange(len(engaged))[::-1]]
        parts.append(engaged)
    main = join_points(*parts)
    if plan.order == "random":
        main = main[rng.permutation(len(main))]
    whole = [main, *_extensions(plan, bench, neutral, speed, load, rng)]
    at = join_points(*whole)
    at = replace(
        at,
        name=np.array([f"P{i + 1:04d}" for i in range(len(at))]),
        started_at=plan.seconds_a_point * np.arange(1.0, len(at) + 1.0),
    )
    zero = np.zeros(len(at))
    return Grid(
        origin="planned",
        campaign="plan",
        points=at,
        torque_sun=zero,
        torque_ring=at.torque_ring,
        within_sun=zero,
        within_ring=zero,
        u_sun=np.full(len(at), plan.noise_sun_nm),
        u_ring=np.full(len(at), plan.noise_ring_nm),
        common_sun=zero,
        common_ring=zero,
        accepted=np.ones(len(at), dtype=bool),
        reason=np.full(len(at), ""),
    )


def _neutral(sun: Array, ring: Array, name: str = "N") -> OperatingPoints:
    return make_points(name, "neutral", sun, ring, np.zeros(len(sun)), begin=0.0)


def _extensions(
    plan: PlannedCampaign,
    bench: BenchParameters,
    neutral: OperatingPoints,
    speed: Array,
    load: Array,
    rng: np.random.Generator,
) -> list[OperatingPoints]:
    """Repeats, reversed flow, reversed rotation, zero checks: after the main part."""
    parts = []
    if plan.repeats:
        parts.append(neutral[rng.choice(len(neutral), plan.repeats, replace=plan.repeats > len(neutral))])
    if plan.reversed_flow:
        some = speed[np.unique(np.linspace(0, len(speed) - 1, REVERSED_FLOW_SPEEDS).astype(int))]
        v, t = np.tile(some, 2), np.repeat([load.min(), load.max()], len(some))
        gear = bench.stages[0]
        flow = make_points("F", "engaged", v, -v / bench.gear(gear).ratio, -t, drive="ring", gear=gear, begin=0.0)
        parts.append(flow)
    if plan.reversed_rotation:
        turning = neutral[(neutral.speed_sun != 0.0) & (neutral.speed_ring != 0.0)]
        some_points = turning[np.linspace(0, len(turning) - 1, REVERSED_ROTATIONS).astype(int)]
        parts.append(_neutral(-some_points.speed_sun, -some_points.speed_ring, "B"))
    if plan.zero_checks:
        zero = np.zeros(plan.zero_checks)
        parts.append(make_points("Z", "zero", zero, zero, zero, begin=0.0))
    return parts


def planned_floor(plan: PlannedCampaign) -> NoiseFloor:
    """The noise that a plan reckons with."""

    def shaft(u: float) -> ShaftNoise:
        return ShaftNoise(u, np.inf, u, np.nan, 0, u, np.inf, NO_CORRELATION, "as planned")

    return NoiseFloor(shaft(plan.noise_sun_nm), shaft(plan.noise_ring_nm))

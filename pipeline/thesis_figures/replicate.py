"""From the thesis's tables to its figures, by its own method as written."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.damping import THESIS_CORRECTIONS, fit_damping
from pmg.pipeline.fit.loss_fit import THESIS_POWERS_RING, THESIS_POWERS_SUN, LossFits, fit_losses
from pmg.pipeline.fit.losses import largest_plausible_correction, power_balance
from pmg.pipeline.fit.options import THESIS_CORRECTION
from pmg.pipeline.thesis_figures.tables import DIAMETERS_RING, DIAMETERS_SUN, LOADS, SPEEDS, point_name
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim import signals
from pmg.sim.bench import GEARS
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.state import SetPoints
from pmg.sim.dynamics.transient import Task, transient
from pmg.sim.lossmodel import LossModel
from pmg.sim.maps.analytic import analytic_map
from pmg.sim.steady.forward import forward
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import MotorConvention, PowerChain, power_chain
from pmg.sim.steady.solve import steady

if TYPE_CHECKING:
    from pmg.pipeline.thesis_figures.tables import Sample
    from pmg.sim.bench import BenchParameters
    from pmg.sim.dynamics.assumptions import Assumptions
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

EDDY_TABLE = 2.22e-4
"""Eddy constant that the thesis simulates with [N m s/rad] (its table 6.9)."""

EDDY_IMPLIED = 2.2965e-4
"""Eddy constant that its power chain implies [N m s/rad]: 10.13 W at 1872 rpm need 2.2952e-4 to 2.2974e-4."""

LOSS_OF_GEAR = 10.13
"""That loss as printed [W] (section 6.4.3)."""

MOST_PLAUSIBLE = 0.90
"""Correction factor at which the thesis finds no magnetic efficiency above 1 (section 4.2.4)."""

DURATION = 20.0
"""Length of the run of section 6.3 [s]."""


@dataclass(frozen=True)
class Choices:
    """Given values of a replication.

    Parameters
    ----------
    powers_sun, powers_ring : tuple of float
        Terms of the loss curves.
    include_rest : bool
        Whether readings of a shaft at rest take part in them.
    correction : float
        K_corr of the simulated figures.
    torque_sun, torque_ring : float
        Torques of the run in time [N m].
    rtol : float
        Tolerance of its solver.
    damping : DampingMethod
        Weights of the damping fit. The source does not state them; bisquare is what its constants come out with.
    assumptions : Assumptions, optional
        What it leaves open about the bench in motion; the defaults where not given.
    """

    powers_sun: tuple[float, ...] = THESIS_POWERS_SUN
    powers_ring: tuple[float, ...] = THESIS_POWERS_RING
    include_rest: bool = True
    correction: float = THESIS_CORRECTION
    torque_sun: float = 1.0
    torque_ring: float = 2.3
    rtol: float = 1e-5
    damping: DampingMethod = DampingMethod.BISQUARE
    assumptions: Assumptions | None = None


THESIS = Choices()
"""The thesis's own."""


def replicate(sample: Sample, bench: BenchParameters, choices: Choices = THESIS) -> dict[str, float]:
    """All figures by id, in SI.

    Parameters
    ----------
    sample : Sample
        The thesis's tables.
    bench : BenchParameters
        Numbers of the bench.
    choices : Choices
        Terms of the curves, correction factor, torques of the run.

    Notes
    -----
    Figures of the simulation come twice where they depend on the eddy constant: with the one that is printed, and,
    in groups that end in ``-implied``, with the one that the printed power chain needs.
    """
    fits = fit_losses(sample.grid, choices.powers_sun, choices.powers_ring, include_rest=choices.include_rest)
    found = _design(bench) | _grids(sample, fits) | _printed(sample)
    for k in THESIS_CORRECTIONS:
        fit = fit_damping(sample.grid, fits, k, choices.damping)
        values = {"b": fit.b, "c": fit.c, "d": fit.d, "r-squared": fit.r_squared, "rmse": fit.rmse}
        found |= {f"damping-{k:.2f}.{name}": value for name, value in values.items()}
    for suffix, eddy in (("", EDDY_TABLE), ("-implied", EDDY_IMPLIED)):
        model = LossModel(fits.sun.curve, fits.ring.curve, choices.correction, 0.0, eddy, 0.0)
        gearbox = Gearbox.calibrated(bench, model)
        measured, simulated = _simulated(sample, gearbox)
        chain = power_chain(gearbox, simulated, bench, MotorConvention.THESIS)
        found |= _named(f"point{suffix}", _points(simulated))
        found |= _named(f"torques{suffix}", _differences(sample, simulated))
        found |= _named(f"chain{suffix}", _chain(chain))
        found |= _named(f"run{suffix}", _run(gearbox, model, measured, choices))
        if not suffix:
            found |= _named("steady", _steady(fits, measured, simulated, chain, model))
    return found


def _named(group: str, values: dict[str, float]) -> dict[str, float]:
    return {f"{group}.{name}": float(value) for name, value in values.items()}


def _design(bench: BenchParameters) -> dict[str, float]:
    values: dict[str, float] = {}
    for number in GEARS:
        gear = bench.gear(number)
        peak = analytic_map(gear).pull_out.torque_high
        on_ring = peak * gear.ratio
        values |= {f"ratio-{number}": gear.ratio, f"pull-out-sun-{number}": peak}
        values |= {f"pull-out-ring-{number}": on_ring, f"pull-out-carrier-{number}": peak + on_ring}
    for shaft, first, diameters in (("sun", 1, DIAMETERS_SUN), ("ring", 3, DIAMETERS_RING)):
        for i, diameter in enumerate(diameters, first):
            values[f"share-{shaft}-{i}"] = float(diameter / diameters.sum())
    return _named("design", values)


def _ratio(torque_sun: Array, torque_ring: Array) -> float:
    """Slope of the ring's torque with the sun's at equal speed; the losses, which go with speed, drop out."""
    sun, ring = (t - t.mean(axis=0) for t in (torque_sun, torque_ring))
    return float(np.sum(ring * ring) / np.sum(ring * sun))


def _grids(sample: Sample, fits: LossFits) -> dict[str, float]:
    grid, rows = sample.grid, sample.rows
    sun, ring = grid.torque_sun[rows], grid.torque_ring[rows]
    load, speed, late = 2, 3, 7  # 1.56 N m; 624 and 1248 rpm
    at_one = power_balance(grid, fits, 1.0).values[signals.LOSS_MAGNETIC.name]
    plausible = power_balance(grid, fits, MOST_PLAUSIBLE).values[signals.EFFICIENCY_MAGNETIC.name]
    values = {
        "ratio": _ratio(sun, ring),
        f"sun-{point_name(SPEEDS[speed], LOADS[load])}": sun[load, speed],
        f"ring-{point_name(SPEEDS[speed], LOADS[load])}": ring[load, speed],
        f"ring-{point_name(SPEEDS[late], LOADS[load])}": ring[load, late],
        "negative": np.count_nonzero(at_one < 0.0),
        "rule": largest_plausible_correction(grid, fits),
        "eta-magnetic": plausible.max(),
    }
    return _named("grids", values)


def _printed(sample: Sample) -> dict[str, float]:
    """Figures that follow from printed ones alone, without a model."""
    at = sample.grid.points
    top = sample.rows[-1, -1]
    squares = at.speed_sun[top] ** 2 + at.speed_ring[top] ** 2
    return {
        "torques.ratio": _ratio(sample.sun, sample.ring),
        "printed.power-in": float(sample.sun[-1, -1] * at.speed_sun[top]),
        "printed.eddy": float(LOSS_OF_GEAR / squares),
    }


def _simulated(sample: Sample, gearbox: Gearbox) -> tuple[Grid, Grid]:
    """The engaged points, measured and simulated, load by load."""
    measured = sample.grid[sample.rows.ravel()]
    return measured, steady(gearbox, measured.points)


def _differences(sample: Sample, simulated: Grid) -> dict[str, float]:
    difference = simulated.torque_sun - sample.sun.ravel()
    return {"rms": math.sqrt(np.mean(difference**2)), "largest": np.abs(difference).max()}


def _points(simulated: Grid) -> dict[str, float]:
    at = simulated.points
    names = map(point_name, at.speed_sun, at.load_set)
    return dict(zip(names, map(float, simulated.torque_sun), strict=True))


def _chain(chain: PowerChain) -> dict[str, float]:
    """The power chain of the last point, which has the highest speed and load."""
    c = {name: float(getattr(chain, name)[-1]) for name in chain.__dataclass_fields__}
    sun, ring = c["loss_sun_bearings"], c["loss_ring_bearings"]
    on_sun, on_ring = c["loss_relative_sun"], c["loss_relative_ring"]
    losses = {
        "motor-in": c["loss_motor_in"],
        "sun-bearings": sun + on_sun,
        "gear": c["loss_gear"],
        "ring-bearings": ring + on_ring,
        "motor-out": c["loss_motor_out"],
    }
    everything, bearings = sum(losses.values()), sun + on_sun + ring + on_ring
    return {
        **losses,
        **{f"share-{name}": loss / everything for name, loss in losses.items()},
        "all": everything,
        "electric-in": c["electric_in"],
        "mechanical-in": c["mechanical_in"],
        "mechanical-out": c["mechanical_out"],
        "electric-out": c["electric_out"],
        "relative-sun": on_sun,
        "relative-ring": on_ring,
        "eta-total": c["mechanical_out"] / c["mechanical_in"],
        "eta-electric": c["electric_out"] / c["electric_in"],
        "split-sun": sun / bearings,
        "split-relative": (on_sun + on_ring) / bearings,
        "split-ring": ring / bearings,
    }


def _steady(fits: LossFits, measured: Grid, simulated: Grid, chain: PowerChain, model: LossModel) -> dict[str, float]:
    """Losses and efficiencies of the 48 simulated points, and their distance from the measured ones."""
    at, k = simulated.points, model.correction
    balance = power_balance(simulated, fits, k).values
    eta = balance[signals.EFFICIENCY_TOTAL.name]
    bearings, total = balance[signals.LOSS_BEARINGS.name], balance[signals.LOSS_TOTAL.name]
    drag = k * (fits.sun.curve.torque(at.speed_sun) + fits.ring.curve.torque(at.speed_ring))
    magnetic = model.c * (np.abs(at.speed_sun) + np.abs(at.speed_ring))
    share = drag / (drag + magnetic)
    eta_magnetic = np.sort(balance[signals.EFFICIENCY_MAGNETIC.name])
    apart = np.abs(power_balance(measured, fits, k).values[signals.EFFICIENCY_TOTAL.name] - eta)
    means = apart.reshape(len(LOADS), len(SPEEDS)).mean(axis=1)
    return {
        "user": balance[signals.POWER_OUT.name][-1],
        "input": balance[signals.POWER_IN.name][-1],
        "total": total[-1],
        "bearings": bearings[-1],
        "gear": balance[signals.LOSS_MAGNETIC.name][-1],
        "eta": eta[-1],
        "torque-share": share.min(),
        "torque-magnetic": 1.0 - share.min(),
        "power-magnetic": (balance[signals.LOSS_MAGNETIC.name] / total).max(),
        "eta-magnetic": eta_magnetic[0],
        "eta-magnetic-next": eta_magnetic[1],
        "share-least": (bearings / total).min(),
        "share-most": (bearings / total).max(),
        "share-all": bearings[-1] / (chain.electric_in - chain.electric_out)[-1],
        **{f"difference-{load:.2f}": mean for load, mean in zip(LOADS, means, strict=True)},
        "difference": means.max(),
    }


def _run(gearbox: Gearbox, model: LossModel, measured: Grid, choices: Choices) -> dict[str, float]:
    """The run of section 6.3: torque ramps over one second, then held."""
    asked = SetPoints(choices.torque_sun, choices.torque_ring)
    sun, ring = (Programme.ramp(torque, 1.0) for torque in (asked.sun, asked.ring))
    train = Drivetrain.calibrated(gearbox.bench, model, choices.assumptions)
    trace = transient(Task(train, sun, ring, DURATION, times=np.array([DURATION])), rtol=choices.rtol)
    if trace.stopped is not None:
        raise trace.stopped
    m = train.motion(trace.last, asked)
    w_s, w_r = trace["speed_sun"][-1], trace["speed_ring"][-1]
    power_in, power_out = (model.c * w_s - m.magnetic_sun) * w_s, (m.magnetic_ring - model.c * w_r) * w_r
    at = replace(measured.points[np.array([0])], torque_ring=np.array([asked.ring]))
    return {
        "sun": w_s,
        "ring": w_r,
        "power-in": power_in,
        "power-out": power_out,
        "loss": power_in - power_out,
        "settled": float(forward(gearbox, at, np.array([asked.sun])).points.speed_sun[0]),
        "locked": trace.locked_at,
    }

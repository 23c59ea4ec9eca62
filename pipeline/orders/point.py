"""Every line of every signal over one window of a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.orders.fit import fit_orders
from pmg.pipeline.orders.flux import COIL_KINDS, coil_kind, flux_of_lines, linkage_area
from pmg.pipeline.orders.lines import lines_of, resolve
from pmg.pipeline.orders.load_angle import load_angle
from pmg.pipeline.orders.row import LineFit, Made, empty_row, fitted_row
from pmg.pipeline.windows.reduce import end_to_end_speed
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import FitError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import polars as pl

    from pmg.pipeline.orders.angle import Index
    from pmg.pipeline.orders.lines import Line
    from pmg.pipeline.orders.load_angle import LoadAngle
    from pmg.pipeline.orders.row import OrderRow
    from pmg.pipeline.recording.auxiliary_channels import Coil
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

TORQUES = ("torque_sun", "torque_ring")
SPEEDS = ("speed_sun", "speed_ring")
FLUX = "flux_"
"""Start of the names of flux densities, before that of the coil."""
FEWEST_SAMPLES = 100


@dataclass(frozen=True)
class Span:
    """Where a window lies and what it is.

    Parameters
    ----------
    point : str
        Test point.
    configuration : str
        Neutral, engaged or zero.
    gear : int
        1 or 2.
    first, stop : int
        Sample indices, `stop` left out.
    """

    point: str
    configuration: str
    gear: int
    first: int
    stop: int


@dataclass(frozen=True)
class PointOrders:
    """The lines of one window, and its load angle where it is engaged and both shafts turn."""

    span: Span
    rows: tuple[OrderRow, ...]
    load_angle: LoadAngle | None


def orders_of_point(
    samples: pl.DataFrame,
    span: Span,
    rate_hz: float,
    bench: BenchParameters,
    *,
    steps: Mapping[str, float],
    index: Mapping[str, Index | None],
    coils: Sequence[Coil] = (),
) -> PointOrders:
    """Every line of every signal over one window.

    Parameters
    ----------
    samples : polars.DataFrame
        Samples of the recording, as the store keeps them.
    span : Span
        The window.
    rate_hz : float
        Sample rate [Hz].
    bench : BenchParameters
        Poles and coils.
    steps : mapping of str to float
        One count of either encoder [rad].
    index : mapping of str to Index or None
        Place of the index of either shaft, where there are pulses.
    coils : sequence of Coil
        Voltages.

    Notes
    -----
    A shaft that turns steadily crosses the steps of its encoder in a rhythm, which is no noise: sampled, a line of it
    may fall on any order, up to the step over pi. What a speed swings by is only claimed beyond that; the interval
    reaches as far.
    """
    lines = lines_of(bench, span.gear)
    offset = int(samples["sample"][0]) if samples.height else 0
    part = samples.slice(max(0, span.first - offset), max(0, span.stop - span.first))
    angle = {side: part[f"angle_{side}"].to_numpy() for side in SIDES}
    names = [*TORQUES, *SPEEDS, *(FLUX + coil.name for coil in coils)]
    trouble = _trouble(angle)
    if trouble:
        return PointOrders(span, tuple(empty_row(name, line, trouble) for name in names for line in lines), None)
    speeds = {side: end_to_end_speed(angle[side], rate_hz) for side in SIDES}
    groups, left = resolve(lines, speeds, len(angle["sun"]) / rate_hz, rate_hz)
    zero = {side: _zero(angle[side], index[side], steps[side]) for side in SIDES}
    values: dict[str, Array] = {name: part[name].to_numpy() for name in TORQUES}
    values |= {speed: angle[side] - angle[side][0] for speed, side in zip(SPEEDS, SIDES, strict=True)}
    values |= {
        FLUX + coil.name: coil.part(span.first, span.stop)
        for coil in coils
        if coil.rate_hz == rate_hz and coil_kind(coil.name) in COIL_KINDS
    }
    whole = [name for name in names if name in values and np.isfinite(values[name]).all()]
    rows = [empty_row(name, line.line, line.reason) for name in names for line in left]
    lacking = {
        name: "samples missing" if name in values else "of another rate than the torque, or of no known kind"
        for name in names
    }
    rows += [empty_row(n, g.lines[0], lacking[n], g.name) for n in names if n not in whole for g in groups]
    stacked = np.stack([values[name] for name in whole]) if groups and whole else None
    try:
        orders = None if stacked is None else fit_orders(stacked, zero["sun"], zero["ring"], groups, rate_hz, steps)
    except FitError as error:
        orders = None
        rows += [empty_row(n, g.lines[0], error.came, g.name) for n in whole for g in groups]
    if orders is not None:
        for place, group in enumerate(groups):
            rate = group.lines[0].speed(speeds["sun"], speeds["ring"])
            reference = _reference(group.lines[0], index)
            for at, name in enumerate(whole):
                counted = steps[name.removeprefix("speed_")] / math.pi if name in SPEEDS else 0.0
                made = Made(rate, rate / rate_hz, _factor(name, rate, bench), counted, *reference)
                rows.append(fitted_row(name, group, LineFit.of(orders, at, place), made))
    engaged = span.configuration == Configuration.ENGAGED
    turning = all(abs(speeds[side]) * len(angle[side]) / rate_hz > REVOLUTION for side in SIDES)
    wound = (
        load_angle(angle["sun"], angle["ring"], bench.gear(span.gear), steps, index) if engaged and turning else None
    )
    return PointOrders(span, tuple(rows), wound)


def _trouble(angle: Mapping[str, Array]) -> str:
    """Why a window gives no order at all."""
    if len(angle["sun"]) < FEWEST_SAMPLES:
        return f"{counted(len(angle['sun']), 'sample')}; at least {FEWEST_SAMPLES} are needed"
    missing = [f"{np.count_nonzero(~np.isfinite(angle[side]))} of the {side}" for side in SIDES]
    if not all(np.isfinite(angle[side]).all() for side in SIDES):
        return f"angles missing: {', '.join(missing)}"
    return ""


def _zero(angle: Array, index: Index | None, step: float) -> Array:
    """Angle from the index, or from the first sample where there is none [rad]."""
    return np.asarray(angle - angle[0] if index is None else angle + step / 2.0 - index.angle)


def _reference(line: Line, index: Mapping[str, Index | None]) -> tuple[bool, float]:
    """Whether the phase of a line stands on index pulses, and its uncertainty by them [rad]."""
    u = 0.0
    for side, order in (("sun", line.order_sun), ("ring", line.order_ring)):
        place = index[side]
        if order and place is None:
            return False, 0.0
        if order and place is not None:
            u = math.hypot(u, order * place.u)
    return True, u


def _factor(signal: str, rate: float, bench: BenchParameters) -> complex:
    """Factor from the fitted amplitude, of torque, angle or voltage, to that of the signal."""
    if signal in SPEEDS:
        return 1j * rate
    if signal.startswith(FLUX):
        return complex(flux_of_lines(1.0, rate, linkage_area(bench, signal.removeprefix(FLUX))))
    return 1.0 + 0.0j

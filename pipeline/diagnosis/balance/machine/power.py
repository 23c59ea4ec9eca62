"""Losses and efficiency of a geared machine where it runs steadily, from its two torques, with uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import OUT
from pmg.pipeline.grid.transducer_uncertainty import tolerated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.machine.machine import Machine, MachineShaft
    from pmg.sim.signals import Array

BLOCK = 0.5
"""Length of the blocks that a record is looked at in [s]."""

FEWEST_BLOCKS = 4
"""Blocks of the shortest stretch that counts as steady; its first one is left out besides."""

EVEN_SPEED, EVEN_LOAD = 0.01, 0.02
"""Parts of the largest speed and torque within which a stretch, and the visits of an operating point, lie."""


@dataclass(frozen=True)
class SteadyPoint:
    """An operating point of a geared machine.

    Parameters
    ----------
    speed : float
        Of the input [rad/s].
    torque_input, torque_output : float
        Mean torques, each as its own shaft bears it [N m].
    loss : float
        Power that does not come out [W].
    u_repeat, u_loss : float
        Standard uncertainty of the loss: by repetition alone; with the tolerances of the transducers [W].
    efficiency, u_efficiency : float
        Power out over power in; NaN where no power passes.
    seconds : float
        Time over which it is averaged [s].
    visits : int
        Stretches that it is made of.
    """

    speed: float
    torque_input: float
    torque_output: float
    loss: float
    u_repeat: float
    u_loss: float
    efficiency: float
    u_efficiency: float
    seconds: float
    visits: int

    @property
    def above_one(self) -> bool:
        """Whether the efficiency lies above 1 with certainty: then an instrument, or a sign, is wrong."""
        return self.efficiency - 2.0 * self.u_efficiency > 1.0


@dataclass(frozen=True)
class _SteadyStretch:
    """A steady stretch: blocks of speed, load as the input sees it, and balance of the torques [N m]."""

    speed: Array
    load: Array
    balance: Array


def steady_points(recorded: Recorded, machine: Machine, inertia: float) -> tuple[SteadyPoint, ...]:
    r"""Operating points of a geared machine, slowest first.

    Parameters
    ----------
    recorded : Recorded
        Its recordings.
    machine : Machine
        Its gear, and the tolerances of its transducers.
    inertia : float
        Of both shafts as the input sees it [kg m2], for what acceleration is left.

    Notes
    -----
    :math:`P_\mathrm{loss} = (T_1 + T_2 / i - J \dot\omega_1) \omega_1`. The uncertainty by repetition is that of means
    of blocks of `BLOCK`; tolerances of transducers are half-widths of rectangular distributions that all readings of
    one share, and the zero of the balance has the error that recordings at rest leave. An efficiency above 1 is left as
    it is.
    """
    assert machine.gear is not None  # two torques
    ratio, (first, second) = machine.gear.ratio, machine.ends
    zero = float(np.linalg.norm(recorded.unsure.mean(axis=0)))
    found = []
    for group in _visits(list(_stretches(recorded, inertia))):
        blocks = [np.concatenate([getattr(s, name) for s in group]) for name in ("speed", "load", "balance")]
        speed, load, balance = (float(values.mean()) for values in blocks)
        n = len(blocks[2])
        repeat = float(np.std(blocks[2], ddof=1)) / math.sqrt(n) * math.sqrt((n - 1) / (n - 3))
        if len(group) > 1:  # what differs from visit to visit is no noise of blocks
            visits = np.array([s.balance.mean() for s in group])
            repeat = max(repeat, float(np.std(visits, ddof=1)) / math.sqrt(len(group)))
        own, other = _tolerance(first, balance - load), _tolerance(second, load * ratio) / abs(ratio)
        u_torque = math.sqrt(repeat**2 + own**2 + other**2 + zero**2)
        into, out = (balance - load, own), (load, other)
        if into[0] * speed < 0.0:  # power goes the other way
            into, out = out, into
        efficiency, u_efficiency = _efficiency(into, out, math.hypot(repeat, zero))
        found.append(
            SteadyPoint(
                speed=speed,
                torque_input=balance - load,
                torque_output=load * ratio,
                loss=balance * speed,
                u_repeat=repeat * abs(speed),
                u_loss=u_torque * abs(speed),
                efficiency=efficiency,
                u_efficiency=u_efficiency,
                seconds=n * BLOCK,
                visits=len(group),
            )
        )
    return tuple(sorted(found, key=lambda point: (point.speed, point.torque_output)))


def _tolerance(shaft: MachineShaft, torque: float) -> float:
    """Standard uncertainty of a torque by the tolerances of its transducer [N m]; zero where none are stated."""
    sensitivity, linearity, nominal = (
        shaft.numbers[key].value if key in shaft.numbers else 0.0
        for key in ("transducer.tolerance", "transducer.nonlinearity", "transducer.nominal")
    )
    return float(tolerated(sensitivity * torque, linearity * nominal))


def _efficiency(into: tuple[float, float], out: tuple[float, float], repeat: float) -> tuple[float, float]:
    """Power out over power in, and its standard uncertainty; NaN where both shafts put power in or take it.

    Torque as the input sees it, and its tolerance, of the shaft that puts power in, and of the other.
    """
    if into[0] * out[0] >= 0.0:
        return math.nan, math.nan
    value = -out[0] / into[0]
    shares = (value * tolerance / abs(torque) for torque, tolerance in (into, out))
    return value, math.hypot(*shares, repeat / abs(into[0]))


def _stretches(recorded: Recorded, inertia: float) -> Iterator[_SteadyStretch]:
    """Steady stretches of all records."""
    for one in recorded.each():
        m = one.motion
        length = max(round(BLOCK / m.sample_time), 1)
        count = len(m.time) // length
        if count <= FEWEST_BLOCKS:
            continue

        def blocks(values: Array, length: int = length, count: int = count) -> Array:
            return np.asarray(values[: length * count].reshape(count, length).mean(axis=1))

        speed, load = blocks(m.speed), blocks(m.besides[OUT])
        balance = blocks(m.force - inertia * m.acceleration)
        wide = EVEN_SPEED * float(np.abs(speed).max()), EVEN_LOAD * float(np.abs(load).max())
        start = 0
        for k in range(1, count + 1):
            even = k < count and abs(speed[k] - speed[start]) < wide[0] and abs(load[k] - load[start]) < wide[1]
            if even:
                continue
            if k - start > FEWEST_BLOCKS:
                inner = slice(start + 1, k)
                yield _SteadyStretch(speed[inner], load[inner], balance[inner])
            start = k


def _visits(stretches: list[_SteadyStretch]) -> list[list[_SteadyStretch]]:
    """Stretches at one operating point together."""
    if not stretches:
        return []
    fast = max(float(np.abs(s.speed).max()) for s in stretches)
    heavy = max(float(np.abs(s.load).max()) for s in stretches)
    groups: list[list[_SteadyStretch]] = []
    for one in stretches:
        for group in groups:
            near = abs(float(one.speed.mean() - group[0].speed.mean())) < EVEN_SPEED * fast
            if near and abs(float(one.load.mean() - group[0].load.mean())) < EVEN_LOAD * heavy:
                group.append(one)
                break
        else:
            groups.append([one])
    return groups

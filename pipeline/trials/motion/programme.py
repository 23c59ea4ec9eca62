"""Manoeuvres of a campaign: what each run asks of both drives, sample by sample, and the order of the runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.trials.design import FIRST_START, STARTS_WITHIN
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import RATIO
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pmg.sim.signals import Array

RATE = 1000.0
"""Samples per second [1/s]."""
DESIGNS = ("full", "slow ramps", "one direction", "no dither or sweep")
"""The full set of runs, and poor ones: speeds that only rise, slowly; the sun forward only; quiet runs only."""
LOADS = (0.39, 0.78, 1.17, 1.56, 1.95)
"""Ring torques of load steps [N m]."""
STEP_SPEEDS = (312, 936, 1560)
"""Speeds of the sun at which the load steps [rpm]."""


@dataclass(frozen=True)
class PlannedRun:
    """A run as planned.

    Parameters
    ----------
    point : str
        Its name.
    configuration : Configuration
        Neutral, engaged or zero.
    manoeuvre : Manoeuvre
        What it does.
    asked : mapping of str to (mode, (n,) array)
        Mode of each drive that works, and its reference at each sample [rad/s] or [N m]; a shaft left out is held.
    drive : str
        Side that drives when engaged.
    phases : tuple of (sample, phase)
        Phases after the start.
    free_from : float
        Part of the run after which the drives of a coast-down are without torque.
    started_at : datetime
        Time of the first sample [UTC].
    """

    point: str
    configuration: Configuration
    manoeuvre: Manoeuvre
    asked: Mapping[str, tuple[int, Array]]
    drive: str = "sun"
    phases: tuple[tuple[int, str], ...] = ()
    free_from: int | None = None
    started_at: datetime = field(default=datetime.fromtimestamp(FIRST_START, tz=UTC))

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(next(iter(self.asked.values()))[1])

    @property
    def inputs(self) -> Array:
        """Inputs of the kernel without any effect, (n, 2, INPUTS)."""
        found = np.zeros((self.samples, 2, at.INPUTS))
        found[:, :, at.DRAG_SCALE] = 1.0
        for row, side in enumerate(SIDES):
            if side in self.asked:
                mode, reference = self.asked[side]
                found[:, row, at.MODE], found[:, row, at.REFERENCE] = mode, reference
                found[self.free_from or self.samples :, row, at.MODE] = at.FREE
        return found


@dataclass(frozen=True)
class MotionCampaign:
    """The runs of a campaign in the order in which they are made."""

    design: str
    runs: tuple[PlannedRun, ...]

    def elapsed(self, run: PlannedRun) -> Array:
        """Time of each sample of a run since the start of the campaign [s]."""
        begun = (run.started_at - self.runs[0].started_at).total_seconds()
        return begun + np.arange(run.samples) / RATE

    @property
    def length(self) -> float:
        """Time from the first start to the last end [s]."""
        return float(self.elapsed(self.runs[-1])[-1])


def draw_campaign(rng: np.random.Generator, design: str = "full") -> MotionCampaign:
    """A campaign of about 24 runs, 30 s each, in an order that is drawn; zero runs first, last and in between."""
    runs = [run for run in _moving_runs(rng, design) if _kept(run, design)]
    again = rng.choice(len(runs), min(5, len(runs)), replace=False)
    runs += [replace(runs[i], point=f"{runs[i].point}_rep") for i in again]
    shuffled = [runs[i] for i in rng.permutation(len(runs))]
    middle = len(shuffled) // 2
    zeros = [_run(f"Z_{i}", Configuration.ZERO, Manoeuvre.ZERO, {"none": (at.HELD, _still(6.0))}) for i in range(3)]
    ordered = [zeros[0], *shuffled[:middle], zeros[1], *shuffled[middle:], zeros[2]]
    start = datetime.fromtimestamp(FIRST_START + round(rng.uniform(0.0, STARTS_WITHIN)), tz=UTC)
    placed = []
    for run in ordered:
        placed.append(replace(run, started_at=start))
        start += timedelta(microseconds=round(1e6 * (run.samples / RATE + rng.uniform(5.0, 25.0))))
    return MotionCampaign(design, tuple(placed))


def run_as_asked(
    point: str, manoeuvre: Manoeuvre, asked: Mapping[str, tuple[str, Callable[[Array], Array]]], seconds: float
) -> PlannedRun:
    """A run by what drives are asked for: ``speed`` [rad/s] or ``torque`` [N m] over time [s]; the driving one first.

    Without any, both shafts are held.
    """
    time = np.arange(round(seconds * RATE)) / RATE
    modes = {"speed": at.SPEED, "torque": at.TORQUE}
    courses = {side: (modes[quantity], course(time)) for side, (quantity, course) in asked.items()}
    kinds = (Configuration.ZERO, Configuration.NEUTRAL, Configuration.ENGAGED)
    run = _run(point, kinds[len(asked)], manoeuvre, courses or {"none": (at.HELD, _still(seconds))})
    return replace(run, drive=next(iter(asked), "sun"))


def _kept(run: PlannedRun, design: str) -> bool:
    """Whether a design has that run."""
    if design == "slow ramps":
        return run.manoeuvre is Manoeuvre.RAMP
    if design == "one direction":
        return not run.point.endswith(("_down", "_rev", "_flow", "_both", "_dither"))
    return design == "full" or run.manoeuvre not in (Manoeuvre.DITHER, Manoeuvre.SWEEP)


def _moving_runs(rng: np.random.Generator, design: str) -> Iterator[PlannedRun]:
    """Every run that moves, once."""
    top = {"sun": rng.uniform(1700.0, 1872.0) * RPM, "ring": rng.uniform(640.0, 720.0) * RPM}
    hill = _hill(rise=rng.uniform(11.0, 15.0), flat=rng.uniform(2.0, 4.0), rest=rng.uniform(0.4, 1.2))
    if design == "slow ramps":
        hill = _knots([0.0, 2.0, 30.0], [0.0, 0.0, 1.0])
    neutral = Configuration.NEUTRAL
    for side in SIDES:
        for name, sign in (("up", 1.0), ("down", -1.0)):
            asked = {side: (at.SPEED, sign * top[side] * hill)}
            yield _run(f"N_{side}_{name}", neutral, Manoeuvre.RAMP, asked)
        rise = _knots([0.0, 5.0, 24.0], [0.0, 1.0, 1.0])
        free = round(rng.uniform(7.0, 9.0) * RATE)
        coast = _run(f"N_{side}_coast", neutral, Manoeuvre.COAST, {side: (at.SPEED, top[side] * rise)})
        yield replace(coast, free_from=free, phases=((0, "COAST"), (free, "COAST")))
        yield _run(f"N_{side}_dither", neutral, Manoeuvre.DITHER, {side: (at.SPEED, top[side] * _dither(rng))})
    both = {"sun": (at.SPEED, top["sun"] * hill), "ring": (at.SPEED, -top["ring"] * hill)}
    yield _run("N_both", neutral, Manoeuvre.RAMP, both)
    fast = min(top["sun"], RATIO * top["ring"])
    for load in (0.78, 1.56):
        yield _engaged(f"E_ramp_l{load:.2f}", Manoeuvre.RAMP, fast * hill, load * _load_hill(hill))
    yield _engaged("E_ramp_rev", Manoeuvre.RAMP, -fast * hill, -1.17 * _load_hill(hill))
    yield _engaged("E_flow", Manoeuvre.RAMP, -0.83 * fast / RATIO * hill, -1.56 / RATIO * _load_hill(hill), "ring")
    for rpm in STEP_SPEEDS:
        speed = rpm * RPM * _knots([0.0, 4.0, 25.0], [0.0, 1.0, 1.0])
        yield _engaged(f"E_steps_s{rpm:04d}", Manoeuvre.STEPS, speed, _load_steps(rng))
    speed = rng.uniform(560.0, 800.0) * RPM * _knots([0.0, 4.0, 34.0], [0.0, 1.0, 1.0])
    yield _engaged("E_sweep", Manoeuvre.SWEEP, speed, _chirp(rng))


def _run(
    point: str, configuration: Configuration, manoeuvre: Manoeuvre, asked: Mapping[str, tuple[int, Array]]
) -> PlannedRun:
    return PlannedRun(point, configuration, manoeuvre, asked, phases=((0, manoeuvre.value.upper()),))


def _engaged(point: str, manoeuvre: Manoeuvre, speed: Array, load: Array, drive: str = "sun") -> PlannedRun:
    """A run of the gear, speed on the driving side [rad/s] and torque on the other [N m]."""
    loaded = "ring" if drive == "sun" else "sun"
    asked = {drive: (at.SPEED, speed), loaded: (at.TORQUE, load)}
    return replace(_run(point, Configuration.ENGAGED, manoeuvre, asked), drive=drive)


def _knots(times: Sequence[float], values: Sequence[float]) -> Array:
    """Straight lines from knot to knot [s], at each sample."""
    return np.interp(np.arange(round(times[-1] * RATE)) / RATE, times, values)


def _still(seconds: float) -> Array:
    return np.zeros(round(seconds * RATE))


def _hill(rise: float, flat: float, rest: float) -> Array:
    """Up to 1 and down again between two rests."""
    ends = np.cumsum([0.0, rest, rise, flat, rise, rest])
    return _knots(ends.tolist(), [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])


def _load_hill(hill: Array) -> Array:
    """A load that comes while the bench stands, stays, and goes when it stands again."""
    moving = np.flatnonzero(hill > 0.0)
    n, first, last = len(hill), int(moving[0]), int(moving[-1])
    return np.interp(np.arange(n), [0, first, last, n], [0.0, 1.0, 1.0, 0.0])


def _dither(rng: np.random.Generator) -> Array:
    """Slow swings through standstill, then quick ones about a speed; of the highest speed."""
    t = np.arange(round(30.0 * RATE)) / RATE
    slow = rng.uniform(0.018, 0.035) * np.sin(REVOLUTION * t / rng.choice([3.0, 3.75, 5.0]))
    mean, depth, frequency = rng.uniform(0.3, 0.4), rng.uniform(0.05, 0.09), rng.uniform(1.0, 3.0)
    level = np.interp(t, [15.0, 17.0, 29.0, 30.0], [0.0, 1.0, 1.0, 0.0])
    return np.where(t < 15.0, slow, level * (mean + depth * np.sin(REVOLUTION * frequency * t)))


def _load_steps(rng: np.random.Generator) -> Array:
    """Loads in an order that is drawn, three seconds each [N m]."""
    t = np.arange(round(25.0 * RATE)) / RATE
    loads = np.array(LOADS)[[0, *(1 + rng.permutation(4)), 0]]
    steps = loads[np.clip(((t - 4.0) / 3.5).astype(np.int64), 0, 5)]
    return np.asarray(steps * np.minimum(t, 1.0))


def _chirp(rng: np.random.Generator) -> Array:
    """A load that swings ever faster [N m]."""
    t = np.arange(round(34.0 * RATE)) / RATE
    low, high, span = rng.uniform(0.5, 1.0), rng.uniform(25.0, 45.0), 29.0
    since = np.maximum(t - 5.0, 0.0)
    phase = REVOLUTION * low * span / np.log(high / low) * (np.exp(since / span * np.log(high / low)) - 1.0)
    return np.asarray(1.17 * np.minimum(t / 2.0, 1.0) + rng.uniform(0.2, 0.3) * np.sin(phase))

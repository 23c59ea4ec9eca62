"""A concealed campaign of another machine: drawn, its causes sized against the noise of the regression, its truth.

Nothing here is shared with the library of terms that has to find the causes: neither code nor formulas.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from pmg.pipeline.trials.machines.causes import (
    BY_NAME,
    CAUSES,
    FIXED,
    OUTSIDE,
    PAIRS,
    PLAIN,
    built_with,
    draw_constants,
)
from pmg.pipeline.trials.machines.kinds import KINDS, MadeMachine, draw_machine
from pmg.pipeline.trials.machines.manoeuvres import MadeCourse, draw_courses
from pmg.pipeline.trials.machines.readings import MadeReadings, misread, run_course

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.sim.signals import Array

SCHEMA = "pmg.machine-truth/1"
LEAST, LARGEST = 0.75, 5.0
"""Sizes that are drawn [standard deviations of the noise of the regression]."""

KNOWN_UNRECORDED = 0.004
"""Thinning of what is viscous in a record of any machine: its temperature is not recorded."""

TRIES = 7
"""Runs in the search for an amplitude."""

HUM_PHASE = 2.4
"""By how much a hum has moved on from record to record [rad]."""

ENDS = 400
"""Samples at either end that the filter of the yardstick spoils."""


@dataclass(frozen=True)
class ConcealedPart:
    """One concealed cause: its name, the size that was asked for, amplitude and size reached."""

    name: str
    asked: float
    amplitude: float
    reached: float


@dataclass(frozen=True)
class MachineCampaign:
    """A concealed campaign.

    Parameters
    ----------
    number, seed : int
        Place in the trial, and its master seed.
    stratum : str
        ``clean``, ``one``, ``outside`` or ``two``.
    machine : MadeMachine
        The machine.
    courses : tuple of MadeCourse
        Two to fit, one to withhold.
    parts : tuple of ConcealedPart
        What is concealed.
    constants : mapping of str to float
        Constants of the causes.
    """

    number: int
    seed: int
    stratum: str
    machine: MadeMachine
    courses: tuple[MadeCourse, ...]
    parts: tuple[ConcealedPart, ...]
    constants: Mapping[str, float]

    @cached_property
    def records(self) -> tuple[MadeReadings, ...]:
        """What the records show."""
        amplitudes = {part.name: part.amplitude for part in self.parts}
        return _records(self.machine, self.courses, amplitudes, self.constants, _noise_seed(self.seed, self.number))

    @property
    def right(self) -> list[list[str]]:
        """Sets of terms that are right to name."""
        sets = [BY_NAME[part.name].right for part in self.parts]
        if not sets or any(not each for each in sets):
            return []
        return [sorted({term for each in chosen for term in each}) for chosen in product(*sets)]

    @property
    def truth(self) -> dict[str, Any]:
        """All that is concealed, ready for JSON."""
        nonce = np.random.SeedSequence(self.seed, spawn_key=(2, self.number)).generate_state(4)
        return {
            "schema": SCHEMA,
            "campaign": self.number,
            "nonce": [int(word) for word in nonce],
            "kind": self.machine.kind,
            "stratum": self.stratum,
            "parts": [vars(part) for part in self.parts],
            "right": self.right,
            "sign": any(part.name == "sign_of_torque" for part in self.parts),
            "constants": dict(self.constants),
            "plant": self.machine.plant._asdict() | {"limit": None},
            "noise": {"white": self.machine.noise, "wander": self.machine.wander},
        }

    @property
    def sealed_text(self) -> str:
        """The truth as the text that is sealed."""
        return json.dumps(self.truth, indent=1, sort_keys=True) + "\n"


def _noise_seed(seed: int, number: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(1, number))


def _records(
    machine: MadeMachine,
    courses: tuple[MadeCourse, ...],
    amplitudes: Mapping[str, float],
    constants: Mapping[str, float],
    noise: np.random.SeedSequence | None,
) -> tuple[MadeReadings, ...]:
    """Records of the courses; without a seed of the noise there is none."""
    plant = machine.plant
    thin = KNOWN_UNRECORDED if noise is not None else 0.0
    plant = plant._replace(thinning=thin, warm_time=machine.seconds)
    peak = 0.0
    if "drive_limit" in amplitudes:
        quiet = _records(machine, courses, {}, constants, None)
        peak = max(float(np.abs(one.push).max()) for one in quiet)
    for name, amplitude in amplitudes.items():
        changed = built_with(machine, name, amplitude, constants, peak)
        given = {key: value for key, value in changed._asdict().items() if value != getattr(machine.plant, key)}
        plant = plant._replace(**given)
    found = []
    streams = np.random.SeedSequence(0).spawn(3) if noise is None else noise.spawn(3)
    if noise is not None:  # the same draws at every call
        streams = np.random.SeedSequence(noise.entropy, spawn_key=noise.spawn_key).spawn(3)
    for k, (course, stream) in enumerate(zip(courses, streams, strict=True)):
        plant = plant._replace(hum_phase=HUM_PHASE * k)
        shown = run_course(machine, plant, course, np.random.default_rng(stream), quiet=noise is None)
        if machine.kind == "wheel":
            shown = _while_it_turns(shown)
        for name, amplitude in amplitudes.items():
            shown = misread(machine, shown, name, amplitude, constants)
        found.append(shown)
    return tuple(found)


def _while_it_turns(shown: MadeReadings) -> MadeReadings:
    """A record of a wheel up to where it has nearly come to rest."""
    slow = np.flatnonzero(shown.speed < 0.02 * shown.speed[0])
    end = int(slow[0]) if len(slow) else len(shown.time)
    return MadeReadings(*(getattr(shown, name)[:end] for name in ("time", "way", "speed", "push", "load")))


def _left_by_baseline(machine: MadeMachine, records: tuple[MadeReadings, ...]) -> float:
    """Root mean square of what inertia, viscous and dry friction leave of some records, in the band [N or N m]."""
    sos = butter(4, machine.band, fs=machine.rate, output="sos")
    goals, columns = [], []
    for one in records:
        way, speed = (np.asarray(sosfiltfilt(sos, each)) for each in (one.way, one.speed))
        if machine.reach:
            speed = np.gradient(way, 1.0 / machine.rate)
        slope = np.gradient(speed, 1.0 / machine.rate)
        sense = speed / np.sqrt(speed**2 + machine.plant.width**2)
        push = one.push + one.load
        design = np.c_[speed, sense]
        if machine.known_inertia:
            push = push - machine.plant.inertia * slope
        else:
            design = np.c_[design, slope]
        rows = slice(ENDS, -ENDS)
        smooth = np.asarray(sosfiltfilt(sos, np.c_[push, design], axis=0))[rows]
        goals.append(smooth[:, 0])
        columns.append(smooth[:, 1:])
    goal, design = np.concatenate(goals), np.concatenate(columns)
    found: Array = np.linalg.lstsq(design, goal, rcond=None)[0]
    return float(np.sqrt(np.mean((goal - design @ found) ** 2)))


def _sized(
    machine: MadeMachine,
    courses: tuple[MadeCourse, ...],
    name: str,
    asked: float,
    constants: Mapping[str, float],
    noise: float,
) -> ConcealedPart:
    """A cause of about the size that is asked for."""
    cause = BY_NAME[name]

    def size(amplitude: float) -> float:
        quiet = _records(machine, courses, {name: amplitude}, constants, None)
        return _left_by_baseline(machine, quiet[:2]) / noise

    if cause.sort == FIXED:
        return ConcealedPart(name, 0.0, 1.0, size(1.0))
    amplitude, reached = cause.start, 0.0
    best = (np.inf, amplitude, 0.0)
    for _ in range(TRIES):
        reached = size(amplitude)
        off = abs(np.log(max(reached, 1e-6) / asked))
        best = min(best, (off, amplitude, reached))
        if off < 0.05:
            break
        power = 1.0 if cause.sort == PLAIN else 0.6
        amplitude = min(amplitude * float(np.clip(asked / max(reached, 1e-6), 0.05, 20.0)) ** power, cause.most)
    return ConcealedPart(name, asked, float(best[1]), float(best[2]))


def _options(stratum: str) -> list[tuple[str, tuple[str, ...]]]:
    """Kinds with what they may conceal."""
    if stratum == "clean":
        return [(kind, ()) for kind in KINDS]
    if stratum == "two":
        kinds = [(pair, set(BY_NAME[pair[0]].kinds) & set(BY_NAME[pair[1]].kinds)) for pair in PAIRS]
        return [(kind, pair) for pair, both in kinds for kind in KINDS if kind in both]
    chosen = [cause for cause in CAUSES if (cause.sort == OUTSIDE) == (stratum == "outside")]
    return [(kind, (cause.name,)) for cause in chosen for kind in cause.kinds]


def _choice(stratum: str, turn: int, seed: int) -> tuple[str, tuple[str, ...]]:
    """Kind and causes of the campaign that comes in that place of its stratum: causes in turn, kinds drawn."""
    options = _options(stratum)
    key = {"clean": 0, "one": 1, "outside": 2, "two": 3}[stratum]
    groups: dict[object, list[tuple[str, tuple[str, ...]]]] = {}
    for kind, names in options:
        groups.setdefault(names or kind, []).append((kind, names))
    turns, place = divmod(turn, len(groups))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, key, turns)))
    group = list(groups.values())[int(rng.permutation(len(groups))[place])]
    first = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4, key))).integers(len(group), size=50)
    chosen: tuple[str, tuple[str, ...]] = group[(int(first[place]) + turns) % len(group)]
    return chosen


def draw_machine_campaign(number: int, stratum: str, turn: int, seed: int) -> MachineCampaign:
    """A campaign of the trial.

    Parameters
    ----------
    number : int
        Place in the trial.
    stratum : str
        Kind of what it conceals.
    turn : int
        How many of that kind came before.
    seed : int
        Master seed.
    """
    kind, names = _choice(stratum, turn, seed)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, number)))
    machine = draw_machine(kind, rng, known_inertia=any(BY_NAME[name].known_inertia for name in names))
    courses, constants = draw_courses(machine, rng), draw_constants(machine, rng)
    sizes = [float(np.exp(rng.uniform(np.log(LEAST), np.log(LARGEST)))) for _ in names]
    parts: tuple[ConcealedPart, ...] = ()
    if names:
        clean = _records(machine, courses, {}, constants, _noise_seed(seed, number))
        noise = _left_by_baseline(machine, clean[:2])
        sized = (
            _sized(machine, courses, name, size, constants, noise) for name, size in zip(names, sizes, strict=True)
        )
        parts = tuple(sized)
    return MachineCampaign(number, seed, stratum, machine, courses, parts, constants)

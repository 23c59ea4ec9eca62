"""Concealed campaigns in motion: drawn from a bench of its own, measured with noise, their truth to be sealed.

Nothing here is shared with the models that have to find the effects: neither code nor formulas::

    rng = numpy.random.default_rng(7)
    stratum = rng.choice(motion_strata())                # or draw_motion_case(rng, stratum, size=2.0)
    case = draw_motion_case(rng, stratum)
    runs = measure_motion_case(case, rng)                # list of MovingRun, as reading the recordings would give them
    write_motion_case(case, folder, rng)                 # or the recordings; the same state of rng, the same readings
    case.truth                                           # all that is concealed, ready for JSON
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import timedelta
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.recording.write import SimulatedRun, recording_bytes
from pmg.pipeline.store.moving_record import Phase
from pmg.pipeline.trials.laws import USUAL
from pmg.pipeline.trials.motion.bench import draw_bench
from pmg.pipeline.trials.motion.effect import MotionEffect
from pmg.pipeline.trials.motion.programme import RATE, draw_campaign
from pmg.pipeline.trials.motion.sensors import CALIBRATION, COUNT, Instruments
from pmg.pipeline.trials.motion.size import MotionYardstick, Scene, SizedEffect, scale_to
from pmg.pipeline.trials.motion.strata import FORMS, MotionStratum
from pmg.pipeline.trials.nature import right_verdicts
from pmg.sim.grid import Configuration
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    import numpy as np

    from pmg.pipeline.trials.motion.bench import MovingBench
    from pmg.pipeline.trials.motion.machine import BenchCourse
    from pmg.pipeline.trials.motion.programme import MotionCampaign, PlannedRun
    from pmg.sim.signals import Array

__all__ = ("MotionCase", "draw_motion_case", "measure_motion_case", "with_further_runs", "write_motion_case")

SCHEMA = "pmg.motion-truth/1"
SHOWN_BY_ITS_RUNS = 0.75
"""Size in the runs of a poor design from which on they show an effect [sigma]: to name it is then no guess."""
PAUSE = 15.0
"""Time from the end of a run to a further one [s]."""
TURNS_BEFORE = 4096.0
"""Turns that the encoders have counted when a run begins, so that no counter runs below zero."""


@dataclass(frozen=True)
class MotionCase:
    """A concealed campaign in motion.

    Parameters
    ----------
    campaign : str
        Its name, which tells nothing.
    stratum : MotionStratum
        What kind it is.
    scene : Scene
        The bench and its runs.
    effects : tuple of SizedEffect
        What is concealed.
    nonce : str
        Random digits, so that a sealed truth cannot be guessed.
    """

    campaign: str
    stratum: MotionStratum
    scene: Scene
    effects: tuple[SizedEffect, ...]
    nonce: str

    @cached_property
    def courses(self) -> list[BenchCourse]:
        """Every run without noise."""
        return self.scene.courses([sized.effect for sized in self.effects])

    @property
    def expected(self) -> tuple[str, ...]:
        """Verdicts that are right: those of the stratum, that all is well where nothing is left to be seen, or a name.

        A poor design may show an effect all the same, by its size in these very runs.
        """
        reached = [sized.reached.absorbed for sized in self.effects]
        right = self.stratum.expected
        if self.stratum.kind == "confounded" and max(reached) >= SHOWN_BY_ITS_RUNS:
            right = (*right, "named")
        return right_verdicts(right, reached)

    @property
    def truth(self) -> dict[str, Any]:
        """All that is concealed, ready for JSON."""
        return {
            "schema": SCHEMA,
            "campaign": self.campaign,
            "nonce": self.nonce,
            "stratum": self.stratum.name,
            "kind": self.stratum.kind,
            "design": self.stratum.design,
            "expected": list(self.expected),
            "effects": [_effect_truth(sized) for sized in self.effects],
            "bench": self.scene.bench.truth,
            "runs": [
                {"point": run.point, "started_at": run.started_at.isoformat()} for run in self.scene.campaign.runs
            ],
        }


def _effect_truth(sized: SizedEffect) -> dict[str, Any]:
    return {
        **sized.effect.truth,
        "asked_sigma": sized.asked,
        "reached_sigma": sized.reached.absorbed,
        "raw_sigma": sized.reached.raw,
        "rms_torque_Nm": asdict(sized.reached.rms),
    }


def draw_motion_case(
    rng: np.random.Generator,
    stratum: MotionStratum,
    *,
    size: float | None = None,
    laws: str = USUAL,
    sized: tuple[SizedEffect, ...] | None = None,
) -> MotionCase:
    """A concealed campaign of that kind, whose effects follow usual laws, reserved ones, or any.

    Parameters
    ----------
    rng : numpy.random.Generator
        The same state draws the same case.
    stratum : MotionStratum
        Its kind.
    size : float, optional
        Size of each effect [sigma] instead of the stratum's.
    laws : str
        ``usual``, ``reserved`` or ``all``.
    sized : tuple of SizedEffect, optional
        Its effects as an earlier draw of the same case sized them, which takes most of the time; sized anew by default.
    """
    if size is not None:
        stratum = replace(stratum, size=size)
    bench = draw_bench(rng)
    drawn = [_draw_effect(identifier, shaft, rng, laws) for identifier, shaft in stratum.effects]
    scene = _scene(bench, draw_campaign(rng), rng)
    effects = _sized(scene, drawn, stratum.size) if sized is None else sized
    if stratum.design != "full":  # what is plain in a full campaign need not be in this one
        scene = _scene(bench, draw_campaign(rng, stratum.design), rng)
        if sized is None:
            effects = tuple(_measured(MotionYardstick(scene), each.effect, stratum.size) for each in effects)
    return MotionCase(f"campaign-{rng.bytes(4).hex()}", stratum, scene, effects, rng.bytes(16).hex())


def _scene(bench: MovingBench, campaign: MotionCampaign, rng: np.random.Generator) -> Scene:
    begun = rng.uniform(0.0, REVOLUTION, (len(campaign.runs), 2)) + TURNS_BEFORE * REVOLUTION
    return Scene(bench, campaign, tuple(PerShaft(*map(float, pair)) for pair in begun))


def _sized(scene: Scene, drawn: Sequence[MotionEffect], asked: float) -> tuple[SizedEffect, ...]:
    """Effects at a size that each has alone; a repeated run tells nothing new of it."""
    if not drawn:
        return ()
    yardstick = MotionYardstick(scene.once)
    return tuple(
        scale_to(yardstick, effect, asked) if effect.form.seen else _measured(yardstick, effect, asked)
        for effect in drawn
    )


def _measured(yardstick: MotionYardstick, effect: MotionEffect, asked: float) -> SizedEffect:
    return SizedEffect(effect, asked, yardstick.measure(yardstick.scene.courses([effect])))


def _draw_effect(identifier: str, shaft: str, rng: np.random.Generator, laws: str = USUAL) -> MotionEffect:
    """An effect of that id with its law and shape drawn, and a size of the usual order."""
    form = FORMS[identifier]
    knobs = form.laws.draw(laws, rng, {}) | {name: rng.uniform(*ends) for name, ends in form.ranges.items()}
    sign = float(rng.choice([-1.0, 1.0])) if form.signed else 1.0
    return MotionEffect(form, shaft, form.first, {**knobs, "sign": sign})


def _measured_runs(
    case: MotionCase, rng: np.random.Generator
) -> Iterator[tuple[BenchCourse, PerShaft[Array], PerShaft[Array]]]:
    """Every run in its order, with torques [N m] and angles [rad] as recorded."""
    instruments = Instruments(case.scene.bench.noise, rng)
    for course in case.courses:
        read = instruments.read(course)
        yield course, read.map(lambda pair: pair[0]), read.map(lambda pair: pair[1])


def measure_motion_case(case: MotionCase, rng: np.random.Generator) -> list[MovingRun]:
    """The runs of a campaign as reading its recordings would give them, without writing them."""
    found = []
    for i, (course, torque, angle) in enumerate(_measured_runs(case, rng)):
        run = course.run
        engaged = run.configuration is Configuration.ENGAGED
        stop = run.samples - 1  # the end stands at the last sample and is left out
        found.append(
            MovingRun(
                file=_file(i),
                point=run.point,
                configuration=run.configuration,
                gear=1,
                drive=run.drive,
                manoeuvre=run.manoeuvre,
                started_at=run.started_at,
                rate=RATE,
                torque=PerShaft(torque.sun[:stop], torque.ring[:stop]),
                angle=PerShaft(angle.sun[:stop], angle.ring[:stop]),
                count=PerShaft(COUNT, COUNT),
                turns=PerShaft(*(engaged or side in run.asked for side in ("sun", "ring"))),
                phases=_phases(run),
            )
        )
    return found


def with_further_runs(case: MotionCase, runs: Sequence[PlannedRun], rng: np.random.Generator) -> MotionCase:
    """The same bench with some more runs after the others, each a while after the one before it."""
    planned = case.scene.campaign.runs
    for run in runs:
        begin = planned[-1].started_at + timedelta(seconds=planned[-1].samples / RATE + PAUSE)
        planned = (*planned, replace(run, started_at=begin))
    begun = rng.uniform(0.0, REVOLUTION, (len(runs), 2)) + TURNS_BEFORE * REVOLUTION
    scene = replace(
        case.scene,
        campaign=replace(case.scene.campaign, runs=planned),
        begun=(*case.scene.begun, *(PerShaft(*map(float, pair)) for pair in begun)),
    )
    return replace(case, scene=scene)


def _phases(run: PlannedRun) -> tuple[Phase, ...]:
    stops = (*(sample for sample, _ in run.phases[1:]), run.samples - 1)
    return tuple(Phase(name, first, stop) for (first, name), stop in zip(run.phases, stops, strict=True))


def write_motion_case(case: MotionCase, folder: Path, rng: np.random.Generator) -> None:
    """The recordings, written into a folder that is there already; the truth is not among them."""
    for i, (course, torque, angle) in enumerate(_measured_runs(case, rng)):
        planned = course.run
        run = SimulatedRun(
            campaign=case.campaign,
            point=planned.point,
            configuration=planned.configuration,
            gear=1,
            started_at=planned.started_at,
            drive=planned.drive,
            rate=RATE,
            torque_sun=torque.sun,
            torque_ring=torque.ring,
            angle_sun=angle.sun + 0.5 * COUNT,
            angle_ring=angle.ring + 0.5 * COUNT,
            setpoints={},
            manoeuvre=planned.manoeuvre.value,
            phases=planned.phases,
        )
        (folder / _file(i)).write_bytes(recording_bytes(run, CALIBRATION))


def _file(place: int) -> str:
    return f"{place:04d}.mcap"

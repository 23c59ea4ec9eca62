"""Which chapters of the report a campaign permits, why others are not possible, and what would unlock them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.design.blind import confounded_shafts
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.fit.drift import MINIMUM_DOF
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.orders.load_angle import FEWEST_POINTS
from pmg.pipeline.preflight.survey import INDEX
from pmg.pipeline.recording.channels import TEMPERATURE_TOPICS
from pmg.pipeline.windows.steadiness import REST_SPEED
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import FitError
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.preflight.found import Asked, Survey
    from pmg.sim.bench import BenchParameters

YES, IN_PART, NO, UNKNOWN = "yes", "in part", "no", "unknown"


@dataclass(frozen=True)
class Ability:
    """One thing that can be made of the recordings, or not.

    Parameters
    ----------
    chapter : str
        What.
    state : str
        ``yes``, ``in part``, ``no``, or ``unknown`` where no set-points are named.
    why : str
        What it rests on, or what is lacking.
    unlock : str
        The recording that would permit it, or more of it; empty where nothing is lacking.
    """

    chapter: str
    state: str
    why: str
    unlock: str = ""


@dataclass(frozen=True)
class Design:
    """The test points of a campaign in numbers.

    Parameters
    ----------
    zero, neutral, engaged : int
        Points of each configuration that no check rejected.
    sun, ring : int
        Levels of the shafts' speeds in neutral, rest among them.
    speeds, loads : int
        Levels of the sun's speed and of the load when engaged.
    repeats : int
        Neutral and engaged points beyond the first at the same set-points.
    rejected : int
        Points that a check rejected.
    """

    zero: int
    neutral: int
    engaged: int
    sun: int
    ring: int
    speeds: int
    loads: int
    repeats: int
    rejected: int

    @classmethod
    def of(cls, points: Iterable[Asked]) -> Design:
        """Count some points."""
        listed = list(points)
        good = [point for point in listed if point.accepted]
        kinds = {kind: [p for p in good if p.configuration == kind] for kind in Configuration}
        neutral, engaged = kinds[Configuration.NEUTRAL], kinds[Configuration.ENGAGED]
        same = Counter((p.configuration, p.gear, p.drive, *_levels(p)) for p in (*neutral, *engaged))
        return cls(
            zero=len(kinds[Configuration.ZERO]),
            neutral=len(neutral),
            engaged=len(engaged),
            sun=len({_levels(p)[0] for p in neutral}),
            ring=len({_levels(p)[1] for p in neutral}),
            speeds=len({_levels(p)[0] for p in engaged}),
            loads=len({_levels(p)[2] for p in engaged}),
            repeats=sum(same.values()) - len(same),
            rejected=len(listed) - len(good),
        )

    def summary(self) -> str:
        """In one line."""
        parts = [counted(self.zero, "zero check")]
        parts.append(
            f"{self.neutral} neutral" + (f" ({self.sun} sun x {self.ring} ring speeds)" if self.neutral else "")
        )
        levels = f" ({counted(self.speeds, 'speed')} x {counted(self.loads, 'load')})" if self.engaged else ""
        parts += [f"{self.engaged} engaged{levels}", counted(self.repeats, "repeat")]
        return ", ".join(parts) + (f"; {self.rejected} rejected" if self.rejected else "")


def _levels(point: Asked) -> tuple[float, float, float]:
    """Set-points to 0.1 rad/s (1 rpm) and 0.01 N m, below which two are the same."""
    given = point.setpoints
    load = given.torque_ring if point.configuration == Configuration.ENGAGED else 0.0
    return round(given.speed_sun or 0.0, 1), round(given.speed_ring or 0.0, 1), round(load or 0.0, 2)


def abilities(found: Survey, rehearsed: Analysis | None, bench: BenchParameters) -> tuple[Ability, ...]:
    """Abilities of one campaign.

    Parameters
    ----------
    found : Survey
        Its recordings.
    rehearsed : Analysis or None
        Its analysis on made-up readings; None where its recordings name no set-points.
    bench : BenchParameters
        The bench.
    """
    points = tuple(point for point in found.points if point.accepted)
    design = Design.of(points)
    fitted = _unnamed() if rehearsed is None else _fitted(rehearsed, design, bench)
    return (*fitted, *_from_samples(found, points, design, rehearsed is not None), _thermal(found, rehearsed, design))


FITTED = ("neutral losses", "calibration", "power losses and efficiency", "simulated against measured", "diagnosis")


def _unnamed() -> Iterator[Ability]:
    why = "the recordings name no set-points; plateaus are found in the samples by 'pmg ingest'"
    yield from (Ability(chapter, UNKNOWN, why, "Run 'pmg ingest', then 'pmg doctor STORE'.") for chapter in FITTED)


def _fitted(rehearsed: Analysis, design: Design, bench: BenchParameters) -> Iterator[Ability]:
    """Chapters that rest on fits: what the rehearsal came to, and the error it ended with."""
    neutral, calibration, losses, comparison, diagnosis = FITTED
    fault = rehearsed.missing[0] if rehearsed.missing else None
    if rehearsed.fits is None:
        assert fault is not None  # an analysis without fits says why
        unlock = f"neutral points: {fault.expected}"
        yield Ability(neutral, NO, f"{fault.where}: {fault.came}", unlock)
        for chapter in FITTED[1:]:
            yield Ability(chapter, NO, "it rests on the neutral losses")
        return
    yield Ability(neutral, YES, f"{design.neutral} points, {design.sun} sun and {design.ring} ring speeds")
    if rehearsed.calibration is None:
        why = "" if fault is None else f"{fault.where}: {fault.came}"
        unlock = "engaged points at several speeds and loads"
        yield Ability(calibration, NO, why, unlock)
        yield from (Ability(chapter, NO, "it rests on the calibration") for chapter in FITTED[2:])
        return
    known = rehearsed.calibration
    free = [name for name in CONSTANTS if name in known.names and known.standard_error(name) is not None]
    if isinstance(rehearsed.study, FitError):
        yield Ability(calibration, IN_PART, f"K_corr is held: {rehearsed.study.came}", rehearsed.study.do)
    else:
        yield Ability(calibration, YES, f"{', '.join(free)} can be fitted together")
    engaged = f"{design.engaged} engaged points"
    balance = (
        Ability(losses, YES, engaged) if rehearsed.balance is not None else Ability(losses, NO, "no engaged point")
    )
    yield balance
    yield Ability(comparison, YES, f"{design.neutral} neutral and {engaged}")
    blind = confounded_shafts(take_readings(rehearsed.grid, bench))
    if blind:
        why = f"the {' and the '.join(blind)} ran in the order of speed and nothing was repeated"
        yield Ability(
            diagnosis, IN_PART, f"{why}: drift looks like a loss curve", "some points again, in another order"
        )
    elif not design.repeats:
        why = "the noise is known from the scatter about the fits alone"
        yield Ability(diagnosis, IN_PART, why, "some points again, at least an hour apart")
    else:
        yield Ability(diagnosis, YES, f"{counted(design.repeats, 'repeat')} tell the noise")


def _from_samples(found: Survey, points: tuple[Asked, ...], design: Design, named: bool) -> Iterator[Ability]:
    """Chapters that rest on what was recorded in addition to torque and speed."""
    unnamed = "" if named else "the recordings name no set-points"
    turning = sum(
        max(abs(p.setpoints.speed_sun or 0.0), abs(p.setpoints.speed_ring or 0.0)) > REST_SPEED for p in points
    )
    if turning or not named:
        yield Ability(
            "orders", YES if named else UNKNOWN, unnamed or f"{counted(turning, 'point')} with a turning shaft"
        )
    else:
        yield Ability("orders", NO, "no shaft turns", "a point with a turning shaft")
    coils, usable = sum(file.coils for file in found.usable), len(found.usable)
    if coils:
        yield Ability("coil flux", YES if coils == usable else IN_PART, f"coils in {coils} of {usable} recordings")
    else:
        yield Ability("coil flux", NO, "no search coil was recorded", "the search coils, /daq/emf/...")
    yield _load_angle(found, points, design, named)
    yield zero_ability(design) if named else Ability("zero and its drift", UNKNOWN, unnamed)


def zero_ability(design: Design) -> Ability:
    """The zero of the transducers, from zero checks."""
    if design.zero >= 2:
        return Ability("zero and its drift", YES, counted(design.zero, "zero check"))
    state = IN_PART if design.zero else NO
    return Ability("zero and its drift", state, counted(design.zero, "zero check"), "zero checks before and after")


def _load_angle(found: Survey, points: tuple[Asked, ...], design: Design, named: bool) -> Ability:
    """The load angle: engaged points at several loads, in one counting of the encoders or with their index."""
    chapter = "load angle"
    if not named:
        return Ability(chapter, UNKNOWN, "the recordings name no set-points")
    if design.engaged < FEWEST_POINTS or design.loads < 2:
        why = f"{counted(design.engaged, 'engaged point')} at {counted(design.loads, 'load')}"
        return Ability(chapter, NO, why, f"{FEWEST_POINTS} engaged points or more at several loads in one sequence")
    indexed = found.recorded(INDEX)
    together = max(Counter(p.file for p in points if p.configuration == Configuration.ENGAGED).values())
    if indexed or together >= FEWEST_POINTS:
        source = f"index pulses in {indexed} recordings" if indexed else "points of one sequence"
        return Ability(chapter, YES, f"{design.loads} loads, {source}")
    why = "each point counts from a place of its own: no index pulses, no sequence of points"
    return Ability(chapter, NO, why, "index pulses of the encoders, or several loads in one sequence")


def _thermal(found: Survey, rehearsed: Analysis | None, design: Design) -> Ability:
    """Ability to see changes with time: repeats; temperatures are told, and are in no fit."""
    unread = "; temperatures were recorded, and are in no fit" if found.recorded(TEMPERATURE_TOPICS) else ""
    chapter = "warming and drift"
    if rehearsed is None:
        return Ability(chapter, UNKNOWN, "the recordings name no set-points" + unread)
    drift = rehearsed.drift
    if drift is not None and drift.repeats:
        hours = max(repeat.hours for repeat in drift.repeats)
        return Ability(chapter, YES, f"{counted(design.repeats, 'repeat')} over {hours:.1f} h{unread}")
    unlock = f"the same neutral points again, hours apart: {MINIMUM_DOF} repeats or more"
    if drift is not None and drift.orders:
        return Ability(chapter, IN_PART, f"points run with rising and with falling speed{unread}", unlock)
    why = "no engaged or neutral point was repeated" if drift is None or not drift.reason else drift.reason
    return Ability(chapter, NO, why + unread, unlock)

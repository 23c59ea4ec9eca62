"""The mismatch of runs in motion: whether anything follows what the constants do not explain, and where."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, Mismatch, search

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.compressed import Family
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class MotionPlace:
    """A structure that the missing torque follows.

    Parameters
    ----------
    family : Family
        Shaft, configuration and what it follows.
    p_value : float
        Of the whole search.
    size : float
        Root mean square of it over the rows that it may follow [N m].
    """

    family: Family
    p_value: float
    size: float


OF_COURSES = 0.1
"""Part of the rate of false alarms that the search over the courses of mechanisms may use. What a mechanism does is
far beyond the noise where it matters, and a form of the baseline that is not quite right looks most like one."""


def find_mismatch(found: MotionEvidence) -> Mismatch[MotionPlace]:
    """Test rows for anything that the constants do not explain, and say where it is seen.

    Looked for are the broad structures and, one by one, the course of each mechanism of the library: a curve spreads a
    test over several columns, a course takes one, so that a small effect is seen earlier. Both searches are paid for,
    and share the rate of false alarms. What only a course shows is placed where the structure is that carries most of
    it.
    """
    courses = _courses(found)
    (step,), course = search(found.evidence, steps=1), next(search(courses, steps=1)) if courses.families else None
    bases, left = step.scan.bases, found.evidence.y - step.scan.baseline @ (step.scan.baseline.T @ found.evidence.y)

    def shared(p_value: float, part: float) -> float:
        return min(1.0, p_value / part)

    def place(k: int, effect: Array, p_value: float) -> MotionPlace:
        return MotionPlace(found.families[k], p_value, found.torque_of(found.families[k], effect))

    of_courses = 1.0 if course is None else shared(course.p_value, OF_COURSES)
    p_value = min(shared(step.p_value, 1.0 - OF_COURSES), of_courses)
    corrected = [shared(step.corrected(k), 1.0 - OF_COURSES) for k in range(len(bases))]
    places = [place(k, basis @ (basis.T @ left), corrected[k]) for k, basis in enumerate(bases)]
    clear = sorted((p for p in places if p.p_value <= FALSE_ALARM_RATE), key=lambda p: (p.p_value, -p.size))
    if not clear and course is not None and of_courses <= FALSE_ALARM_RATE:
        followed = course.scan.bases[course.best]
        effect = followed @ (followed.T @ left)
        most = int(np.argmax([float(np.sum((basis.T @ effect) ** 2)) for basis in bases]))
        clear = [place(most, effect, of_courses)]
    tested = len(bases) + len(courses.families)
    return Mismatch(p_value, FALSE_ALARM_RATE, tuple(clear), tested, found.evidence.null.shape[1])


def _courses(found: MotionEvidence) -> Evidence:
    """The evidence with the course of each mechanism at each tabled shape; not in the readings of held shafts.

    Sizes that cannot be negative are looked for one by one, and no negative ones. Constants take up what a delay or
    lag does, and one off its data sheet is looked for there.
    """
    families: list[Array] = []
    positive: set[int] = set()
    searched = ~found.of_held
    for table in found.problem.tables.values():
        term = cast("MotionTerm", table.term)
        if term.constants or term.comes_late:
            continue
        one_sided = all(quantity.bounds[0] >= 0.0 for quantity in term.amplitudes)
        for columns in np.moveaxis(searched[:, None, None] * table.columns, 1, 0):
            courses = list(columns.T[:, :, None]) if one_sided else [columns]
            positive |= {len(families) + k for k in range(len(courses))} if one_sided else set()
            families += courses
    return replace(found.evidence, families=families, narrow=len(families), positive=frozenset(positive))

"""Places of a difference in motion: what each follows, the signal in which it is seen, its size, the largest."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.motion.evidence import OF_SHEET, OFF_SHEET
from pmg.pipeline.wording.units import MILLI
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.constants import SheetSum
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.mismatch import MotionPlace

OF_CONSTANTS = {
    "inertia": "inertia of the {side} rotor",
    "compliance": "compliance of the {side} coupling",
    "skew": "time between torque and angle of the {side} shaft",
    "zero": "zero of the {side} transducer",
    "pull_out": "pull-out torque",
    "drag": "loss curve of the {side} rotor",
    "falling": "loss curve of the {side} rotor, which falls with speed",
    "ripple": "ripple of a turn of the {side} shaft",
    "eccentricity": "eccentricity of the {side} encoder",
    "map": "torque against pole angle",
    "passage": "friction of the {side} rotor through standstill",
}
"""Constants by how their names begin, in words."""

PART_OF_SHEET = 0.25
"""Part of what a constant off its data sheet is worth from which on a torque beyond the constants is told before it."""


def follows(place: MotionPlace) -> str:
    """What the torque follows at a place, or which constant is far from its data sheet."""
    name = place.family.follows
    if place.family.configuration == OFF_SHEET:
        for start, words in OF_CONSTANTS.items():
            if name.startswith(start):
                return words.format(side=signal_of(place))
    return name.replace("_", " ")


def signal_of(place: MotionPlace) -> str:
    """Side of the torque in which a place is seen; of the gear's constants, the ring's, which is larger."""
    family = place.family
    if family.configuration != OFF_SHEET:
        return family.side
    return "sun" if "_sun" in family.follows else "ring"


def size_of(diagnosis: MotionDiagnosis, place: MotionPlace) -> float:
    """Size of a place [N m]; of a constant, the torque of its distance from the data sheet over the rows it moves.

    Of a loss curve that falls with speed it is the fall.
    """
    if place.family.configuration != OFF_SHEET:
        return place.size
    before = diagnosis.before
    if falls := falls_at(diagnosis, place):
        return max(each.fall for each in falls)
    at = of_sheet(diagnosis, place)
    off = (before.values - before.sheet.expected)[at]
    columns = np.concatenate([before.clean.columns(i)[:, at] for i in range(len(before.stretches))])
    moved = columns[columns.any(axis=1)] @ off
    return float(np.sqrt(moved @ moved / max(len(moved), 1)))


def falls_at(diagnosis: MotionDiagnosis, place: MotionPlace) -> list[SheetSum]:
    """Falls of a loss curve, where a place is one that falls with speed."""
    if place.family.configuration != OFF_SHEET:
        return []
    return [each for each in diagnosis.before.sheet.sums if each.name == place.family.follows]


def fall_words(falls: list[SheetSum]) -> str:
    """By how much a loss curve falls and between which speeds, as a part of a sentence."""
    most = max(falls, key=lambda each: each.fall)
    low, high = (f"{speed / RPM:.0f}" for speed in most.between)
    return f"the loss curve of the {most.side} rotor falls by {most.fall / MILLI:.2g} mN m from {low} to {high} rpm"


def of_sheet(diagnosis: MotionDiagnosis, place: MotionPlace) -> list[int]:
    """Places of the constants that are far from their data sheet."""
    return [diagnosis.before.sheet.at(name) for name in OF_SHEET[place.family.follows]]


def largest_of(diagnosis: MotionDiagnosis) -> MotionPlace:
    """The place where the difference is largest, of a rotor's torque where that is a good part of it.

    Of constants alone that are off their data sheet it is the clearest: two that are off against each other take up
    more than either shows.
    """
    sizes = {place: size_of(diagnosis, place) for place in diagnosis.mismatch.locations}
    least = PART_OF_SHEET * max(sizes.values())
    large = [place for place, size in sizes.items() if size >= least]
    of_rotors = [place for place in large if place.family.configuration != OFF_SHEET]
    return max(of_rotors, key=sizes.__getitem__) if of_rotors else large[0]


def where_to_look(diagnosis: MotionDiagnosis) -> str:
    """Part on which a likely cause acts; else constant, or shaft and runs, in which the difference is largest."""
    if diagnosis.in_part and diagnosis.naming is not None and not diagnosis.naming.rivals:
        parts = (cast("MotionTerm", fit.candidate).component for fit in diagnosis.naming.best.fits)
        return f"the {' and the '.join(dict.fromkeys(part.replace('_', ' ') for part in parts))}"
    if not diagnosis.mismatch.locations:
        return "the bench"
    place = largest_of(diagnosis)
    if falls_at(diagnosis, place):
        return f"the {signal_of(place)} bearings, whose drag falls with speed"
    if place.family.configuration == OFF_SHEET:
        return f"the {follows(place)}, which is not that of the data sheet"
    return f"the {place.family.side} shaft in {place.family.configuration} runs"

"""Places of a difference in motion: the signal in which each is seen, its size, which is the largest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.evidence import OF_SHEET, OFF_SHEET

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis, MotionPlace


def signal_of(place: MotionPlace) -> str:
    """Side of the torque in which a place is seen; of the gear's constants, the ring's, which is larger."""
    family = place.family
    if family.configuration != OFF_SHEET:
        return family.side
    return "sun" if "_sun" in family.follows else "ring"


def size_of(diagnosis: MotionDiagnosis, place: MotionPlace) -> float:
    """Size of a place; of a constant, the torque of its distance from the data sheet over the rows it moves [N m]."""
    if place.family.configuration != OFF_SHEET:
        return place.size
    before, at = diagnosis.before, of_sheet(diagnosis, place)
    off = (before.values - before.sheet.expected)[at]
    columns = np.concatenate([before.clean.columns(i)[:, at] for i in range(len(before.stretches))])
    moved = columns[columns.any(axis=1)] @ off
    return float(np.sqrt(moved @ moved / max(len(moved), 1)))


def of_sheet(diagnosis: MotionDiagnosis, place: MotionPlace) -> list[int]:
    """Places of the constants that are far from their data sheet."""
    return [diagnosis.before.sheet.at(name) for name in OF_SHEET[place.family.follows]]


def largest_of(diagnosis: MotionDiagnosis) -> MotionPlace:
    """The place where the difference is largest, of a rotor's torque where there is one."""
    places = diagnosis.mismatch.locations
    of_rotors = [place for place in places if place.family.configuration != OFF_SHEET]
    return max(of_rotors or places, key=lambda place: size_of(diagnosis, place))


def where_to_look(diagnosis: MotionDiagnosis) -> str:
    """Shaft and runs in which the difference is largest."""
    family = largest_of(diagnosis).family if diagnosis.mismatch.locations else None
    if family is None or family.configuration == OFF_SHEET:
        return "the data sheet"
    return f"the {family.side} shaft in {family.configuration} runs"

"""Numbers that a machine file states, beside what its records say."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.library.drive_faults import GAIN
from pmg.pipeline.diagnosis.balance.library.two_torques import GAINS
from pmg.pipeline.diagnosis.balance.records.reading import COASTS
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.recording.remark import Remark

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.machine.machine import Machine
    from pmg.pipeline.machine.quantity import Stated

APART = 3.0
"""Standard uncertainties from which on a stated number and the one that is found are told to differ."""


@dataclass(frozen=True)
class FoundAndStated:
    """A number of a machine.

    Parameters
    ----------
    name : str
        In words.
    stated : Stated
        As the file has it.
    found, standard_error : float
        As the records have it, with the named terms in the model [SI].
    """

    name: str
    stated: Stated
    found: float
    standard_error: float

    @property
    def apart(self) -> float:
        """Difference in standard uncertainties of both; NaN where the file states none."""
        if self.stated.u is None:
            return math.nan
        u = math.hypot(self.stated.u, self.standard_error)
        return abs(self.found - self.stated.value) / u if u > 0.0 else math.nan

    @property
    def differs(self) -> bool:
        """Whether the two cannot both be right."""
        return self.apart > APART

    @property
    def sentence(self) -> str:
        """Both, and how far they are apart, in words."""
        stated = f"{self.stated.value:.3g} ± {self.stated.u or 0.0:.2g} {self.stated.unit} as the machine file states"
        found = f"{self.found:.3g} ± {self.standard_error:.2g} by the records"
        return f"the {self.name} is {stated}, and {found}: {self.apart:.0f} standard uncertainties apart"


COMPARED = {
    "inertia": ("inertia", "inertia"),
    "coulomb": ("Coulomb friction", "friction.coulomb"),
    "viscous": ("viscous friction", "friction.viscous"),
}
"""Numbers that records tell as well: by the term, what they are called and their key."""


def not_compared(machine: Machine) -> tuple[Remark, ...]:
    """Numbers that are stated of one shaft alone: what the records tell is that of both together."""
    found = []
    for words, key in COMPARED.values():
        having, lacking = ([e.name for e in machine.ends if (e.total(key) is None) == none] for none in (False, True))
        if having and lacking:
            message = f"stated of {having[0]} alone, and so not compared: records tell the {words} of both shafts"
            found.append(Remark("info", f"shaft.{having[0]}.{key}", f"{message}. State it of {lacking[0]} too"))
    return tuple(found)


def found_and_stated(diagnosis: TermsDiagnosis, machine: Machine) -> tuple[FoundAndStated, ...]:
    """Inertia and friction as stated and as found, as far as both exist.

    Parameters
    ----------
    diagnosis : TermsDiagnosis
        Of its records.
    machine : Machine
        What its file states.
    """
    last = {e.term: e for e in diagnosis.steps[-1].fitted.estimates}
    shaft = machine.shafts[diagnosis.case.shaft]
    known = {term: (words, machine.seen_by(shaft, key)) for term, (words, key) in COMPARED.items()}
    return tuple(
        FoundAndStated(name, value, last[term].value, last[term].standard_error)
        for term, (name, value) in known.items()
        if value is not None and term in last
    )


def contradictions(compared: tuple[FoundAndStated, ...], diagnosis: TermsDiagnosis) -> tuple[Remark, ...]:
    """Warnings of stated numbers that the records contradict, with what to do.

    None where the gain of a transducer is named, which makes every number of these as wrong as itself.
    """
    if {fit.identifier for fit in diagnosis.steps[-1].fitted.fits} & {*GAINS, GAIN}:
        return ()
    return tuple(
        Remark("warning", "machine file", f"{row.sentence}. {_what_to_do(row, diagnosis)}")
        for row in compared
        if row.differs
    )


def _what_to_do(row: FoundAndStated, diagnosis: TermsDiagnosis) -> str:
    recorded, axis = diagnosis.recorded, diagnosis.case.axis
    acts = float(np.sqrt(np.mean((recorded.force + recorded.known) ** 2)))
    needed = row.stated.value * float(np.sqrt(np.mean(recorded.motion.acceleration**2)))
    if row.name == COMPARED["inertia"][0] and acts < COASTS * needed:
        shown = f"The {axis.pushes} is {acts:.2g} {axis.push} rms, where such an inertia takes {needed:.2g}"
        return f"{shown}: if the machine coasted, take the {axis.pushes} out of its channels; else check its unit"
    if diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        return "A term is missing, so that what the records say of it may be off: find that first"
    return "Check the machine file, and unit, sign and gain of the channels"

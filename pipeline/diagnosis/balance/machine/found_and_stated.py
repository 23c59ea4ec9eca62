"""Numbers that a machine file states, beside what its records say."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
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
    known = {
        "inertia": ("inertia", _inertia(machine, diagnosis.case)),
        "coulomb": ("Coulomb friction", _of_ends(machine, "friction.coulomb", diagnosis.case)),
        "viscous": ("viscous friction", _of_ends(machine, "friction.viscous", diagnosis.case)),
    }
    return tuple(
        FoundAndStated(name, value, last[term].value, last[term].standard_error)
        for term, (name, value) in known.items()
        if value is not None and term in last
    )


def _inertia(machine: Machine, case: Case) -> Stated | None:
    """Inertia of all that moves, as the first shaft sees it; None unless that of every shaft is stated."""
    ends = machine.ends if case.ratio is not None else machine.ends[:1]
    parts = [end.total_inertia for end in ends]
    if any(part is None for part in parts):
        return None
    return _seen(tuple(part for part in parts if part is not None), case, squared=True)


def _of_ends(machine: Machine, key: str, case: Case) -> Stated | None:
    """A friction of all shafts, as the first one sees it."""
    ends = machine.ends if case.ratio is not None else machine.ends[:1]
    if any(key not in end.numbers for end in ends):
        return None
    return _seen(tuple(end.numbers[key] for end in ends), case, squared=key == "friction.viscous")


def _seen(parts: tuple[Stated, ...], case: Case, *, squared: bool) -> Stated:
    """The sum of what two shafts have, that of the second through the gear."""
    ratio = 1.0 if case.ratio is None else abs(case.ratio)
    factors = [1.0, 1.0 / ratio**2 if squared else 1.0 / ratio]
    pairs = list(zip(parts, factors, strict=False))
    spread = [part.u * factor for part, factor in pairs if part.u is not None]
    first = parts[0]
    return type(first)(
        sum(part.value * factor for part, factor in pairs),
        first.unit,
        math.hypot(*spread) if len(spread) == len(parts) else None,
        "; ".join(dict.fromkeys(part.source for part in parts if part.source)),
    )

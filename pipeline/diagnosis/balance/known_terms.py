"""Terms with their numbers: as somebody published them, or as a machine file knows them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.library.term import OF_LAGS, RECORDING
from pmg.pipeline.files.strict_tables import number_within, refuse, refusing, word_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.machine.tables import TermParameter
    from pmg.sim.signals import Array


GONE = 0.1
"""Part of a known amplitude by which a change may exceed it: both are known to some percent, and one that is gone
altogether would else stand on a bound."""


@dataclass(frozen=True)
class SetTerm:
    """A term with its numbers.

    Parameters
    ----------
    term : Term
        The term.
    amplitudes : (a,) array
        Its amplitudes.
    shape : float
        Its shape; NaN without one.
    error : float
        Standard error of its one amplitude; 0 where none was given.
    """

    term: Term[Motion]
    amplitudes: Array
    shape: float = float("nan")
    error: float = 0.0

    def of(self, motion: Motion) -> Array:
        """What it adds to the force (n,); a lag acts over all of its time."""
        if (lag := OF_LAGS.get(self.term.identifier)) is not None:
            motion = replace(motion, references={**motion.references, lag: float(self.amplitudes[0])})
        return np.asarray(self.term.columns(motion, self.shape) @ self.amplitudes)


class _AskedReferences(dict[str, float]):
    """References of columns that note which are asked for."""

    def __init__(self, given: Mapping[str, float]) -> None:
        super().__init__(given)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> float:
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:  # noqa: ANN401 - as a dict has it
        self.names.add(name)
        return super().get(name, default)


def beside_known(term: Term[Motion], known: Sequence[float]) -> Term[Motion]:
    """A term whose amplitudes are changes of known ones; a change may be all of it, and `GONE` more."""
    pairs = zip(term.amplitudes, known, strict=True)
    left = (replace(q, bounds=(q.bounds[0] - size - GONE * abs(size), q.bounds[1] - size)) for q, size in pairs)
    return replace(term, amplitudes=tuple(left))


def of_its_recordings(term: Term[Motion], motion: Motion, shape: float) -> bool:
    """Whether the size of a term goes with the recordings that it was fitted to.

    Their length, the middle of their travel, their first temperature, the angle at which each begins: what was found
    there is another size elsewhere. Of what distorts the rest of the model, only a lag is the same with it known.
    """
    asked = _AskedReferences(motion.references)
    term.columns(replace(motion, references=asked), shape)
    of_angle = term.of_angle and RECORDING in motion.besides
    return of_angle or bool(asked.names - set(OF_LAGS.values())) or (term.of_model and term.identifier not in OF_LAGS)


def missing_parameters(library: Sequence[Term[Motion]], rows: Sequence[TermParameter]) -> list[str]:
    """Parameters that rows lack of the terms that they tell of."""
    given = {(row.term, row.parameter) for row in rows}
    named = {row.term for row in rows}
    terms = (term for term in library if term.key in named)
    return [f"{term.key} {q.name}" for term in terms for q in term.parameters if (term.key, q.name) not in given]


def set_terms(library: Sequence[Term[Motion]], rows: Sequence[TermParameter]) -> tuple[SetTerm, ...]:
    """Terms of which rows give all parameters."""
    values = {(row.term, row.parameter): row.value for row in rows}
    named = {row.term for row in rows}
    return tuple(
        SetTerm(
            term,
            np.array([values[term.key, q.name] for q in term.amplitudes]),
            float("nan") if term.shape is None else values[term.key, term.shape.name],
        )
        for term in library
        if term.key in named
    )


def check_parameters(library: Sequence[Term[Motion]], rows: Sequence[TermParameter], *table: str) -> None:
    """Refuse a parameter that no term of a library has; `table` leads to the rows.

    Raises
    ------
    RefusalError
        There is one.
    """
    terms = {term.key: term for term in library}
    for i, row in enumerate(rows):
        term = terms[word_of(row.term, terms, *table, i, "term")]
        quantities = {quantity.name: quantity for quantity in term.parameters}
        word_of(row.parameter, quantities, *table, i, "parameter")
        word_of(row.unit, [quantities[row.parameter].unit], *table, i, "unit")


def check_known(
    library: Sequence[Term[Motion]], baseline: Sequence[str], rows: Sequence[TermParameter], *table: str
) -> None:
    """Refuse known terms that are not whole, given twice, out of their range, or in the baseline besides.

    Raises
    ------
    RefusalError
        There is one.
    """
    check_parameters(library, rows, *table)
    quantities = {(term.key, q.name): q for term in library for q in term.parameters}
    count = Counter((row.term, row.parameter) for row in rows)
    for i, row in enumerate(rows):
        if count[row.term, row.parameter] > 1:
            came = f"{row.parameter} of {row.term} given {count[row.term, row.parameter]} times"
            refuse(came, "each parameter once", "Keep one of them.", *table, i, "parameter")
        if row.term in baseline:
            do = "Leave it out of one of them; [model.fixed] holds what is known of the baseline."
            refuse(f"{row.term}, which is in the baseline", "a further term", do, *table, i, "term")
        low, high = quantities[row.term, row.parameter].bounds
        if np.isfinite([low, high]).all():
            with refusing(*table, i, "value"):
                number_within(row.value, low, high, row.unit)
    if missing := missing_parameters(library, rows):
        came = f"{', '.join(missing)} not given"
        refuse(came, "every parameter of a term", "Add a row for each.", *table)

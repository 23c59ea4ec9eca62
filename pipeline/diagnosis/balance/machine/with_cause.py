"""A machine file with what was named in it as known terms, to go on with."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.diagnosis.balance.known_terms import of_its_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.machine_text import for_other_records

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term


def with_cause(text: str, diagnosis: TermsDiagnosis) -> str:
    """A machine file with what was named as known terms, to go on with; empty where there is nothing to write.

    It is for other recordings: names of those that were withheld, or at rest, are comments in it, and the zero that
    those at rest showed of the balance is a known term. Not written is a term whose size
    is that of its recordings alone, one that the file knows already, one of a size that no file may give, and what does
    not fit into the form of the file.

    Parameters
    ----------
    text : str
        The file that the diagnosis was made with.
    diagnosis : TermsDiagnosis
        What was found.
    """
    fits = [step.fitted.fits[-1] for step in diagnosis.steps[1:]]
    if diagnosis.verdict is not Verdict.NAMED or not fits:
        return ""
    known = {each.term.key for each in diagnosis.case.stated}
    motion = diagnosis.recorded.motion
    if any(fit.candidate.key in known or of_its_recordings(fit.candidate, motion, fit.shape) for fit in fits):
        return ""
    found = {(e.term, e.name): e for e in diagnosis.steps[-1].fitted.estimates}
    parameters = [(fit.candidate, q, found[fit.identifier, q.name]) for fit in fits for q in fit.candidate.parameters]
    if not all(q.bounds[0] <= estimate.value <= q.bounds[1] for _, q, estimate in parameters):
        return ""
    rows = "\n".join(row for term, _, e in parameters for row in _rows(term, e.name, e.value, e.standard_error, e.unit))
    zero = "".join(f"{row}\n" for row in _zero_rows(diagnosis.case))
    whole = f"{for_other_records(text).rstrip()}\n\n{zero}# Named, and known from here on.\n{rows}\n"
    try:
        tomllib.loads(whole)
    except tomllib.TOMLDecodeError:  # the file has its model in braces, to which nothing can be added
        return ""
    return whole


def _zero_rows(case: Case) -> Iterator[str]:
    """The zero of the balance that recordings at rest showed, as a known term."""
    zero = next((each for each in case.known if each.error > 0.0), None)
    if zero is None:
        return
    value = case.tares["force"] + case.tares.get(f"{OUTPUT}force", 0.0) / (case.ratio or 1.0)
    (size,) = zero.term.amplitudes
    yield "# The zero at rest."
    yield from _rows(zero.term, size.name, value, zero.error, size.unit)


def _rows(term: Term[Motion], name: str, value: float, error: float, unit: str) -> Iterator[str]:
    yield "[[model.known]]"
    yield f'term = "{term.key}"'
    yield f'parameter = "{name}"'
    yield f"value = {value:.9g}  # standard error {error:.2g}"
    yield f'unit = "{unit}"'
    yield ""

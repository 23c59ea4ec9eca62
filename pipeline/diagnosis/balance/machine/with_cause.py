"""A machine file with what was named in it as known terms, to go on with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term


def with_cause(text: str, diagnosis: TermsDiagnosis) -> str:
    """A machine file with what was named as known terms, to go on with; empty where there is nothing to write.

    Not written is a term with a size of its own in each recording, or one that the file knows already: its size is
    then another one.

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
    library = {term.key: term for term in diagnosis.case.library}
    for fit in fits:
        same = library[fit.candidate.key].parameters == fit.candidate.parameters
        if not same or fit.candidate.key in {known.term.key for known in diagnosis.case.known}:
            return ""
    found = {(e.term, e.name): e for e in diagnosis.steps[-1].fitted.estimates}
    parameters = ((fit.candidate, found[fit.identifier, q.name]) for fit in fits for q in fit.candidate.parameters)
    rows = "\n".join(row for term, estimate in parameters for row in _row(term, estimate))
    return f"{text.rstrip()}\n\n# Named, and known from here on.\n{rows}\n"


def _row(term: Term[Motion], estimate: Estimate) -> Iterator[str]:
    yield "[[model.known]]"
    yield f'term = "{term.key}"'
    yield f'parameter = "{estimate.name}"'
    yield f"value = {estimate.value:.9g}  # standard error {estimate.standard_error:.2g}"
    yield f'unit = "{estimate.unit}"'
    yield ""

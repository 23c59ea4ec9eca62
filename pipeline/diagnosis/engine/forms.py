"""The answer of a search once laws may bend, and once look-alikes are known for what they are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.adequacy import ORDINARY
from pmg.pipeline.diagnosis.engine.catalogue import FORM_ERROR, MARGIN
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.free_form import BENT, free_form
from pmg.pipeline.diagnosis.engine.naming import FIRST_OF_PAIRS
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.found_set import Naming


def with_free_laws(
    naming: Naming[F, P], problem: P, catalogue: CandidateCatalogue[F, P], remainder_of: AdequacyTest
) -> Naming[F, P]:
    """What the catalogue says once laws may bend.

    A leader that leaves structure is named with its law free, where that explains. Laws are free for the others, too:
    a single candidate that explains as well then, or better, is a rival.
    """
    best = naming.best
    if not best.fits or (naming.remainder.p_value >= ORDINARY and naming.explained):
        return naming
    form = free_form(best, catalogue, remainder_of)
    if form is not None and form.explains and not naming.explained:
        naming = replace(naming, best=form.explanation, remainder=form.remainder, explained=True)
    if not naming.explained or len(best.fits) > 1:
        return naming
    reached = best.score + (max(form.evidence, 0.0) if form is not None else 0.0)
    known = {best.ids, *(rival.ids for rival in naming.rivals)}
    found = list(naming.rivals)
    for fit in naming.ranking[: FIRST_OF_PAIRS + 3]:
        other = Explanation((fit,), problem.take_out(fit))
        if other.ids in known or (bent := free_form(other, catalogue, remainder_of)) is None:
            continue
        known.add(other.ids)
        if bent.explains and other.score + bent.evidence > reached - MARGIN:
            found.append(bent.explanation)
    return replace(naming, rivals=tuple(found))


def with_look_alikes(naming: Naming[F, P], problem: P) -> Naming[F, P]:
    """What the catalogue says where a pair is of look-alikes: then either alone, in another form, is a rival.

    Two candidates that explain about as much, each by itself, show the same; what both together explain beyond that is
    no more than a change of the form of either.
    """
    best = naming.best
    if not naming.may_be_named or len(best.fits) != 2:
        return naming
    found: dict[str, Explanation[F, P]] = {}
    for fit in naming.ranking:
        if fit.identifier in best.ids and fit.identifier not in found:
            found[fit.identifier] = Explanation((fit,), problem.take_out(fit))
    first, *others = found.values()
    alike = (
        others
        and first.score - others[0].score < MARGIN + FORM_ERROR * first.score
        and best.score - first.score < BENT * first.score
    )
    return replace(naming, rivals=(first, *others, *naming.rivals)) if alike else naming

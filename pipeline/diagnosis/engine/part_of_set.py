"""A part of the leading set by itself: what it explains, and which sets come near it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.explanation import explain_with, rivals_near, swapped
from pmg.pipeline.diagnosis.engine.free_form import explains
from pmg.pipeline.diagnosis.engine.naming import margin_beside
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.naming import Naming


def name_part(
    problem: P,
    catalogue: CandidateCatalogue[F, P],
    naming: Naming[F, P],
    ids: Collection[str],
    remainder_of: AdequacyTest,
) -> Naming[F, P]:
    """Some candidates of the leading set, fitted without the others, against those that may take their place.

    Parameters
    ----------
    problem : WhitenedProblem
        Rows with the baseline free.
    catalogue : Catalogue
        What may be named.
    naming : Naming
        The result of the search.
    ids : collection of str
        Ids of the leading set.
    remainder_of : callable
        Judges what a problem leaves.
    """
    kept = [fit.candidate for fit in naming.best.fits if fit.identifier in ids]
    best = explain_with(problem, catalogue, kept)
    remainder = remainder_of(best.problem)
    of_form = catalogue.form_margin * max(best.score, 0.0)
    pool = swapped(problem, catalogue, best)
    rivals, shafts, missed = rivals_near(best, pool, margin_beside(remainder), of_form)
    return replace(
        naming,
        best=best,
        rivals=rivals,
        shafts=shafts,
        remainder=remainder,
        explained=explains(best, remainder, catalogue.form_error),
        in_the_main=best.needed and remainder.excess < catalogue.left_in_the_main(len(kept)) * best.gain,
        weak=(),
        by_parts=0,
        further=(),
        missed=missed,
        evidence_scale=MARGIN / (MARGIN + of_form),
    )

"""What the library says of a mismatch in motion, the rows made straight about what leads until the same leads."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.explanation import explain_with
from pmg.pipeline.diagnosis.engine.forms import with_free_laws, with_look_alikes
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.diagnosis.motion.candidates.beside import amounts_of, terms_of
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.like_filter import unless_like_filter
from pmg.pipeline.diagnosis.motion.candidates.mass_on_spring import on_spring
from pmg.pipeline.diagnosis.motion.catalogue import (
    MotionCatalogue,
    other_lateness,
    with_late_look_alikes,
    with_small_rest,
    without_held,
    without_opposed,
)
from pmg.pipeline.diagnosis.motion.evidence import motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_beside, noise_beside

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming, TermSet
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.pipeline.files.progress import Steps

SEARCH_STEPS = "causes", "constants beside the first cause"
"""Steps of the search, as its progress names them."""

STRAIGHTENED = 4
"""Times at most that the rows are made straight about what leads, and the library is searched anew."""

FOLLOWED, NEAR_ONE, AT_MOST = 3, 0.02, 2.0
"""Times at most that the time of a delay or lag follows its amplitude, how near to 1 that is near enough, and by what
factor it moves at most."""

MOVED = 1.2
"""Factor on a delay or a lag from which on rows that are straight about the one are not about the other."""


def name_causes(
    found: MotionEvidence, before: MotionBaseline, noise: list[RowNoise], rng: np.random.Generator, steps: Steps
) -> tuple[MotionEvidence, MotionEvidence, TermNaming]:
    """What the library says of a mismatch, with the evidence about the constants beside what it names.

    That is given whole, and without the candidates that cannot be meant.

    Parameters
    ----------
    found : MotionEvidence
        About the constants alone.
    before : MotionBaseline
        Those constants.
    noise : list of RowNoise
        Of each stretch.
    rng : numpy.random.Generator
        Draws synthetic campaigns.
    steps : Steps
        Is told each step.

    Notes
    -----
    The constants alone take up a part of a large cause, and rows that are straight about those constants show the rest
    as something else: a long delay as a lag, because a skew took up the first of it. The rows are therefore made
    anew beside the leading causes, until the same causes lead. If that does not settle, or new leaders do not explain
    the difference that earlier ones explained, those with the smallest residual are given; of those that explain it,
    if any do, the fewest together. A leader stays if only its time moves.
    Before, a lag and a delay together come nearer to a long one than either; but not one that undoes the other.
    """
    steps.begin(SEARCH_STEPS[0])
    meant, about = without_opposed(found), before
    naming, settled = _searched(meant, MotionCatalogue(one_late=False)), False
    late = (term for term in (cast("MotionTerm", fit.candidate) for fit in naming.best.fits) if term.comes_late)
    if len({term.sense for term in late}) > 1:
        naming = _searched(meant, MotionCatalogue())
    led: list[tuple[float, tuple[MotionEvidence, MotionEvidence, TermNaming]]] = []
    while naming.best.fits and not settled and len(led) < STRAIGHTENED:
        if not led:
            steps.begin(SEARCH_STEPS[1])
        best = naming.best
        about = _beside_whole(replace(before, values=about.values), noise, best.fits)
        noise = noise_beside(about, noise)
        search = found, meant, naming
        found = motion_evidence(about, noise, library(), rng)
        meant = without_opposed(found)
        naming = _searched(meant, MotionCatalogue())
        led.append((_left_by(best.fits, found), search))
        settled = not _elsewhere(best.fits, naming.best.fits)
        if led[:-1] and search[-1].explained and not naming.explained:
            break
    if naming.best.fits and not (settled or (naming.explained and _same(best.fits, naming.best.fits))):
        explaining = [each for each in led if each[1][2].explained]
        fewest = min((len(each[1][2].best.fits) for each in explaining), default=0)
        if explaining or not naming.explained:
            least = [each for each in explaining if len(each[1][2].best.fits) == fewest] or led
            _, (found, meant, naming) = min(least, key=lambda each: each[0])
    found, meant, naming = _against_other_lateness((found, meant, naming), before, noise, rng)
    naming = with_free_laws(naming, meant.problem, MotionCatalogue(), adequacy_test(meant.evidence))
    naming = with_late_look_alikes(without_held(with_look_alikes(naming, meant.problem)), meant.problem)
    return found, meant, on_spring(unless_like_filter(with_small_rest(naming, found), found), found)


def _against_other_lateness(
    search: tuple[MotionEvidence, MotionEvidence, TermNaming],
    before: MotionBaseline,
    noise: list[RowNoise],
    rng: np.random.Generator,
) -> tuple[MotionEvidence, MotionEvidence, TermNaming]:
    """The search, or one on rows about another way to be late in place of the leading one, which leaves plainly less.

    That is a lag for a delay, a delay for a lag, or a lag of another order. Rows that are straight about a delay show a
    lag of the same time as less than it is: the constants beside the delay took up what it did not explain. Each is
    therefore held against the other on rows of its own. The other one is a rival of the answer if it leads on its own
    rows and leaves about as much, or if it is a rival there.
    """
    found, meant, naming = search
    best, left = naming.best, math.nan
    near: list[TermSet] = []
    for fits in other_lateness(best, meant):
        if math.isnan(left):
            left = least = _left_by(best.fits, found)
        about = _beside_whole(replace(before, values=found.baseline.values), noise, fits)
        other = motion_evidence(about, noise_beside(about, noise), library(), rng)
        unopposed = without_opposed(other)
        told = _searched(unopposed, MotionCatalogue())
        leads = told.explained and _same_laws(fits, told.best.fits)
        less = _left_by(told.best.fits, other) if leads else math.inf
        if less < min(least, left - MARGIN):
            search, least = (other, unopposed, told), less
        elif not _same(best.fits, fits) and (
            less < left + MARGIN
            or (_same_laws(best.fits, told.best.fits) and any(_same_laws(fits, rival.fits) for rival in told.rivals))
        ):
            near.append(explain_with(meant.problem, MotionCatalogue(), [fit.candidate for fit in fits]))
    return search if search[-1] is not naming else (found, meant, _with_rivals(naming, near))


def _with_rivals(naming: TermNaming, near: list[TermSet]) -> TermNaming:
    """An answer with further rivals, the evidence scaled so that they fall short by no more than `MARGIN`."""
    rivals = {rival.ids: rival for rival in (*naming.rivals, *near)}
    apart = max((naming.best.score - rival.score for rival in near), default=0.0)
    scale = min(naming.evidence_scale, MARGIN / max(apart, MARGIN))
    by_evidence = sorted(rivals.values(), key=lambda rival: -rival.score)
    return replace(naming, rivals=tuple(by_evidence), evidence_scale=scale)


def _beside_whole(start: MotionBaseline, noise: list[RowNoise], fits: tuple[TermFit, ...]) -> MotionBaseline:
    """The constants beside mechanisms; the time of a delay or lag follows its amplitude, which is 1 where it fits."""
    for _ in range(1 + FOLLOWED):
        about, _ = fit_beside(start, noise, fits)
        moved = tuple(_followed(fit, float(a[0])) for fit, a in zip(fits, amounts_of(about, fits), strict=True))
        if all(one.shape == other.shape or math.isnan(one.shape) for one, other in zip(fits, moved, strict=True)):
            break
        fits, start = moved, replace(start, values=about.values)
    return about


def _followed(fit: TermFit, amount: float) -> TermFit:
    """A delay or lag with the time that its amplitude asks for, where that is another one."""
    if not fit.candidate.whole or not cast("MotionTerm", fit.candidate).comes_late or abs(amount - 1.0) < NEAR_ONE:
        return fit
    low, high = fit.candidate.parameters[-1].bounds
    moved = np.clip(amount, 1.0 / AT_MOST, AT_MOST) * fit.shape
    return replace(fit, shape=float(np.clip(moved, low, high)))


def _left_by(fits: tuple[TermFit, ...], about: MotionEvidence) -> float:
    """Sum of squares that mechanisms leave of rows about them [noise variances], with the cost of their parameters."""
    fitted = explain_with(about.problem, MotionCatalogue(), [fit.candidate for fit in fits])
    left = fitted.problem.left * np.where(about.of_sheet, 1.0, about.scatter)  # rows are in units of their own scatter
    return float(left @ left) + fitted.gain - fitted.score


def _elsewhere(before: tuple[TermFit, ...], after: tuple[TermFit, ...]) -> bool:
    """Whether others lead than before, or on another shaft, or a delay or lag with a time far from before.

    The expansion of a short lag is beside a skew that takes up a part of it, so that a lag of any size is another.
    """
    if not _same(before, after):
        return True
    known, now = _exact(before), _exact(after)
    moved = (max(known[key], now[key]) > MOVED * min(known[key], now[key]) for key in known.keys() & now.keys())
    return bool(now.keys() - known.keys()) or any(moved)


def _exact(fits: tuple[TermFit, ...]) -> dict[tuple[str, str], float]:
    """Times of the delays and lags whose law is no expansion, by mechanism and place."""
    exact = (fit for fit in fits if fit.candidate.whole and not cast("MotionTerm", fit.candidate).between)
    return {(fit.identifier, fit.place): fit.shape for fit in exact}


def _same(one: tuple[TermFit, ...], other: tuple[TermFit, ...]) -> bool:
    """Whether the same mechanisms lead in the same places."""
    return {(fit.identifier, fit.place) for fit in one} == {(fit.identifier, fit.place) for fit in other}


def _same_laws(one: tuple[TermFit, ...], other: tuple[TermFit, ...]) -> bool:
    """The same, and with lags of the same order."""
    lags = [{term.key for term in terms_of(fits) if term.is_lag} for fits in (one, other)]
    return _same(one, other) and lags[0] == lags[1]


def _searched(meant: MotionEvidence, catalogue: MotionCatalogue) -> TermNaming:
    """What the library says of the evidence without what cannot be meant."""
    return name_candidates(meant.problem, catalogue, adequacy_test(meant.evidence))

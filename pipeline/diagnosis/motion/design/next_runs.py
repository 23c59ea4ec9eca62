"""The run that a campaign in motion lacks, and that would tell causes apart which fit equally well."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

from pmg.pipeline.diagnosis.engine.explanation import explain_with
from pmg.pipeline.diagnosis.engine.separation import ENOUGH, power_to_separate
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue
from pmg.pipeline.diagnosis.motion.design.foresight import Foresight
from pmg.pipeline.diagnosis.motion.design.proposals import proposals
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.sim.shafts import SIDES, other_side

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.design.proposals import Proposal
    from pmg.pipeline.diagnosis.motion.design.proposed_run import ProposedRun
    from pmg.pipeline.diagnosis.motion.design.unseen import Unseen
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.noise.row_noise import SlowNoise

LEAST_POWER = 0.2
"""Power from which on runs are worth their time."""

REPEATS = 4
"""How often a run is made where once is not enough: it halves what noise hides."""


@dataclass(frozen=True)
class NextRun:
    """Runs that would tell mechanisms apart.

    Parameters
    ----------
    title, description : str
        What they are; the same with the references of the drives.
    minutes : float
        How long they take [min].
    separates : tuple of str
        Mechanisms that they tell apart, by id.
    runs : tuple of ProposedRun
        One after the other.
    power : float
        Probability that they do, at most: that the true one of two causes is then named alone, whichever it is; of a
        mechanism that the campaign cannot see, that it shows at the size that is worth knowing.
    rivals : tuple of tuple of TermFit
        Sets that they tell from the leading one, an empty one where that is to be confirmed; none of a mechanism that
        the campaign cannot see.
    """

    title: str
    description: str
    minutes: float
    separates: tuple[str, ...]
    runs: tuple[ProposedRun, ...]
    power: float
    rivals: tuple[tuple[TermFit, ...], ...] = ()

    @property
    def words(self) -> str:
        """What to do, how long it takes, with what power."""
        does = "tell" if self.rivals else "show what these runs cannot"
        return f"{uncapitalised(self.title)} ({self.minutes:.0f} min; it would {does} in {self.power:.0%} of cases)"


def runs_to_see(found: MotionEvidence, blind: tuple[Unseen, ...], slow_noise: SlowNoise) -> tuple[NextRun, ...]:
    """The run for each mechanism that a campaign cannot see."""
    lacking = [
        _best(found, slow_noise, (spot.term.shaft,), (spot.term.identifier,), lambda f, s=spot: f.power_to_show(s))  # type: ignore[misc]
        for spot in blind
    ]
    return tuple(lacking)


def runs_to_tell(found: MotionEvidence, naming: TermNaming, slow_noise: SlowNoise) -> tuple[NextRun, ...]:
    """The run for each rival that would tell it from the leading cause, in order; then for a shaft left open."""
    best = naming.best.fits
    others = [rival.fits for rival in naming.rivals]
    twins = [_elsewhere(found, best, name) for name, shaft in naming.shafts.items() if shaft == "either"]
    others += [fits for fits in twins if fits]

    def one(other: tuple[TermFit, ...]) -> NextRun:
        ids = {fit.identifier for fit in best} ^ {fit.identifier for fit in other}
        places = {fit.identifier: fit.place for fit in other}
        ids = ids or {fit.identifier for fit in best if fit.place != places[fit.identifier]}
        shafts = {fit.place for fit in (*best, *other)}
        sides = tuple(side for side in SIDES if shafts & {side, "both"})
        other = (*best, *other) if {f.candidate for f in other} < {f.candidate for f in best} else other
        run = _best(found, slow_noise, sides or SIDES, tuple(sorted(ids)), lambda f: f.power_between(best, other))
        return replace(run, rivals=(other,))

    return tuple(map(one, others))


def run_to_confirm(found: MotionEvidence, fits: tuple[TermFit, ...], slow_noise: SlowNoise) -> NextRun | None:
    """The run in which a named cause alone shows most for the time it takes.

    None where no run would show it, or where a part of it is a constant of the bench that is off, and no torque.
    """
    if any(cast("MotionTerm", fit.candidate).constants for fit in fits):
        return None
    shown = {each: Foresight(found, each, slow_noise).evidence_for(fits) for each in proposals(found.baseline, SIDES)}
    strong = (each for each in shown if power_to_separate(shown[each]) >= ENOUGH)
    if (best := max(strong, key=lambda each: shown[each] / each.minutes, default=None)) is None:
        return None
    ids, power = tuple(sorted({fit.identifier for fit in fits})), power_to_separate(shown[best])
    return NextRun(best.heading, best.words, best.minutes, ids, best.runs, power, ((),))


def _elsewhere(found: MotionEvidence, fits: tuple[TermFit, ...], name: str) -> tuple[TermFit, ...]:
    """A set with one mechanism on the other shaft, in its own form if that may act there; none where it cannot."""
    candidates = []
    for fit in fits:
        term = cast("MotionTerm", fit.candidate)
        if term.identifier == name:
            tabled = [cast("MotionTerm", each.term) for each in found.problem.tables.values()]
            twins = [each for each in tabled if (each.identifier, each.shaft) == (name, other_side(term.shaft))]
            if not twins:
                return ()
            term = next((each for each in twins if each.variant == term.variant), twins[0])
        candidates.append(term)
    return explain_with(found.problem, MotionCatalogue(), candidates).fits


def _best(
    found: MotionEvidence,
    slow_noise: SlowNoise,
    sides: tuple[str, ...],
    ids: tuple[str, ...],
    power: Callable[[Foresight], float],
) -> NextRun:
    """The shortest proposal with enough power, else the one with most; repeated where once is not enough."""

    def foreseen(proposal: Proposal) -> tuple[Proposal, float]:
        return proposal, power(Foresight(found, proposal, slow_noise))

    tried = [foreseen(proposal) for proposal in proposals(found.baseline, sides)]
    if max(each for _, each in tried) < ENOUGH:
        strongest = max(tried, key=lambda each: each[1])[0]
        tried.append(foreseen(replace(strongest, times=REPEATS)))
    strong = [each for each in tried if each[1] >= ENOUGH]
    proposal, reached = (
        min(strong, key=lambda each: each[0].minutes) if strong else max(tried, key=lambda each: each[1])
    )
    return NextRun(proposal.heading, proposal.words, proposal.minutes, ids, proposal.runs * proposal.times, reached)


def merged(runs: Iterable[NextRun]) -> tuple[NextRun, ...]:
    """Each run once, with all that it tells apart, from whom, and the least of its powers."""
    found: dict[str, NextRun] = {}
    for run in runs:
        known = found.get(run.description, run)
        ids = tuple(sorted({*known.separates, *run.separates}))
        rivals = known.rivals if known is run else (*known.rivals, *run.rivals)
        found[run.description] = replace(run, separates=ids, power=min(known.power, run.power), rivals=rivals)
    return tuple(found.values())

"""What to do about a campaign of steady points: the first screen of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.bench_parts import (
    GROUNDS,
    SHEET,
    UNSETTLED,
    UNSETTLED_COST,
    bench_parts,
    part_words,
    surely_differs,
)
from pmg.pipeline.chapters.explained.before_after import before_and_after
from pmg.pipeline.chapters.explained.cost import cost_of_cause, cost_of_places
from pmg.pipeline.diagnosis.design.direct_check import nothing_yet
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.diagnosis import possible_components
from pmg.pipeline.diagnosis.grid.remedy import AGAIN, APART, LIKELY, bench_action, best_test, lifting, words_of_test
from pmg.pipeline.diagnosis.grid.statement import (
    beyond,
    by_chance,
    causes,
    each_cause,
    faint,
    fitted,
    held_out,
    largest,
    near,
    nearest,
    phrase,
    taken_up,
    torque_change,
)
from pmg.pipeline.diagnosis.grid.track_record import track_record
from pmg.pipeline.report.action_sheet import ActionSheet, SheetAnswer
from pmg.pipeline.wording.cause_sets import numbered
from pmg.pipeline.wording.plurals import capitalised, counted, uncapitalised
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.sim.signals import Array


NOTHING = "Nothing."
"""What to do on a bench that agrees with its model."""


def action_sheet(
    diagnosis: Diagnosis, residual: Array, before: str = "", as_read: str = "", unsettled: tuple[str, ...] = ()
) -> ActionSheet:
    """The sheet of a campaign of steady points.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    residual : (m,) array
        Measured minus simulated at the readings of the test [N m].
    before : str
        Which model was given, where one was, as a phrase that ends in a colon; may be empty.
    as_read : str
        What a fault of a reading makes of the losses, where there is one, as a sentence; may be empty.
    unsettled : tuple of str
        What to do about each contradiction of the campaign as a whole, as sentences.
    """
    naming = diagnosis.naming
    named = tuple(
        (fit.candidate.kind.component_on(fit.candidate.shaft), naming.place_in(each, fit))
        for each in _possible(diagnosis)
        for fit in each.fits
        if naming is not None
    )
    places = () if diagnosis.verdict is Verdict.CONFOUNDED else diagnosis.mismatch.locations
    parts = bench_parts(
        named,
        sure=diagnosis.verdict is Verdict.NAMED,
        places=possible_components(places[0]) if places else (),
        signal=places[0].signal if places else "",
    )
    return ActionSheet(
        tuple(_answers(diagnosis, residual, before, as_read, unsettled)), parts, before_and_after(diagnosis, residual)
    )


def _possible(diagnosis: Diagnosis) -> tuple[GridExplanation, ...]:
    """The sets of causes that a verdict leaves, the leading one first; none where it names none."""
    if diagnosis.naming is None or not diagnosis.verdict.names:
        return ()
    return (diagnosis.naming.best, *(rival.explanation for rival in diagnosis.rivals))


def _answers(
    diagnosis: Diagnosis, residual: Array, before: str, as_read: str, unsettled: tuple[str, ...]
) -> Iterator[SheetAnswer]:
    naming, verdict = diagnosis.naming, diagnosis.verdict
    title = capitalised(phrase(diagnosis))
    if naming is not None and verdict is Verdict.NAMED:
        sizes = (fitted(diagnosis, i) for i in range(len(naming.best.fits)))
        yield SheetAnswer("Verdict", (f"{title}: {causes(diagnosis, naming.best)}.", *sizes), "mechanisms")
    else:
        hidden_by = ": in this order a drift looks like a loss" if verdict is Verdict.CONFOUNDED else ""
        yield SheetAnswer("Verdict", (f"{title}{hidden_by}.",), GROUNDS)
    if before:
        yield SheetAnswer("About", (f"What is left {uncapitalised(before).rstrip(': ')}.",))
    yield SheetAnswer("What differs", tuple(_difference(diagnosis)), "locations" * bool(diagnosis.mismatch.locations))
    if naming is not None and verdict is Verdict.AMBIGUOUS:
        listed = numbered([each_cause(diagnosis, each) for each in _possible(diagnosis)], others=diagnosis.weak)
        unknown = ("Or one that the catalogue does not have.",) if diagnosis.weak else ()
        yield SheetAnswer("Possible causes", (*listed, *unknown), "rivals" * bool(diagnosis.rivals))
    elif verdict is Verdict.NOT_IN_LIBRARY:
        none = "No mechanism of the catalogue explains it: we can show where, not why."
        closest = f"{capitalised(words)}." if (words := nearest(diagnosis)) else ""
        said = faint(diagnosis)
        yield SheetAnswer("Cause", (said,) if said else tuple(filter(None, (none, closest))))
    if sure := tuple(_sureness(diagnosis, bool(unsettled))):
        hidden = diagnosis.audit is not None and verdict is Verdict.CONSISTENT
        yield SheetAnswer("How sure", sure, "visibility" if hidden else GROUNDS)
        if hidden and (never := sorted(title for title, size in _largest_hidden(diagnosis) if not np.isfinite(size))):
            titles = [never[0], *map(uncapitalised, never[1:])]
            yield SheetAnswer("Not visible", (f"{', '.join(titles)}: not detectable at any size.",), "visibility")
    first, action = (f"First: {uncapitalised(each)}" for each in unsettled[:1]), _action(diagnosis)
    yield SheetAnswer("On the bench", (*first, *unsettled[1:], *(() if unsettled and action == NOTHING else (action,))))
    yield SheetAnswer("Next test", (_next(diagnosis),), "next-tests" * bool(diagnosis.next_tests))
    yield SheetAnswer("In the model", (IN_THE_MODEL[verdict],))
    if cost := tuple(
        cost_of_cause(diagnosis, residual, as_read) if diagnosis.refit is not None else cost_of_places(diagnosis)
    ):
        yield SheetAnswer("If ignored", (UNSETTLED_COST,) if unsettled and action == NOTHING else cost)


def _difference(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.verdict is Verdict.CONFOUNDED:
        yield beyond(diagnosis.mismatch)
        shafts = " and ".join(diagnosis.blind)
        yield f"The points were run in the order of the {shafts} speed, and none was repeated."
        yield "Which component would drift is unknown."
    elif not diagnosis.mismatch.found:
        points = counted(int(diagnosis.mismatch.readings.grid.accepted.sum()), "point")
        u = " and ".join(f"{diagnosis.floor[side].u * 1e3:.1f} ({side})" for side in SIDES)
        yield f"Nothing beyond repeatability: the model predicts the torques of {points} to {u} mN m."
    elif diagnosis.refit is not None and diagnosis.naming is not None:
        fits = diagnosis.naming.best.fits
        sets = [each_cause(diagnosis, each) for each in _possible(diagnosis)]
        for fit, cause in zip(fits, sets[0], strict=True):
            side, what, size = torque_change(diagnosis, fit)
            first = "" if all(cause in each for each in sets) else " if cause 1 is true"
            why = "" if len(fits) == 1 else f" because of {uncapitalised(fit.candidate.kind.title)}{first}"
            yield f"The {side} {what} is off{why}: {size}{taken_up(diagnosis, fit)}"
    else:
        where, side = largest(diagnosis), diagnosis.mismatch.locations[0].signal.removeprefix("torque_")
        floor, proof = diagnosis.floor[side], diagnosis.held_out
        repeated = (
            proof is not None and np.isfinite(floor.repeats) and proof.rmse_after < IN_REPEATS * proof.noise_floor
        )
        too = ": repeats show the pattern too" if repeated else ""
        yield f"{capitalised(where)} Repeatability is {floor.u * 1e3:.1f} mN m{too}."
    if diagnosis.outliers:
        yield f"{counted(len(diagnosis.outliers), 'outlier')} excluded first."


def _sureness(diagnosis: Diagnosis, unsettled: bool) -> Iterator[str]:
    mismatch = diagnosis.mismatch
    if unsettled:
        yield UNSETTLED
    if mismatch.found and (differs := surely_differs(diagnosis.verdict, mismatch.p_value)):
        yield differs
    if proof := held_out(diagnosis):
        yield proof
    unknown = diagnosis.verdict is Verdict.NOT_IN_LIBRARY  # its record needs more words, in the chapter
    if not unsettled and not unknown and (record := track_record(diagnosis)) is not None:
        yield record.sentence
    if diagnosis.verdict is Verdict.CONFOUNDED:
        yield "What the loss curves hold could be drift or real loss. Slow changes are neither shown nor excluded."
    elif not mismatch.found:
        alarms = f"{mismatch.false_alarm_rate:.0%} of campaigns without a difference raise an alarm."
        yield f"{counted(mismatch.tested, 'kind')} of dependence tested; {alarms}"
        yield from _hidden(diagnosis)
    yield from (sentence for sentence in (near(diagnosis), by_chance(diagnosis)) if sentence)


def _hidden(diagnosis: Diagnosis) -> Iterator[str]:
    """How large a fault could still hide: the largest sizes that are found with 95 % power."""
    seen = sorted(((size, title) for title, size in _largest_hidden(diagnosis) if np.isfinite(size)), reverse=True)
    if not seen:
        return
    listed = ", ".join(f"{uncapitalised(title)} {size:.1f}" for size, title in seen[:HIDDEN_LISTED])
    others = (
        f"; {counted(len(seen) - HIDDEN_LISTED, 'other kind')} at smaller ones" if len(seen) > HIDDEN_LISTED else ""
    )
    yield f"Found in 95 of 100 campaigns from these sizes on (mN m rms): {listed}{others}."


def _largest_hidden(diagnosis: Diagnosis) -> Iterator[tuple[str, float]]:
    """Each kind of mechanism, and the largest size [mN m] that could hide on a shaft; no bound where none shows."""
    by_title: dict[str, float] = {}
    for row in () if diagnosis.audit is None else diagnosis.audit.visible:
        title = row.candidate.kind.title
        by_title[title] = max(np.inf if row.unseen else row.size_95 * 1e3, by_title.get(title, 0.0))
    yield from by_title.items()


def _action(diagnosis: Diagnosis) -> str:
    """What to do on the bench."""
    if diagnosis.verdict is Verdict.NAMED:
        return f"{capitalised(bench_action(diagnosis) or 'nothing to repair: this is physics the model lacks')}."
    if diagnosis.verdict is Verdict.CONSISTENT:
        return NOTHING
    likely = any(test.power >= LIKELY for test in diagnosis.next_tests)
    if diagnosis.verdict is not Verdict.NOT_IN_LIBRARY:
        return nothing_yet(diagnosis.naming, test_tells=likely)
    parts = [part_words(each) for place in diagnosis.mismatch.locations[:1] for each in possible_components(place)]
    if not parts:
        side = diagnosis.mismatch.locations[0].signal.removeprefix("torque_")
        again = " The next test shows whether it comes back." if likely else ""
        return f"Change nothing yet: look on the {side} shaft for what the difference depends on.{again}"
    first = "If the next test shows it again, inspect" if likely else "Inspect"
    return f"{first} the {', the '.join(parts[:-1])}{' and the ' if parts[1:] else ''}{parts[-1]}."


def _next(diagnosis: Diagnosis) -> str:
    """Which test is next, and the command that writes its sheet."""
    verdict, tests = diagnosis.verdict, diagnosis.next_tests
    if verdict is Verdict.NAMED:
        test = diagnosis.confirming
        against = "Readings outside the band of the cause speak against it."
        return f"To confirm: {words_of_test(test, AGAIN)} Its sheet: {SHEET}. {against}" if test else "None is needed."
    if verdict is Verdict.CONFOUNDED:
        return f"{lifting(diagnosis)} {f'Its sheet: {SHEET}.' if tests else ''}".rstrip()
    if verdict is Verdict.CONSISTENT:
        return "None is needed. `pmg design PLAN.toml` shows which plan of points would find smaller faults."
    if tests:
        does, then = (AGAIN, "") if verdict is Verdict.NOT_IN_LIBRARY else (APART, f" {TOLD}")
        return f"{words_of_test(best_test(tests), does)} Its sheet: {SHEET}.{then}"
    return "No test of those known tells them apart: compare with a campaign of the same bench (`pmg report A B`)."


TOLD = "It says of each point which cause its reading speaks for."
"""What the readings of a test that tells causes apart mean."""

IN_REPEATS = 0.7
"""Part of the repeatability below which an error with a fitted curve tells that repeats hold what the curve does."""

HIDDEN_LISTED = 3
"""Mechanisms whose detectable size is given."""

IN_THE_MODEL = {
    Verdict.NAMED: "`model.toml` holds the cause: compare with it (`pmg compare --model model.toml`).",
    Verdict.AMBIGUOUS: "`model.toml` holds the first possible cause: do not rely on it yet.",
    Verdict.NOT_IN_LIBRARY: "`model.toml` holds the fitted losses alone: there is no known term to add.",
    Verdict.CONFOUNDED: "`model.toml` may hold a drift in its losses: do not simulate with it yet.",
    Verdict.CONSISTENT: "`model.toml` is the calibrated bench: simulate with it (`pmg simulate --model model.toml`).",
}
"""What to do with the model that a comparison leaves."""

"""Terms by their names for people, and the tests that would tell some of them apart."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.balance.borne_out import HeldBack, of_no_size
from pmg.pipeline.diagnosis.balance.library.elastic import BACKLASH, GAP_TEST, LIKE_PLAY
from pmg.pipeline.diagnosis.balance.library.term import DELAY
from pmg.pipeline.wording.plurals import uncapitalised

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.library.term import Term


def title_of(diagnosis: TermsDiagnosis, identifier: str) -> str:
    """Name of a term for people by its id, in lower case."""
    return titled(next(t for t in diagnosis.case.library if t.identifier == identifier))


def titles_of(fits: Iterable[TermFit]) -> str:
    """Names of a set of terms for people; empty without any."""
    return " and ".join(titled(fit.candidate) for fit in fits)


def lateness_of(identifier: str, lag: float, pushes: str) -> str:
    """Which of a command and the motion comes later, by a lag of the motion [s]; empty of another term."""
    if identifier != DELAY:
        return ""
    late, early = ("motion", pushes) if lag > 0.0 else (pushes, "motion")
    return f"the {late} comes {1e3 * abs(lag):.3g} ms after the {early}"


def left_out_sentence(diagnosis: TermsDiagnosis) -> str:
    """What the search found as well and is not named; empty where nothing was left out."""
    if not diagnosis.left_out:
        return ""
    if BACKLASH in {fit.identifier for fit in diagnosis.steps[-1].fitted.fits} and all(
        fit.identifier in LIKE_PLAY for fit in diagnosis.left_out
    ):
        return f"Asked again without {titles_of(diagnosis.left_out)}, which led, as play in a coupling looks the same."
    return f"Not named: {titles_of(diagnosis.left_out)}, which not every quarter of the record and low-pass shows."


def why_held_back(diagnosis: TermsDiagnosis) -> str:
    """What was found and is not named, and why."""
    found = titles_of(step.fitted.fits[-1] for step in diagnosis.steps[1:])
    if diagnosis.held_back is HeldBack.LIKE_PLAY:
        return f"{found} would explain it, but play in a coupling looks the same. {GAP_TEST}."
    if diagnosis.held_back is HeldBack.UNEVEN_DELAY:
        uneven = "the delay is shorter where it moves the force less, and play in a coupling is late for moments only"
        return f"{found} would explain it, but {uneven}. {GAP_TEST}."
    if diagnosis.held_back is HeldBack.WORSE_WITHHELD:
        return f"{found} would explain it, but the error on the withheld record is larger with it."
    if diagnosis.held_back is HeldBack.SIZE_UNKNOWN:
        unknown = of_no_size(diagnosis.steps[-1].fitted)
        sizes = ", ".join(f"{e.name} = {with_error(e)}" for e in unknown)
        of = title_of(diagnosis, unknown[0].term)
        return f"{found} would explain it, but a few samples carry it: the size of {of} is not known, {sizes}."
    given = f"{diagnosis.case.prepare.low_pass_hz:g} Hz"
    return f"{found} would explain it with the low-pass of {given}, but neither half of that nor twice names the same."


def with_error(e: Estimate) -> str:
    """A parameter with its standard error and unit."""
    return f"{e.value:.3g} ± {e.standard_error:.2g} {e.unit}"


def titled(term: Term[Any]) -> str:
    """Name of a term for people, in lower case."""
    return term.title if term.title.startswith("Coulomb") else uncapitalised(term.title)


def separating_test(diagnosis: TermsDiagnosis, ids: tuple[str, ...]) -> str:
    """Test that would tell some terms apart."""
    tests = {t.identifier: t.separating_test for t in diagnosis.case.library}
    return next((tests[name] for name in ids if tests[name]), "")


def taken_for_granted(case: Case, joint: str) -> str:
    """The terms of the baseline by their ids, and further ones that are known."""
    known = joint.join(each.term.key for each in case.stated if each.amplitudes.any())
    further = f"; known: {known}" if known else ""
    return f"{joint.join(case.baseline)}{further}"

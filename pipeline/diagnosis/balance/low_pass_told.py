"""What other low-passes name, beside what is told, in words; and when that is a warning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.borne_out import HeldBack
from pmg.pipeline.diagnosis.balance.titles import titles_of
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.recording.remark import Remark

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried

NOT_NOTHING = 2.0
"""Standard errors from which on a size is more than none."""

SAME = "the search says the same"
"""Said of a low-pass with which nothing changes."""

OPEN = "the cause stays open as well"
"""Said of one with which nothing is named either, whatever comes nearest."""


def said_with(d: TermsDiagnosis, tried: LowPassTried) -> str:
    """What the search says with another low-pass, against what is told: `SAME`, or how it differs."""
    limit = d.mismatch.false_alarm_rate
    if not d.mismatch.found:
        return "a mismatch is seen" if tried.p_value <= limit / len(d.low_passes) else SAME
    if tried.p_value > limit:
        return "no mismatch is seen"
    if not _leads(d):
        return _said_of_open(d, tried)
    leading, terms = _leading(d), _titles(tried.fits)
    if tried.ids in [leading, *(contest.rival.ids for contest in d.contests if contest.open)]:
        return SAME
    if leading < tried.ids:
        return f"more comes in: {_titles(fit for fit in tried.fits if fit.identifier not in leading)}"
    if tried.ids < leading:
        return f"less is seen: {terms}"
    if tried.lets_in_a_resonance(d.case.prepare.low_pass_hz):
        return f"noise or a resonance may have come in: {terms}"
    return f"the search names {terms}{'' if tried.explained else ', which does not explain it'}"


def _said_of_open(d: TermsDiagnosis, tried: LowPassTried) -> str:
    """The same where nothing is named."""
    if d.impossible:
        return f"the search names {_titles(tried.fits)}"
    return f"{_titles(tried.fits)} may explain it" if _may_explain(d, tried) else OPEN


def _titles(fits: Iterable[TermFit]) -> str:
    return titles_of(fits) or "no term"


def _leads(d: TermsDiagnosis) -> bool:
    """Whether a set was found with the low-pass in force, be it named or held back."""
    return d.verdict.names or d.held_back is not None


def _hangs(d: TermsDiagnosis) -> bool:
    return d.held_back is HeldBack.LOW_PASS or any(_contradicts(d, each) for each in d.low_passes)


def _leading(d: TermsDiagnosis) -> frozenset[str]:
    return frozenset(step.added for step in d.steps[1:])


def _may_explain(d: TermsDiagnosis, tried: LowPassTried) -> bool:
    sizes = all(abs(each.value) > NOT_NOTHING * each.standard_error for each in tried.sizes)
    nothing_leads = d.verdict is Verdict.NOT_IN_LIBRARY and not d.impossible and d.held_back is None
    return nothing_leads and tried.explained and not tried.impossible and bool(tried.fits) and sizes


def _contradicts(d: TermsDiagnosis, tried: LowPassTried) -> bool:
    """Whether another low-pass names other terms where it sees a mismatch, and lets in nothing that would hide them."""
    same = not _leads(d) or tried.p_value > d.mismatch.false_alarm_rate or said_with(d, tried) == SAME
    leading = _leading(d)
    return not (
        same or leading < tried.ids or tried.ids < leading or tried.lets_in_a_resonance(d.case.prepare.low_pass_hz)
    )


def low_pass_sentence(d: TermsDiagnosis) -> str:
    """Whether half the low-pass and twice say the same; empty where neither could be tried."""
    if not d.low_passes:
        return ""
    tried = [(f"{each.low_pass_hz:g} Hz", said_with(d, each)) for each in d.low_passes]
    answers = {said for _, said in tried}
    if len(answers) == 1 and answers <= {SAME, OPEN}:
        return f"With a low-pass of {' or '.join(at for at, _ in tried)} {answers.pop()}."
    others = "; ".join(f"at {at} {said}" for at, said in tried)
    if _hangs(d):
        return f"It hangs on the low-pass of {d.case.prepare.low_pass_hz:g} Hz: {others}."
    return f"Another low-pass: {others}."


def low_pass_remarks(d: TermsDiagnosis) -> tuple[Remark, ...]:
    """A warning where another low-pass names other terms, or explains what is open here."""
    if _hangs(d):
        do = "Set it below the first resonance, and high enough to keep what follows a reversal."
        return (Remark("warning", "low_pass_Hz", f"{low_pass_sentence(d)} {do}"),)
    better = next((each for each in d.low_passes if _may_explain(d, each)), None)
    if better is None:
        return ()
    at = f"At {better.low_pass_hz:g} Hz {said_with(d, better)}; that is not proved."
    given = f"low_pass_Hz = {better.low_pass_hz:g} and keep_every = {better.keep_every}"
    do = f"Run again with {given}, on other recordings."
    return (Remark("warning", "low_pass_Hz", f"{at} {do}"),)

"""What other low-passes name, beside what is told, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.document import titled
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.recording.remark import Remark

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried

SAME = "the same"
"""Said of a low-pass with which nothing changes."""


def said_with(d: TermsDiagnosis, tried: LowPassTried) -> str:
    """What the search says with another low-pass, against what is told: `SAME`, or how it differs."""
    seen = tried.p_value <= d.mismatch.false_alarm_rate / max(len(d.low_passes), 1)
    terms = " and ".join(titled(fit.candidate) for fit in tried.fits) or "no term"
    if not d.mismatch.found:
        return "a mismatch is seen" if seen else SAME
    if not seen:
        return "no mismatch is seen"
    if not d.verdict.names:
        open_still = d.verdict is Verdict.NOT_IN_LIBRARY and not tried.explained
        return SAME if open_still or d.impossible else f"{terms}, with which nothing is left"
    leading = frozenset(step.added for step in d.steps[1:])
    sets = [leading, *(contest.rival.ids for contest in d.contests if contest.open)]
    if tried.ids in sets:
        return SAME
    more = " and ".join(titled(fit.candidate) for fit in tried.fits if fit.identifier not in leading)
    if leading < tried.ids:
        return f"{SAME} with {more} beside"
    return terms if tried.explained else f"{terms}, which does not explain it"


def low_pass_sentence(d: TermsDiagnosis) -> str:
    """Whether half the low-pass and twice say the same; empty where neither could be tried."""
    if not d.low_passes:
        return ""
    told = [(f"{each.low_pass_hz:g} Hz", said_with(d, each)) for each in d.low_passes]
    if all(said == SAME for _, said in told):
        return f"With a low-pass of {' or '.join(at for at, _ in told)} the search says the same."
    others = "; ".join(f"at {at} {said}" for at, said in told)
    return f"It hangs on the low-pass of {d.case.prepare.low_pass_hz:g} Hz: {others}."


def low_pass_remarks(d: TermsDiagnosis) -> tuple[Remark, ...]:
    """A warning where another low-pass says something else."""
    if all(said_with(d, each) == SAME for each in d.low_passes):
        return ()
    do = "Set it below the first resonance, and high enough to keep what follows a reversal."
    return (Remark("warning", "low_pass_Hz", f"{low_pass_sentence(d)} {do}"),)

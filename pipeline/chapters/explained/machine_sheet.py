"""What to do about a machine whose force or torque balance was searched: the first screen of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from pmg.pipeline.diagnosis.balance.causes import named_causes, near_causes
from pmg.pipeline.diagnosis.balance.document import headline
from pmg.pipeline.diagnosis.balance.errors_told import percent, what_it_misses, where_it_sticks
from pmg.pipeline.diagnosis.balance.low_pass_told import low_pass_sentence
from pmg.pipeline.diagnosis.balance.parts import ONE_SHAFT, TWO_SHAFTS, part_of
from pmg.pipeline.diagnosis.balance.titles import left_out_sentence, why_held_back
from pmg.pipeline.diagnosis.engine.conclusion import in_the_main_sentence
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.rivals import why_not_named
from pmg.pipeline.diagnosis.grid.track_record import OF_MACHINES, track_record
from pmg.pipeline.report.action_sheet import ActionSheet, MachinePart, SheetAnswer
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording.cause_sets import TOGETHER
from pmg.pipeline.wording.plurals import capitalised, counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.balance.causes import NamedCause
    from pmg.pipeline.diagnosis.balance.contest import ModelStep
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.recording.remark import Remark
    from pmg.sim.signals import Array

GROUNDS, MODELS, CAUSES, STATED = "verdict-terms", "terms-models", "terms-causes", "machine-stated"
"""Sections and tables of the report that hold the grounds."""

SHOWN = 400
"""Thinned samples of the picture: a few reversals or periods can be told apart."""

TITLES = {
    Verdict.CONSISTENT: "Consistent with the model",
    Verdict.NAMED: "Cause named",
    Verdict.AMBIGUOUS: "Cause ambiguous",
    Verdict.NOT_IN_LIBRARY: "Cause not in the library",
}
"""Verdict in the words of the other sheets."""

MOST_OF_IT = 0.5
"""Part of a mismatch that the closest term explains from which on the part that it sits in is marked as possible."""

WITH = {"named": "with the cause", "tried": "with the terms tried"}
"""The last model in a legend, by what is said of its terms."""


def machine_sheet(diagnosis: TermsDiagnosis, against: tuple[Remark, ...] = (), *, goes_on: bool) -> ActionSheet:
    """The sheet of a machine of one's own.

    Parameters
    ----------
    diagnosis : TermsDiagnosis
        Of its records.
    against : tuple of Remark
        What the records say against its file.
    goes_on : bool
        Whether a machine file with the cause was written.
    """
    causes = named_causes(diagnosis)
    answers = tuple(_answers(diagnosis, causes, against, goes_on=goes_on))
    return ActionSheet(answers, _parts(diagnosis, causes), _picture(diagnosis))


def _parts(d: TermsDiagnosis, causes: tuple[NamedCause, ...]) -> tuple[MachinePart, ...]:
    two = d.case.ratio is not None
    sure, possible = ({part_of(c.identifier, two_torques=two) for c in causes if c.sure is so} for so in (True, False))
    possible |= {part_of(near.identifier, two_torques=two) for near in near_causes(d)[:1] if near.share > MOST_OF_IT}

    def mark(part: str) -> Literal["cause", "possible", ""]:
        return "cause" if part in sure else "possible" if part in possible else ""

    return tuple(MachinePart(part, mark=mark(part)) for part in (TWO_SHAFTS if two else ONE_SHAFT))


def _answers(
    d: TermsDiagnosis, causes: tuple[NamedCause, ...], against: tuple[Remark, ...], *, goes_on: bool
) -> Iterator[SheetAnswer]:
    first, last, push = d.steps[0], d.steps[-1], d.case.axis.push
    title = (TITLES.get(d.verdict) or headline(d)).rstrip(".")
    if d.verdict is Verdict.NAMED:
        title += f": {TOGETHER.join(cause.title for cause in causes)}"
    yield SheetAnswer("Verdict", (f"{title}.",), GROUNDS)
    noise = f"noise is {d.noise.noise.standard_deviation:.3g} {push}"
    if d.mismatch.found:
        rms = float(np.sqrt(np.mean(first.fitted.left(d.recorded) ** 2)))
        places = "; and ".join(place.name for place in d.mismatch.locations[:2])
        where = f" It follows {places}." if places else ""
        yield SheetAnswer("What differs", (f"The balance is off by {rms:.3g} {push} rms; {noise}.{where}",), MODELS)
    else:
        but = f" But {said}." if (said := what_it_misses(d, first)) else ""
        yield SheetAnswer("What differs", (f"Nothing beyond the noise; {noise}.{but}",), MODELS)
    if against:
        yield SheetAnswer("Against the file", tuple(f"{capitalised(each.message)}." for each in against), STATED)
    if causes:
        several = any(cause.group for cause in causes)
        yield SheetAnswer("Possible causes" if several else "Its size", tuple(_sizes(causes, push)), CAUSES)
    elif d.impossible:
        yield SheetAnswer("Cause", (headline(d),))
    elif d.held_back:
        yield SheetAnswer("Cause", (f"Not named: {why_held_back(d)}",))
    elif d.verdict is Verdict.NOT_IN_LIBRARY:
        but = "" if d.naming is None else f", but {why_not_named(d.naming, 'quarters of the records')}"
        near = (f"The closest, {each.title}, explains {each.part} of it{but}." for each in near_causes(d)[:1])
        yield SheetAnswer("Cause", ("No set of terms explains it. We can show where, not why.", *near))
    yield SheetAnswer("How sure", tuple(_sureness(d, first, last)), GROUNDS)
    yield SheetAnswer("On the bench", (_action(d, contradicted=bool(against)),))
    tests = tuple(_tests(d, causes, contradicted=bool(against)))
    yield SheetAnswer("Next test", tests, CAUSES * bool(causes))
    if d.verdict is Verdict.CONSISTENT and not against:
        yield SheetAnswer("In the model", ("The fitted constants describe the machine; `terms.json` holds them.",))
    elif causes:
        added = "Add the term with its fitted size; `terms.json` and `residuals.csv` hold both models."
        written = "`machine-with-cause.toml` holds it with its size: go on with that file as `--machine`."
        kept = "Nothing until one of them is confirmed; `terms.json` holds the sizes."
        changed = "A known size has changed: take its rows out of `[[model.known]]`, and run again."
        again = {cause.identifier for cause in causes} & {each.term.identifier for each in d.case.stated}
        yield SheetAnswer("In the model", (kept if several else changed if again else written if goes_on else added,))
    if causes and last is not first:
        yield SheetAnswer("If ignored", tuple(_costs(d, first, last)))


def _sizes(causes: tuple[NamedCause, ...], push: str) -> Iterator[str]:
    """Sizes of what is sure, then of what is open, a number for each set."""
    sets = 1 + max(cause.group for cause in causes)
    for cause in causes:
        if not cause.group and cause.sure:
            yield ("In each case: " if sets > 1 else "") + _cause_sentence(cause, push)
    for group in range(sets):
        own = [_cause_sentence(cause, push) for cause in causes if cause.group == group and not cause.sure]
        if own:
            yield f"{group + 1}. {' With it: '.join(own)}"


def _cause_sentence(cause: NamedCause, push: str) -> str:
    remark = f"; {cause.remark}" if cause.remark else ""
    return f"{capitalised(cause.title)}: {cause.size}{remark} ({cause.effect:.3g} {push} rms)."


def _sureness(d: TermsDiagnosis, first: ModelStep, last: ModelStep) -> Iterator[str]:
    if d.withheld is not None and last is not first:
        drop = f"from {percent(first.error_withheld)} to {percent(last.error_withheld)}"
        yield f"On the recording not used for the fit the relative error goes {drop}."
    elif last is not first:
        drop = f"from {percent(first.error_fit)} to {percent(last.error_fit)}"
        yield f"The relative error goes {drop}; no recording was withheld to test it."
    if told := where_it_sticks(d, last):
        yield told
    if d.mismatch.found:
        yield f"p ≤ {d.mismatch.p_value:.2g}, from {counted(d.mismatch.draws, 'synthetic record')}."
    else:
        yield f"p = {d.mismatch.p_value:.2g}, from {counted(d.mismatch.draws, 'synthetic record')}."
    if not (d.impossible or d.left_out) and (record := track_record(d, OF_MACHINES)) is not None:
        yield record.sentence
    if d.verdict.names and (main := in_the_main_sentence(d.naming, d.held_out)):
        yield main
    if left_out := left_out_sentence(d):
        yield left_out
    if told := low_pass_sentence(d):
        yield told
    if d.left_over.found and d.naming is not None:
        yield f"What is left still follows {d.left_over.locations[0].name}."


def _action(d: TermsDiagnosis, *, contradicted: bool) -> str:
    if d.impossible or (contradicted and d.verdict is Verdict.CONSISTENT):
        return "Check sign, unit and filter of the channels."
    return "Nothing." if d.verdict is Verdict.CONSISTENT else "Repair nothing before the next test has confirmed it."


def _tests(d: TermsDiagnosis, causes: tuple[NamedCause, ...], *, contradicted: bool) -> Iterator[str]:
    """The tests that would confirm what is named, or the nearest of what is not."""
    near = [each.test for each in near_causes(d)[:1]]
    first_open = sorted(causes, key=lambda cause: cause.sure)  # what tells the sets apart
    tests = [test for test in (*(each.test for each in first_open), *near) if test]
    if d.impossible:
        yield "The same record again, with the channels checked."
    elif tests:
        yield from (f"{capitalised(test.rstrip('.'))}." for test in list(dict.fromkeys(tests))[:2])
    elif d.verdict is Verdict.CONSISTENT:
        yield "Run the same recordings again, once file or channel is right." if contradicted else "None is needed."
    else:
        yield "Look at what the residual follows (residuals.csv), and record a run that sweeps it."


def _costs(d: TermsDiagnosis, first: ModelStep, last: ModelStep) -> Iterator[str]:
    """Power by which a model without the cause is wrong."""
    speed = d.recorded.thin(d.recorded.motion.speed[:, None])[:, 0]
    wrong = (last.fitted.predict(d.recorded) - first.fitted.predict(d.recorded)) * speed
    carried = np.abs((d.recorded.force + d.recorded.known) * speed)
    rms, most = float(np.sqrt(np.mean(wrong**2))), float(np.abs(wrong).max())
    shown = [f"{float(f'{watts:.2g}'):g} W" for watts in (rms, most)]
    yield f"A model without this is wrong by {shown[0]} rms, up to {shown[1]}."
    if carried.any():
        yield f"That is {rms / float(np.sqrt(np.mean(carried**2))):.1%} of the power in the balance."


def _picture(d: TermsDiagnosis) -> Figure:
    """Residual before and after, in the stretch where what was named takes most of it, or where most of it is."""
    first, last, push = d.steps[0], d.steps[-1], d.case.axis.push
    stages = [("plain model", first.fitted.left(d.recorded), 1)]
    if last is not first:
        stages.append((WITH[d.last_word], last.fitted.left(d.recorded), 0))
    shown, name = _clearest(d, stages[0][1] ** 2 - (stages[1][1] ** 2 if len(stages) > 1 else 0.0))
    time, u = d.recorded.elapsed[shown], d.noise.noise.standard_deviation
    ends = np.array([float(time[0]), float(time[-1])])
    series = [Series("noise, 95 %", ends, 0.0 * ends, np.array([u, u]), "band", 7)]
    series += [Series(words, time, left[shown], None, "line", colour) for words, left, colour in stages]
    sizes = ", ".join(f"{words} {float(np.sqrt(np.mean(left**2))):.3g} {push} rms" for words, left, _ in stages)
    title = f"Measured less modelled {d.case.axis.pushes}, where it is clearest in {name}"
    chart = Chart("time [s]", f"{d.case.axis.pushes} [{push}]", tuple(series), references=(("", 0.0),))
    whole = "in all of it" if len(d.recorded.names) == 1 else "in all recordings that were fitted"
    return Figure("before-and-after", title, f"{capitalised(sizes)} {whole}.", (chart,), narrow=True)


def _clearest(d: TermsDiagnosis, squares: Array) -> tuple[slice, str]:
    """Thinned samples in a row, `SHOWN` of them at most, whose squares (n,) add up to most; and their recording."""
    found: tuple[float, slice, str] | None = None
    ends = (*d.recorded.starts, len(squares))
    for name, begin, end in zip(d.recorded.names, ends, ends[1:], strict=False):
        width = min(SHOWN, end - begin)
        sums = np.convolve(squares[begin:end], np.ones(width), "valid")
        at = int(np.argmax(sums))
        if found is None or sums[at] > found[0]:
            found = float(sums[at]), slice(begin + at, begin + at + width), name
    assert found is not None  # there is a recording
    return found[1:]

"""Terms named from the recordings of a machine: the verdict, the models one after the other, the proof."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.explained.balance_figures import friction_figure, residuals_figure
from pmg.pipeline.chapters.explained.free_run import free_run_sections
from pmg.pipeline.chapters.explained.low_passes import low_passes_table
from pmg.pipeline.diagnosis.balance.causes import named_causes, nearest_lines
from pmg.pipeline.diagnosis.balance.errors_told import percent
from pmg.pipeline.diagnosis.balance.library.drive import EMPS
from pmg.pipeline.diagnosis.balance.records.zero import words_of_zero
from pmg.pipeline.diagnosis.balance.serial import KUENSCH
from pmg.pipeline.diagnosis.balance.titles import separating_test, taken_for_granted, title_of, titled
from pmg.pipeline.report.document import Cell, Column, Facts, Measured, Section, Table, Text
from pmg.sim import sources

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.contest import ModelStep
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.estimate import Estimate

PLACES_SHOWN = 4
"""Places that a mismatch follows of which the page tells; the others are in the JSON."""

TERMS_SHOWN = 8
"""Terms of a round that the table shows."""


def terms_sections(diagnosis: TermsDiagnosis) -> tuple[Section, ...]:
    """The whole page."""
    found = (_verdict(diagnosis), _models(diagnosis), *free_run_sections(diagnosis))
    return (*found, _parameters(diagnosis), _search(diagnosis), _limits(diagnosis))


def _verdict(d: TermsDiagnosis) -> Section:
    places, left = (
        _listed([f"{p.name} ({p.rms:.2g} times the noise)" for p in test.locations])
        for test in (d.mismatch, d.left_over)
    )
    facts: tuple[tuple[str, Cell], ...] = (
        ("Samples of the regression", float(len(d.recorded.force))),
        (f"Noise, standard deviation [{d.case.axis.push}]", d.noise.noise.standard_deviation),
        ("Memory of the noise [samples]", float(d.noise.noise.lags)),
        (f"At rest below [{d.case.axis.speed}]", d.recorded.motion.rest_speed),
        ("Driven", "no: it coasts" if d.recorded.coasts else "yes"),
        (f"p-value of the mismatch, from {d.mismatch.draws} synthetic records", d.mismatch.p_value),
        ("The mismatch follows", places),
        ("What is left follows", left),
    )
    return Section(
        "verdict-terms",
        "Verdict",
        (*_causes(d), residuals_figure(d), friction_figure(d), Facts(facts)),
        (EMPS, sources.WESTFALL_YOUNG),
    )


def _listed(places: list[str]) -> str:
    """Places, those that say most; how many more there are."""
    more = f"; and {len(places) - PLACES_SHOWN} more" if len(places) > PLACES_SHOWN else ""
    return "; ".join(places[:PLACES_SHOWN]) + more if places else "none"


def _causes(d: TermsDiagnosis) -> tuple[Table | Text, ...]:
    """What was named, how large, and what would confirm it; what comes nearest where nothing is named."""
    causes = named_causes(d)
    if not causes:
        near = " ".join(f"{line.strip().rstrip('.:')}." for line in nearest_lines(d) if line)
        return (Text(near),) if near else ()
    several = max(cause.group for cause in causes) > 0
    rows: list[tuple[Cell, ...]] = [
        (
            *((cause.group + 1,) if several else ()),
            cause.title,
            f"{cause.size}; {cause.remark}" if cause.remark else cause.size,
            cause.effect,
            cause.test,
        )
        for cause in causes
    ]
    told = "Only one of these sets is there; the records cannot say which. " if several else ""
    table = Table(
        "terms-causes",
        "What was left out, and what would confirm it",
        f"{told}Sizes with standard errors; the effect is the root mean square of what the term does in the balance.",
        (
            *((Column("set", "Set"),) if several else ()),
            Column("cause", "Cause"),
            Column("size", "Size"),
            Column("effect", "Effect", d.case.axis.push, digits=3),
            Column("test", "On the bench"),
        ),
        tuple(rows),
    )
    return (table,)


def _last(d: TermsDiagnosis) -> ModelStep:
    return (d.refinements or d.steps)[-1]


def _stand_row(d: TermsDiagnosis, kind: str, step: ModelStep) -> tuple[Cell, ...]:
    """What one more term changes: its evidence, both errors, withheld blocks with the interval of the gain."""
    proof, (low, high) = step.held, step.carried
    carries = "–" if math.isnan(low) else "yes" if low > 0.0 else "no" if high < 0.0 else "not certain"
    return (
        titled(step.fitted.fits[-1].candidate) if step.added else f"baseline: {taken_for_granted(d.case, ', ')}",
        kind if step.added else "baseline",
        step.evidence if step.added else None,
        100.0 * step.error_fit,
        100.0 * step.error_withheld,
        *((None,) * 4 if proof is None else (proof.rmse_before, proof.rmse_after, *proof.gain_interval)),
        carries,
    )


def _models(d: TermsDiagnosis) -> Section:
    kinds = ((d.last_word, d.steps), ("refinement", d.refinements), ("dropped", d.dropped))
    push = d.case.axis.push
    rows = [_stand_row(d, kind, step) for kind, steps in kinds for step in steps]
    for which, error in d.case.published_errors.items():
        fit, withheld = (100.0 * error, None) if which == "fit" else (None, 100.0 * error)
        rows.append((f"published, {which}", "published", None, fit, withheld, None, None, None, None, "–"))
    table = Table(
        "terms-models",
        "One term after the other",
        "Each line adds a term to the one above. A named term passed every rule, a tried one did not; a refinement "
        "lowers the error on withheld blocks and beats every decoy, but may be no more than an error of form. One that "
        "makes the error on the withheld record larger, or a value impossible, is dropped.",
        (
            Column("model", "Added"),
            Column("state", "State"),
            Column("evidence", "Evidence", digits=0),
            Column("error_fit", "Relative error", "%", digits=2),
            Column("error_withheld", "Withheld record", "%", digits=2),
            Column("before", "Withheld blocks, before", push, digits=3),
            Column("after", "after", push, digits=3),
            Column("low", "gain from", push, digits=3),
            Column("high", "gain to", push, digits=3),
            Column("carried", "Carries over"),
        ),
        tuple(rows),
    )
    texts = [
        "Relative error: root of the sum of squares of what is left, as part of that of the force. Amplitudes and "
        "shapes are those of the fitted record; the withheld record takes part in no fit, and in no choice but to drop "
        "refinements that hurt it. Blocks of neighbours are withheld a quarter at a time; their interval is at 95 %, "
        "from resampled blocks."
    ]
    proof, more = d.held_out, d.further_decoys
    if proof is not None:
        low, high = proof.gain_interval
        texts.append(
            f"Choice made anew for every part: {proof.split}. {proof.rmse_before:.3f} {push} before, "
            f"{proof.rmse_after:.3f} {push} after, gain {low:.3f} to {high:.3f} {push}."
        )
    gains = more.gains
    best = f"; none lowered the error on the withheld record by more than {percent(max(gains))}" if gains else ""
    texts.append(
        f"{more.tried} decoys (columns of the library, phases drawn at random) were offered after these terms: the "
        f"best brought evidence {more.most_evidence:.0f}, which a refinement must exceed{best}."
    )
    words, title = Text("\n\n".join(texts)), "Models and their errors"
    return Section("terms-models-section", title, (words, table, *low_passes_table(d)))


def _estimated(e: Estimate) -> tuple[Cell, ...]:
    white = None if math.isnan(e.whitened) else Measured(e.whitened, e.whitened_error)
    return (e.term, e.name, e.unit, Measured(e.value, e.standard_error), *e.interval, white)


def _parameters(d: TermsDiagnosis) -> Section:
    published = {(p.term, p.parameter): p.value for p in d.case.published}
    sets = [(f"{d.last_word} terms", d.steps[-1].fitted.estimates)]
    sets += [("refined", _last(d).fitted.estimates)] if d.refinements else []
    sets += [("beside the named", contest.given_named) for contest in d.contests]
    rows: list[tuple[Cell, ...]] = [
        (kind, *_estimated(e), published.get((e.term, e.name))) for kind, estimates in sets for e in estimates
    ]
    table = Table(
        "terms-parameters",
        "Parameters",
        "Least squares on thinned rows, noise of the acceleration allowed for, with intervals from leaving out blocks "
        "of neighbouring samples; and least squares on rows freed from serial correlation. The last lines give what a "
        "rival's own terms come to beside the named ones.",
        (
            Column("model", "Model"),
            Column("term", "Term"),
            Column("parameter", "Parameter"),
            Column("unit", "Unit"),
            Column("value", "Value", uncertain=True),
            Column("low", "from", format=".5g"),
            Column("high", "to", format=".5g"),
            Column("whitened", "Whitened"),
            Column("published", "Published", format=".6g"),
        ),
        tuple(rows),
    )
    swallowed = tuple((a.parameter, a.before, Measured(a.after, a.standard_error or math.nan)) for a in d.absorbed)
    absorbed = Table(
        "terms-absorbed",
        "What the baseline had absorbed",
        f"Parameters of the baseline alone, and fitted together with the {d.last_word} terms.",
        (Column("parameter", "Parameter"), Column("before", "Before", format=".5g"), Column("after", "After")),
        swallowed,
    )
    return Section("terms-parameters-section", "Parameters", (table, absorbed), (KUENSCH,))


def _search(d: TermsDiagnosis) -> Section:
    rows: list[tuple[Cell, ...]] = []
    for number, step in enumerate(d.naming.rounds if d.naming is not None else (), 1):
        for fit in step.ranking[:TERMS_SHOWN]:
            shape = None if fit.candidate.shape is None else fit.shape
            state = "entered" if fit.identifier in step.entered else ", ".join(fit.on_bound)
            note = f"{state} on its bound" if state and state != "entered" else state
            rows.append((number, titled(fit.candidate), fit.candidate.equation, fit.gain, fit.cost, shape, note))
    table = Table(
        "terms-ranking",
        "Ranking, round by round",
        "Fall of the whitened sum of squares by each term beside what was in already, in noise variances.",
        (
            Column("round", "Round"),
            Column("term", "Term"),
            Column("equation", "Equation"),
            Column("gain", "Gain", digits=0),
            Column("cost", "Cost", digits=0),
            Column("shape", "Shape", format=".4g"),
            Column("note", "Note"),
        ),
        tuple(rows),
    )
    return Section(
        "terms-search", "Search and rivals", (table, _rivals(d)), tuple(dict.fromkeys(t.source for t in d.case.library))
    )


def _rivals(d: TermsDiagnosis) -> Table:
    contests: list[tuple[Cell, ...]] = [
        (
            " and ".join(titled(fit.candidate) for fit in c.rival.fits),
            "open" if c.open else "beaten",
            c.lead,
            c.margin,
            c.held.rmse_before,
            c.held.rmse_after,
            100.0 * c.error_fit,
            100.0 * c.error_withheld,
        )
        for c in d.contests
    ]
    return Table(
        "terms-rivals",
        "Rivals",
        "Sets that came near, each against the named one with the refinements in both: a rival is beaten when the lead "
        "exceeds the margin (which what is left widens) and withheld blocks are predicted worse with certainty.",
        (
            Column("rival", "Rival"),
            Column("state", "State"),
            Column("lead", "Lead", digits=0),
            Column("margin", "Margin", digits=0),
            Column("blocks_rival", "Blocks, rival", d.case.axis.push, digits=3),
            Column("blocks_named", "Blocks, named", d.case.axis.push, digits=3),
            Column("error_fit", "Relative error of the rival", "%", digits=2),
            Column("error_withheld", "Withheld record", "%", digits=2),
        ),
        tuple(contests),
    )


def _limits(d: TermsDiagnosis) -> Section:
    at_rest = float(np.mean(d.recorded.motion.direction == 0.0))
    slow = float(np.mean(np.abs(d.recorded.motion.speed) < 1e-3 * float(np.abs(d.recorded.motion.speed).max())))
    rows: list[tuple[Cell, ...]] = []
    for twins in d.twins:
        what = "absorbed whole by the baseline" if len(twins.ids) == 1 else "the same column"
        names = " and ".join(title_of(d, name) for name in twins.ids)
        rows.append((names, what, twins.correlation, separating_test(d, twins.ids)))
    table = Table(
        "terms-twins",
        "What this recording cannot tell",
        "From the design of the recording alone, whatever the size.",
        (
            Column("terms", "Terms"),
            Column("why", "Why"),
            Column("correlation", "Correlation", format=".6f"),
            Column("test", "Test that would tell"),
        ),
        tuple(rows),
    )
    text = (
        f"The machine is at rest in {percent(at_rest)} of the samples, and slower than a thousandth of its top speed "
        f"in {percent(slow)}. {words_of_zero(d.case)}"
    )
    return Section("terms-limits", "What cannot be determined", (Text(text), table))

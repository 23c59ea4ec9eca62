"""The position or speed of a machine from its force alone: errors of each model, and how they grow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.free_run import measured
from pmg.pipeline.report.document import Chart, Column, Figure, Section, Series, Table, Text

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis


FURTHER = 1.1
"""Part of the error of a baseline from which on a named model drifts further."""


def free_run_sections(d: TermsDiagnosis) -> tuple[Section, ...]:
    """Each record simulated from its force alone; none where no model can be."""
    if not d.free_runs:
        return ()
    charts = []
    pushes, (first, *_) = d.case.axis.pushes, d.free_runs
    (shown, small), (what, span) = first.shown(d.case.axis), first.words
    for record in (one for whole in (d.recorded, d.withheld) if whole is not None for one in whole.each()):
        runs, every = [run for run in d.free_runs if run.record == record.name], d.recorded.keep_every
        off = [
            Series(
                run.model,
                record.motion.time[::every],
                (run.simulated - measured(record, of_speed=first.of_speed))[::every] / small,
                None,
                "line",
                colour,
            )
            for colour, run in enumerate(runs)
            if run.model != "baseline"
        ]
        charts.append(Chart("time [s]", f"simulated less measured [{shown}]", tuple(off), title=record.name))
    table = Table(
        "terms-free-runs",
        "Free run",
        f"Simulated less measured {what}. One step ahead every model is good; here errors add up.",
        (
            Column("model", "Parameters"),
            Column("record", "Record"),
            Column("rms", "Root mean square", shown, format=".3g"),
            Column("largest", "Largest", shown, format=".3g"),
            Column(span, span.capitalize(), shown, format=".3g"),
        ),
        tuple((r.model, r.record, r.error / small, r.largest / small, r.span / small) for r in d.free_runs),
    )
    ends = "" if first.of_speed else f", so that an offset which the {pushes} lacks ends as a drift"
    text = (
        f"The {what} is simulated from the {pushes}, the first position and the first speed; no later sample "
        f"corrects it{ends}. Parameters were fitted to the "
        f"{pushes} of the first record, not to this error; no uncertainty is stated for it.{_further_off(d)}"
    )
    figure = Figure("terms-free-run", "Free run", "Without the baseline.", tuple(charts))
    return (
        Section("terms-free-run-section", f"{what.capitalize()} from the {pushes} alone", (Text(text), table, figure)),
    )


def _further_off(d: TermsDiagnosis) -> str:
    """A sentence where what is named drifts further than the baseline in some records; else empty."""
    error = {(run.model, run.record): run.error for run in d.free_runs}
    both = [
        (error["baseline", name], of)
        for (model, name), of in error.items()
        if model == "named" and ("baseline", name) in error
    ]
    further = sum(of > FURTHER * baseline for baseline, of in both)
    if not further:
        return ""
    return (
        f" In {further} of {len(both)} records the named model drifts further than the baseline: over a long record a "
        "small error that nothing corrects may outweigh all else. The verdict rests on "
        f"{d.case.axis.pushes} that was withheld, not on this."
    )

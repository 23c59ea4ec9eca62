"""The next runs of a campaign in motion for the bench: a page to tick, and the references of the drives as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.commands.at_bench.page_frame import SHEET_STYLE, as_html, framed
from pmg.pipeline.diagnosis.balance.catalogue import TermSet
from pmg.pipeline.diagnosis.motion.design.proposed_run import CHANGE_S
from pmg.pipeline.diagnosis.motion.design.remedy import telling_runs
from pmg.pipeline.diagnosis.motion.design.torque_apart import torque_apart
from pmg.pipeline.diagnosis.motion.statement import causes
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS
from pmg.pipeline.wording.numerals import number
from pmg.pipeline.wording.plurals import counted, uncapitalised
from pmg.sim.shafts import SIDES
from pmg.sim.signals import MINUTE, RESIDUAL, RPM

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun
    from pmg.pipeline.diagnosis.motion.design.proposed_run import ProposedRun, Reference
    from pmg.sim.signals import Array

COURSE_HZ = 100.0
"""Rate at which the references stand in the CSV: a sweep ends at 25 Hz."""

UNITS = {"speed": ("rpm", RPM), "torque": ("Nm", 1.0)}
"""Unit of a reference in the CSV, and what one is in SI."""


@dataclass(frozen=True)
class SheetRun:
    """A run to make.

    Parameters
    ----------
    after : float
        When it begins after the first one [min].
    run : ProposedRun
        With the references of its drives.
    gear : int
        The gear.
    apart : dict of str to float
        Root mean square by which the torques of the leading cause and of the nearest rival differ in it, by shaft
        [N m], or what a cause to be confirmed makes; empty where there is no rival.
    """

    after: float
    run: ProposedRun
    gear: int
    apart: dict[str, float]


@dataclass(frozen=True)
class MotionSheet:
    """Runs for the bench.

    Parameters
    ----------
    campaign : str
        The campaign whose question they answer.
    tests : tuple of (str, str)
        Of each test what to run, and what it tells with which power.
    runs : tuple of SheetRun
        The runs in their order.
    confirms : bool
        Whether they confirm a cause that is named.
    """

    campaign: str
    tests: tuple[tuple[str, str], ...]
    runs: tuple[SheetRun, ...]
    confirms: bool = False

    @property
    def minutes(self) -> float:
        """Time on the bench, changes included [min]."""
        return sum(each.run.seconds + CHANGE_S for each in self.runs) / MINUTE


def motion_sheet(diagnosis: MotionDiagnosis) -> MotionSheet:
    """The runs that a diagnosis asks for, each test once, or the one that confirms it; none where it asks for none."""
    confirming = () if diagnosis.confirming is None else (diagnosis.confirming,)
    tests, rows, after = [], [], 0.0
    gear = diagnosis.before.stretches[0].run.run.gear
    for test in confirming or telling_runs(diagnosis):
        tests.append((test.title, f"{_question(diagnosis, test)} Power {test.power:.0%}."))
        apart = {run: _apart(diagnosis, test, run) for run in dict.fromkeys(test.runs)}
        for run in test.runs:
            rows.append(SheetRun(after / MINUTE, run, gear, apart[run]))
            after += run.seconds + CHANGE_S
    return MotionSheet(diagnosis.campaign, tuple(tests), tuple(rows), bool(confirming))


def _question(diagnosis: MotionDiagnosis, test: NextRun) -> str:
    """What a test tells."""
    if diagnosis.naming is not None and test is diagnosis.confirming:
        return f"Confirms {causes(diagnosis.naming.best)}."
    if diagnosis.naming is not None and test.rivals:
        others = "; or from ".join(causes(TermSet(fits, diagnosis.evidence.problem)) for fits in test.rivals)
        return f"Tells {causes(diagnosis.naming.best)} from {others}."
    blind = (each.term for each in diagnosis.unseen if each.term.identifier in test.separates)
    shown = dict.fromkeys(f"{uncapitalised(term.title)}{SHAFT_WORDS[term.shaft]}" for term in blind)
    return f"Shows what the campaign cannot see: {'; '.join(shown)}."


def _apart(diagnosis: MotionDiagnosis, test: NextRun, run: ProposedRun) -> dict[str, float]:
    """How far the torque of the leading cause lies from that of the nearest rival, by shaft [N m]."""
    if diagnosis.naming is None or not test.rivals:
        return {}
    best = diagnosis.naming.best.fits
    of_rivals = torque_apart(diagnosis.evidence, run, best, test.rivals)
    return min(of_rivals, key=lambda each: max(each.values()))


def references_csv(sheet: MotionSheet) -> str:
    """What the drives are asked for, `COURSE_HZ` times a second; a shaft that turns in no way is held at 0 rpm."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n")
    columns = [(side, quantity) for side in SIDES for quantity in UNITS]
    heads = [f"{side}_{quantity}_{UNITS[quantity][0]}" for side, quantity in columns]
    write.writerow(["run", "configuration", "gear", "manoeuvre", "after_min", "time_s", *heads])
    for place, row in enumerate(sheet.runs, 1):
        time, asked = row.run.times(COURSE_HZ), _asked(row.run)
        courses = [_course(asked.get(side), side, quantity, time) for side, quantity in columns]
        setting = [place, str(row.run.configuration), row.gear, str(row.run.manoeuvre), f"{row.after:.2f}"]
        for k, t in enumerate(time):
            write.writerow([*setting, f"{t:.2f}", *(course[k] for course in courses)])
    return text.getvalue()


def _asked(run: ProposedRun) -> dict[str, Reference]:
    """References of a run by shaft."""
    return {each.side: each for each in (run.speed, run.load) if each is not None}


def _course(reference: Reference | None, side: str, quantity: str, time: Array) -> list[str]:
    """Column of a shaft: what it is asked for, nothing in the other quantity."""
    if reference is None:
        return ["0" if quantity == "speed" else ""] * len(time)
    if reference.quantity != quantity:
        return [""] * len(time)
    return [f"{value:.4f}" for value in reference.course(time) / UNITS[quantity][1]]


def motion_page(sheet: MotionSheet) -> str:
    """The sheet as a page to print: it loads nothing and holds no script."""
    tests = "".join(f"<li><b>{as_html(title)}</b>: {as_html(question)}</li>" for title, question in sheet.tests)
    rows = "".join(_row(place, row) for place, row in enumerate(sheet.runs, 1))
    together = "ingest them into the same campaign: 'pmg run' judges all runs together"
    alone = "judge them alone, with the cause: 'pmg run FOLDER --store NEW --report REPORT --model model.toml'"
    then, apart = (alone, "that the cause makes") if sheet.confirms else (together, "by which causes differ")
    head = "The cause makes" if sheet.confirms else "Causes differ by"
    body = f"""
<h1>Next runs of {as_html(sheet.campaign)}</h1>
<p>{counted(len(sheet.runs), "run")}, {sheet.minutes:.0f} min with {CHANGE_S:.0f} s between them.</p>
<ul>{tests}</ul>
<p>Make the runs in this order, in the set-up of the campaign, and record each into a file of its own. next.csv has what
the drives are asked for, {COURSE_HZ:.0f} times a second; a shaft without a reference is held. Then {then}. A torque
{apart} is that of the whole run, rms, before the constants are fitted anew.</p>
<p>Date <span class="line"></span> Name <span class="line"></span> Room temperature <span class="line"></span></p>
<table><thead><tr><th>#</th><th>After<br>min</th><th>Takes<br>s</th><th>Configuration</th><th>Manoeuvre</th>
<th>References of the drives</th><th>{head}<br>{RESIDUAL.display_unit}</th><th>File</th><th>Done</th></tr>
</thead><tbody>{rows}</tbody></table>
"""
    return framed(f"Next runs: {sheet.campaign}", body, f"{SHEET_STYLE}td.write{{min-width:8rem}}")


def _row(place: int, row: SheetRun) -> str:
    run = row.run
    set_to = str(run.configuration) if run.load is None else f"{run.configuration}, gear {row.gear}"
    asked = "<br>".join(as_html(each.words) for each in _asked(run).values()) or "both shafts at rest"
    apart = "<br>".join(f"{side} {number(float(RESIDUAL.display(size)), 1)}" for side, size in row.apart.items())
    return (
        f"<tr><td>{place}</td><td>{number(row.after, 1)}</td><td>{run.seconds:.0f}</td><td>{as_html(set_to)}</td>"
        f"<td>{as_html(run.manoeuvre)}</td><td>{asked}</td><td>{apart or '–'}</td><td class=write></td>"
        f'<td><span class="box"></span></td></tr>'
    )

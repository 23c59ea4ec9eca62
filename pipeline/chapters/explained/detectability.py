"""Chapter on the design: what a campaign can see, what it cannot, and what looks alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.design.audit import ALIKE, RESEMBLING
from pmg.pipeline.report.document import Column, Section, Table, Text
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.design.audit import Audit, LookAlike
    from pmg.pipeline.report.table import Cell


def audit_section(audit: Audit) -> Section:
    """The two tables of an audit."""
    items: list[Text | Table] = [
        Text(
            "The calibrated baseline takes up part of every effect: curves of each shaft's own speed, the correction "
            "factor and the damping constants bend to follow it. What is left decides whether it can be seen, and "
            "with which others it can be confused. No reading takes part in this."
        ),
        _visible(audit),
    ]
    if audit.alike:
        items.append(_alike(audit))
    if audit.resembling:
        items.append(_apart(audit))
    return Section("design", "Detectability of effects", tuple(items))


def _visible(audit: Audit) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            row.candidate.kind.title,
            row.candidate.shaft,
            100.0 * row.absorbed,
            None if row.unseen else row.size_50 * 1e3,
            None if row.unseen else row.size_95 * 1e3,
        )
        for row in audit.visible
    ]
    unseen = sum(row.unseen for row in audit.visible)
    return Table(
        "visibility",
        "What can be seen",
        f"{len(rows) - unseen} of {len(rows)} entries of the catalogue can be seen by these points; sizes are root "
        "mean square effects, before anything is absorbed, that are detected with 50 and 95 % power. Empty: not at "
        "any size.",
        (
            Column("mechanism", "Mechanism"),
            Column("shaft", "Shaft"),
            Column("absorbed", "Absorbed by the baseline", "%", digits=1),
            Column("size_50", "Detected in half the cases", "mN m", digits=2),
            Column("size_95", "Detected in 95 %", "mN m", digits=2),
        ),
        tuple(rows),
    )


def _alike(audit: Audit) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            *_named(pair),
            pair.correlation,
            "none of those known" if pair.plan is None else pair.plan.description,
            None if pair.plan is None else pair.plan.seconds / MINUTE,
            None if pair.plan is None else 100.0 * pair.power,
        )
        for pair in audit.alike
    ]
    return Table(
        "look-alikes",
        "Effects this test cannot separate",
        f"Effects this test cannot separate (correlation {ALIKE:g} or more): {len(rows)} "
        f"pair{'s' if len(rows) > 1 else ''}. The last columns give the test that separates them when the effect is "
        "three times what half the campaigns detect.",
        (
            Column("one", "This"),
            Column("other", "looks like"),
            Column("correlation", "Correlation", "", digits=3),
            Column("test", "Separating test"),
            Column("minutes", "Time", "min", digits=0),
            Column("power", "Power at that size", "%", digits=0),
        ),
        tuple(rows),
    )


def _apart(audit: Audit) -> Table:
    return Table(
        "told-apart",
        "Effects that look similar and can be separated",
        f"{len(audit.resembling)} pair{'s' if len(audit.resembling) > 1 else ''} between {RESEMBLING:g} and {ALIKE:g}: "
        "these points tell them apart once the effect is large enough. What is in neither table correlates less.",
        (
            Column("one", "This"),
            Column("other", "resembles"),
            Column("correlation", "Correlation", "", digits=3),
        ),
        tuple((*_named(pair), pair.correlation) for pair in audit.resembling),
    )


def _named(pair: LookAlike) -> tuple[str, str]:
    return f"{pair.one.kind.title} ({pair.one.shaft})", f"{pair.other.kind.title} ({pair.other.shaft})"

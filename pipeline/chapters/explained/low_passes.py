"""The choice of the low-pass: what the search of a machine's terms names with half of it, and with twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.balance.causes import size_of
from pmg.pipeline.diagnosis.balance.low_pass_told import said_with
from pmg.pipeline.diagnosis.balance.titles import titles_of
from pmg.pipeline.report.document import Cell, Column, Table

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis


def low_passes_table(d: TermsDiagnosis) -> tuple[Table, ...]:
    """What the search names with other low-passes; none where they were not tried."""
    rows: list[tuple[Cell, ...]] = [
        (
            each.low_pass_hz,
            each.keep_every,
            each.p_value,
            titles_of(each.fits) or "–",
            "; ".join(size_of(e.name, e.value, e.standard_error, e.unit) for e in each.sizes) or "–",
            said_with(d, each),
        )
        for each in d.low_passes
    ]
    table = Table(
        "terms-low-passes",
        "Other low-passes",
        f"The search made anew on the fitted recordings with half the low-pass of {d.case.prepare.low_pass_hz:g} Hz "
        "and with twice; no proof was made of it. Too low, it rounds off what tells terms apart; too high, it lets in "
        "resonances that no term describes.",
        (
            Column("low_pass", "Low-pass", "Hz", format=".4g"),
            Column("keep_every", "Kept, one in"),
            Column("p_value", "p-value", format=".2g"),
            Column("terms", "Terms found"),
            Column("sizes", "Their sizes"),
            Column("beside", "Compared with the verdict"),
        ),
        tuple(rows),
    )
    return (table,) if rows else ()

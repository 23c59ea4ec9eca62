"""The validation as lines for people and as JSON."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any

from pmg.pipeline.fit.document import number
from pmg.pipeline.thesis_figures.figures import MANY
from pmg.pipeline.thesis_figures.verdict import FigureVerdict, JudgedFigure, count
from pmg.pipeline.wording.plurals import counted

if TYPE_CHECKING:
    from collections.abc import Iterable

HEADINGS = ("figure", "published", "ours", "interval", "unit", "verdict")
"""Columns of the table; a number in brackets after a verdict refers to the remarks below it."""


def _digits(judged: JudgedFigure) -> tuple[str, str, str]:
    """Ours and the ends of its interval, one decimal finer than printed."""
    places = max(judged.figure.decimals + 1, 0)
    ours, low, high = (f"{value:.{places}f}" for value in (judged.ours, judged.low, judged.high))
    return ours, low, high


def judged_words(judged: JudgedFigure) -> str:
    """The verdict, with the distance where it is what matters."""
    if judged.verdict is FigureVerdict.NOT_EXPLAINED:
        return f"{judged.verdict} ({judged.distance:+.1f})"
    return str(judged.verdict)


def table_lines(judged: tuple[JudgedFigure, ...]) -> list[str]:
    """The table as aligned text, the many figures of one kind summed up, remarks below."""
    remarks: dict[str, int] = {}
    rows: list[tuple[str, ...]] = [HEADINGS]
    for group, members in groupby(judged, key=lambda j: j.figure.group):
        if group in MANY:
            rows.append(_summed_up(tuple(members), remarks))
            continue
        for j in members:
            ours, low, high = _digits(j)
            verdict = judged_words(j) + _reference(j, remarks)
            rows.append((j.figure.what, j.figure.text, ours, f"{low} .. {high}", j.figure.unit.name, verdict))
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    right = (False, True, True, True, False, False)
    lines = [
        "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in rows
    ]
    lines.insert(1, "-" * max(map(len, lines)))
    return [*lines, "", *(f"[{n}] {text}" for text, n in remarks.items())]


def _reference(judged: JudgedFigure, known: dict[str, int]) -> str:
    """Numbers of the remarks on a figure; a new remark gets the next one."""
    numbers = [str(known.setdefault(text, len(known) + 1)) for text in judged.remarks]
    return f" [{', '.join(numbers)}]" if numbers else ""


def _summed_up(members: tuple[JudgedFigure, ...], remarks: dict[str, int]) -> tuple[str, ...]:
    furthest = max(members, key=lambda j: abs(j.distance))
    states = ", ".join(f"{n} {verdict}" for verdict, n in count(members).items() if n)
    ours, low, high = _digits(furthest)
    what = furthest.figure.what
    return (
        f"{len(members)} sun torques, furthest: {what.removeprefix('sun torque at ')}",
        furthest.figure.text,
        ours,
        f"{low} .. {high}",
        furthest.figure.unit.name,
        states + _reference(furthest, remarks),
    )


def summary(judged: Iterable[JudgedFigure]) -> str:
    """Counts of figures by verdict, as a sentence."""
    all_ = tuple(judged)
    parts = [f"{n} {verdict}" for verdict, n in count(all_).items() if n]
    return f"{len(all_)} published figures: {', '.join(parts)}"


def failed_draws(judged: Iterable[JudgedFigure]) -> str:
    """That draws gave no figures, as a sentence; empty where all did."""
    failed = max((j.failed for j in judged), default=0)
    return f"{counted(failed, 'draw')} gave no figures, as a fit or a run did not settle." if failed else ""


def documents(judged: tuple[JudgedFigure, ...]) -> list[dict[str, Any]]:
    """One object a figure, in the unit as printed; an open end is null."""
    return [
        {
            "id": j.figure.id,
            "what": j.figure.what,
            "source": j.figure.source.citation,
            "printed": j.figure.text,
            "published": _claim(j),
            "decimals": j.figure.decimals,
            "ours": number(j.ours),
            "low": number(j.low),
            "high": number(j.high),
            "unit": j.figure.unit.name or "1",
            "verdict": str(j.verdict),
            "distance_half_widths": number(j.distance),
            "also_stated": None
            if j.figure.other is None
            else {"value": j.figure.other.value, "place": j.figure.other.place},
            "remark": " ".join(j.remarks),
        }
        for j in judged
    ]


def _claim(judged: JudgedFigure) -> float | list[float | None]:
    figure = judged.figure
    if figure.until is None:
        return figure.value
    return [None if math.isinf(v) else v for v in (figure.value, figure.until)]

"""The page of a watched campaign: its grid as it fills, rejected recordings, cross-checks, the first mismatch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.commands.at_bench.page_frame import as_html, framed
from pmg.pipeline.commands.at_bench.watched import PointState
from pmg.pipeline.wording.numerals import number
from pmg.pipeline.wording.plurals import counted
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pmg.pipeline.commands.at_bench.watched import WatchedCampaign, WatchedPoint

SIGNS = {
    PointState.MEASURED: ("measured", "●"),
    PointState.AGREES: ("agrees", "✓"),
    PointState.DIFFERS: ("differs", "✗"),
    PointState.REJECTED: ("rejected", "!"),
}
"""Class and sign of a point's cell; the sign says it without the colour."""

MOST = 12
"""Findings that are listed; the others are counted."""

STYLE = """
body{font-size:15px;line-height:1.5;max-width:76rem}
h1{font-size:1.35rem;margin:0}h2{font-size:1.05rem;margin:1.4rem 0 .4rem}p{margin:.3rem 0}
.state{padding:.7rem 1rem;border-left:.35rem solid var(--good);background:var(--good-soft)}
.state.attention{border-color:var(--attention);background:var(--attention-soft)}
.grids{display:flex;flex-wrap:wrap;gap:0 2.5rem}
th{font-weight:400;color:var(--muted);font-size:.8rem;padding:.1rem .35rem;text-align:right}
td{width:2.1rem;height:1.7rem;text-align:center;border:1px solid var(--rule);color:var(--muted)}
td.measured{background:var(--soft);color:var(--ink)}td.agrees{background:var(--good-soft);color:var(--good)}
td.differs,td.rejected{background:var(--attention-soft);color:var(--attention);font-weight:700}
li{margin:.15rem 0}.cell{display:inline-block;min-width:1.4rem;text-align:center}
"""


def watch_page(state: WatchedCampaign, waiting: Sequence[str], at: str, every: int) -> str:
    """The page as HTML; it asks for nothing but itself anew.

    Parameters
    ----------
    state : WatchedCampaign
        The campaign as far as it has come.
    waiting : sequence of str
        Recordings that are still being written.
    at : str
        Time of day of this state.
    every : int
        Time after which the browser asks again [s].
    """
    title = f"{state.name or 'No campaign yet'}: {counted(len(state.points), 'point')}"
    parts = [
        f"<h1>{as_html(title)}</h1>",
        f'<p class="muted">{as_html(counted(state.recordings, "recording"))}, as of {as_html(at)}; '
        f"this page asks again every {every} s. {as_html(state.simulation)}</p>",
        _verdict(state),
        _grids(state.points),
        _list("Still being written", waiting),
        _list("Recordings that cannot be used", (f"{name}: {why}" for name, why in state.unusable)),
        _list("Rejected points", (f"{p.name}: {p.why}" for p in state.points if p.state is PointState.REJECTED)),
        _list("Cross-checks", (f"{one.place}: {one.message}" for one in state.remarks)),
        _list("Beyond tolerance", (f"{p.name}: {p.why}" for p in state.points if p.state is PointState.DIFFERS)),
    ]
    return framed(title, "".join(parts), STYLE, every)


def _verdict(state: WatchedCampaign) -> str:
    """What needs attention first, in one box."""
    rejected = sum(point.state is PointState.REJECTED for point in state.points)
    bad = len(state.unusable) + rejected + len(state.remarks)
    if state.first_mismatch:
        words = f"First mismatch with the simulation at {state.first_mismatch}."
    elif bad:
        words = f"Look at {counted(bad, 'finding')} below before the test goes on."
    else:
        words = "Nothing needs attention so far."
    return f'<p class="state{" attention" if state.first_mismatch or bad else ""}">{as_html(words)}</p>'


def _grids(points: Sequence[WatchedPoint]) -> str:
    kinds = [kind for kind in Configuration if any(point.kind == kind for point in points)]
    key = " ".join(f'<span class="cell">{sign}</span>{as_html(state)}&ensp;' for state, (_, sign) in SIGNS.items())
    drawn = "".join(_grid(kind, [point for point in points if point.kind == kind]) for kind in kinds)
    return f'<div class="grids">{drawn}</div><p class="muted">{key}</p>' if drawn else ""


def _grid(kind: str, points: Sequence[WatchedPoint]) -> str:
    """A table of one configuration: a cell for each pair of levels, the worst of its points in it."""
    across = sorted({round(point.across) for point in points})
    along = sorted({round(point.along, 2) for point in points})
    order = list(PointState)
    cells: dict[tuple[float, float], WatchedPoint] = {}
    for point in points:
        key = round(point.across), round(point.along, 2)
        if key not in cells or order.index(point.state) > order.index(cells[key].state):
            cells[key] = point
    head = "".join(f"<th>{number(x)}</th>" for x in across)
    rows = "".join(f"<tr><th>{number(y)}</th>{''.join(_cell(cells.get((x, y))) for x in across)}</tr>" for y in along)
    what = "load [N m]" if kind == Configuration.ENGAGED else "ring [rpm]"
    table = f"<table><tr><th>{what} \\ sun [rpm]</th>{head}</tr>{rows}</table>"
    return f"<section><h2>{as_html(kind.capitalize())}</h2>{table}</section>"


def _cell(point: WatchedPoint | None) -> str:
    if point is None:
        return "<td></td>"
    name, sign = SIGNS[point.state]
    return f'<td class="{name}" title="{as_html(f"{point.name}: {point.why or point.state}")}">{sign}</td>'


def _list(title: str, entries: Iterable[str]) -> str:
    found = list(entries)
    if not found:
        return ""
    shown = "".join(f"<li>{as_html(entry)}</li>" for entry in found[-MOST:])
    more = f'<p class="muted">The last {MOST} of {len(found)}.</p>' if len(found) > MOST else ""
    return f"<h2>{as_html(title)}</h2><ul>{shown}</ul>{more}"

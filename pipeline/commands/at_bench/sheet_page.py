"""The sheet of a test for the bench: points in order, the band of each cause, and boxes to tick; as page and as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from html import escape

from pmg.pipeline.report.theme import DARK, FONTS, LIGHT, variables
from pmg.pipeline.wording.numerals import number
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.safe_text import printable
from pmg.sim.signals import RESIDUAL

SHEET_POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
LETTERS = "ABCDEFGH"
"""Names of the causes in the columns."""

STYLE = """
body{font:13px/1.4 var(--fonts);color:var(--ink);background:var(--paper);margin:0 auto;max-width:72rem;padding:1rem}
h1{font-size:1.3rem;margin:0 0 .2rem}p,ul{margin:.25rem 0}ul{padding-left:1.2rem}.muted{color:var(--muted)}
table{border-collapse:collapse;width:100%;margin-top:.5rem}th,td{border:1px solid var(--rule);padding:.16rem .4rem}
th{font-weight:600;text-align:right;vertical-align:bottom;background:var(--soft)}td{text-align:right;white-space:nowrap}
th.words,td.words{text-align:left}td.write{min-width:4.5rem}tr.tells td{font-weight:700}tr{break-inside:avoid}
.box{display:inline-block;width:.8em;height:.8em;border:1px solid var(--ink);vertical-align:-.08em;margin:0 .1em 0 .4em}
.line{display:inline-block;min-width:9rem;border-bottom:1px solid var(--ink)}thead{display:table-header-group}
@page{size:A4 landscape;margin:11mm}
@media print{body{font-size:9.5px;padding:0;max-width:none}h1{font-size:14px}th,td{padding:.1rem .3rem}}
"""


@dataclass(frozen=True)
class SheetRow:
    """A point to run.

    Parameters
    ----------
    after, seconds : float
        When it begins after the first point [min], and the bench time it takes [s].
    configuration, drive, gear : str, str, int
        How the bench is set.
    sun, ring : float
        Speeds to set [rpm].
    load : float or None
        Ring torque to ask for [N m]; None in neutral.
    signal : str
        The torque to read: that which tells the causes apart best at this point.
    bands : tuple of (float, float)
        Lower and upper end of the reading to be expected under each cause, at U = 2u [N m].
    tells : bool
        Whether the bands lie apart, so that this reading alone speaks for one of them.
    """

    after: float
    seconds: float
    configuration: str
    drive: str
    gear: int
    sun: float
    ring: float
    load: float | None
    signal: str
    bands: tuple[tuple[float, float], ...]
    tells: bool


@dataclass(frozen=True)
class BenchSheet:
    """A test for the bench.

    Parameters
    ----------
    campaign : str
        The campaign whose question it answers.
    title, question : str
        What to run, and what it tells.
    causes : tuple of str
        What may be there, in the order of the bands.
    power : float
        Probability that the whole test tells them apart, or shows what it looks for.
    minutes : float
        Bench time, pauses included [min].
    rows : tuple of SheetRow
        The points in their order.
    """

    campaign: str
    title: str
    question: str
    causes: tuple[str, ...]
    power: float
    minutes: float
    rows: tuple[SheetRow, ...]


def sheet_csv(sheet: BenchSheet) -> str:
    """The points as CSV, units in the headings, torques in N m."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n")
    bands = [f"{end}_{letter}_Nm" for letter, _ in zip(LETTERS, sheet.causes, strict=False) for end in ("low", "high")]
    head = ["point", "after_min", "duration_s", "configuration", "gear", "drive", "sun_rpm", "ring_rpm", "load_Nm"]
    write.writerow([*head, "read", *bands, "tells_alone"])
    for i, row in enumerate(sheet.rows, start=1):
        load = "" if row.load is None else f"{row.load:.4g}"
        ends = [f"{end:.5f}" for band in row.bands for end in band]
        place = [i, f"{row.after:.2f}", f"{row.seconds:g}", row.configuration, row.gear, row.drive]
        speeds = [f"{row.sun:.1f}", f"{row.ring:.1f}", load]
        write.writerow([*place, *speeds, row.signal, *ends, "yes" if row.tells else "no"])
    return text.getvalue()


def sheet_page(sheet: BenchSheet) -> str:
    """The sheet as a page to print: it loads nothing and holds no script."""
    letters = LETTERS[: len(sheet.causes)]
    listed = "".join(f"<li><b>{x}</b>: {_text(words)}</li>" for x, words in zip(letters, sheet.causes, strict=True))
    heads = "".join(f"<th>{x}: {RESIDUAL.display_unit}<br>from … to</th>" for x in letters)
    rows = "".join(_row(i, row, letters) for i, row in enumerate(sheet.rows, start=1))
    telling = sum(row.tells for row in sheet.rows)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{SHEET_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>Next test: {_text(sheet.campaign)}</title>
<style>:root{{{variables(LIGHT)} --fonts:{FONTS};color-scheme:light dark}}
@media screen and (prefers-color-scheme:dark){{:root{{{variables(DARK)}}}}}{STYLE}</style></head><body>
<h1>Next test of {_text(sheet.campaign)}: {_text(sheet.title)}</h1>
<p>{_text(sheet.question)} {counted(len(sheet.rows), "point")}, {sheet.minutes:.0f} min of bench time; power of the
whole test {100.0 * sheet.power:.0f} %.</p>
<ul>{listed}</ul>
<p>Set the points in this order. Read the torque named: the mean of a steady window of 5 s, tare subtracted.
Tick the band that holds the reading; a band is the prediction ± U = 2u of one reading
in the set-up of the campaign: zeros that moved since are not in it, so repeat one of its points first.
{_telling(telling, len(letters))}</p>
<p>Date <span class="line"></span> Name <span class="line"></span> Room temperature <span class="line"></span>
Tare sun, ring <span class="line"></span></p>
<table><thead><tr><th>#</th><th>After<br>min</th><th>Takes<br>s</th><th class="words">Configuration</th>
<th class="words">Driving</th><th>Sun<br>rpm</th><th>Ring<br>rpm</th><th>Load<br>N m</th><th class="words">Read</th>
{heads}<th>Reading<br>{RESIDUAL.display_unit}</th><th class="words">Inside</th></tr></thead>
<tbody>{rows}</tbody></table>
</body></html>
"""


def _telling(count: int, causes: int) -> str:
    if causes < 2:
        return ""
    if not count:
        return "No point tells by itself: run them all, then 'pmg run' judges them together."
    return f"Bold: {counted(count, 'point')} where the bands lie apart; each of them can tell alone."


def _row(place: int, row: SheetRow, letters: str) -> str:
    def torque(value: float) -> str:
        return number(float(RESIDUAL.display(value)), 1)

    bands = "".join(f"<td>{torque(low)} … {torque(high)}</td>" for low, high in row.bands)
    boxes = "".join(f'<span class="box"></span>{x}' for x in letters) + '<span class="box"></span>none'
    load = "–" if row.load is None else number(row.load, 2)
    gear = f"{row.configuration}, gear {row.gear}" if row.load is not None else row.configuration
    return (
        f"<tr{' class=tells' if row.tells else ''}><td>{place}</td><td>{number(row.after, 1)}</td>"
        f'<td>{row.seconds:.0f}</td><td class="words">{_text(gear)}</td><td class="words">{_text(row.drive)}</td>'
        f"<td>{number(row.sun, 0)}</td><td>{number(row.ring, 0)}</td><td>{load}</td>"
        f'<td class="words">{_text(row.signal)}</td>{bands}<td class="write"></td><td class="words">{boxes}</td></tr>'
    )


def _text(words: object) -> str:
    return escape(printable(str(words)))

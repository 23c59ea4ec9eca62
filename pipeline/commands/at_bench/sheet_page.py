"""The sheet of a test for the bench: points in order, the band of each cause, and boxes to tick; as page and as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from string import ascii_uppercase

from pmg.pipeline.commands.at_bench.page_frame import SHEET_STYLE, as_html, framed
from pmg.pipeline.wording.numerals import number
from pmg.pipeline.wording.plurals import counted
from pmg.sim.signals import RESIDUAL

MOST_CAUSES = 6
"""Causes whose bands the width of a page holds; those of the others are in the CSV."""

USUAL, SMALLEST = 9.5, 7.5
"""Sizes of printed letters [px]."""

HIGH, ABOVE, WIDE, BESIDE, OF_CAUSE = 37.0, 9.0, 1034.0, 530.0, 128.0
"""At the usual size: lines of a page and of what stands above the points; width of a page, of what stands beside the
bands, and of a cause with its band and box [px]."""

STYLE = """
ul{columns:30rem auto}th,td{text-align:right}td{white-space:nowrap}th.words,td.words{text-align:left}
td.write{min-width:4.5rem}tr.tells td{font-weight:700}.box{margin:0 .1em 0 .4em}@media print{th,td{padding:.2em .45em}}
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
    bands = [f"{end}_{letter}_Nm" for letter in _letters(len(sheet.causes)) for end in ("low", "high")]
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
    shown = sheet.causes[:MOST_CAUSES]
    letters = _letters(len(shown))
    listed = "".join(f"<li><b>{x}</b>: {as_html(words)}</li>" for x, words in zip(letters, shown, strict=True))
    more = len(sheet.causes) - len(shown)
    further = f"<p>{counted(more, 'further possible cause')}: see the bands in next.csv.</p>" if more else ""
    heads = "".join(f"<th>{x}: {RESIDUAL.display_unit}<br>from … to</th>" for x in letters)
    rows = "".join(_row(i, row, letters) for i, row in enumerate(sheet.rows, start=1))
    telling = sum(row.tells for row in sheet.rows)
    body = f"""
<h1>Next test of {as_html(sheet.campaign)}: {as_html(sheet.title)}</h1>
<p>{as_html(sheet.question)} {counted(len(sheet.rows), "point")}, {sheet.minutes:.0f} min of bench time; power of the
whole test {100.0 * sheet.power:.0f} %.</p>
<ul>{listed}</ul>{further}
<p>Set the points in this order. Read the torque named: the mean of a steady window of 5 s, tare subtracted.
Tick the band that holds the reading; a band is the prediction ± U = 2u of one reading
in the set-up of the campaign: zeros that moved since are not in it, so repeat one of its points first.
{_telling(telling, len(sheet.causes))}</p>
<p>Date <span class="line"></span> Name <span class="line"></span> Room temperature <span class="line"></span>
Tare sun, ring <span class="line"></span></p>
<table><thead><tr><th>#</th><th>After<br>min</th><th>Takes<br>s</th><th class="words">Configuration</th>
<th class="words">Driving</th><th>Sun<br>rpm</th><th>Ring<br>rpm</th><th>Load<br>N m</th><th class="words">Read</th>
{heads}<th>Reading<br>{RESIDUAL.display_unit}</th><th class="words">Inside</th></tr></thead>
<tbody>{rows}</tbody></table>
"""
    size = f":root{{--letters:{_letter_size(len(sheet.rows), len(shown)):.2f}px}}"
    return framed(f"Next test: {sheet.campaign}", body, f"{size}{SHEET_STYLE}{STYLE}")


def _letters(causes: int) -> list[str]:
    """Names of the causes in the columns: A to Z, then AA and so on."""

    def name(i: int) -> str:
        return (name(i // 26 - 1) if i >= 26 else "") + ascii_uppercase[i % 26]

    return [name(i) for i in range(causes)]


def _letter_size(rows: int, causes: int) -> float:
    """Size of printed letters [px] at which a page holds the points with their bands; more points go on overleaf."""
    down, across = HIGH / (ABOVE + rows + 0.4 * causes), WIDE / (BESIDE + OF_CAUSE * causes)
    return max(SMALLEST, USUAL * min(1.0, down, across))


def _telling(count: int, causes: int) -> str:
    if causes < 2:
        return ""
    if not count:
        return "No point tells by itself: run them all, then 'pmg run' judges them together."
    return f"Bold: {counted(count, 'point')} where the bands lie apart; each of them can tell alone."


def _row(place: int, row: SheetRow, letters: list[str]) -> str:
    def torque(value: float) -> str:
        return number(float(RESIDUAL.display(value)), 1)

    bands = "".join(f"<td>{torque(low)} … {torque(high)}</td>" for low, high in row.bands[: len(letters)])
    boxes = "".join(f'<span class="box"></span>{x}' for x in letters) + '<span class="box"></span>none'
    load = "–" if row.load is None else number(row.load, 2)
    gear = f"{row.configuration}, gear {row.gear}" if row.load is not None else row.configuration
    return (
        f"<tr{' class=tells' if row.tells else ''}><td>{place}</td><td>{number(row.after, 1)}</td>"
        f'<td>{row.seconds:.0f}</td><td class="words">{as_html(gear)}</td><td class="words">{as_html(row.drive)}</td>'
        f"<td>{number(row.sun, 0)}</td><td>{number(row.ring, 0)}</td><td>{load}</td>"
        f'<td class="words">{as_html(row.signal)}</td>{bands}<td class="write"></td><td class="words">{boxes}</td></tr>'
    )

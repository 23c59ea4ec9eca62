"""Times that a recorder wrote as text: a time of day, with a date or without."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta

CLOCK = re.compile(
    r"(?:(?P<iso>\d{4}-\d{2}-\d{2})[T ]|(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>\d{4})[ T])?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2}(?:[.,]\d{1,9})?)"
    r"(?:Z|(?P<sign>[+-])(?P<east>\d{2}):?(?P<more>\d{2}))?"
)
"""An ISO 8601 date or one with points, day first; hours, minutes and seconds; hours that the place is east of UTC."""

CLOCK_EXPECTED = "a time such as 14:03:00.250 or 2025-11-28T14:03:00.250+01:00"

DAY, EPOCH = 86400.0, date(1970, 1, 1)


@dataclass
class TextClock:
    """A column of such times, told in seconds since the first of them.

    Parameters
    ----------
    first : float
        The first time [s since 1970, or since midnight where there is no date].
    began : datetime or None
        The same as a moment; None where its date or its zone is not written.
    dated : bool
        Whether times have a date; those without pass midnight when they fall by more than half a day.
    """

    first: float
    began: datetime | None
    dated: bool
    _last: float = 0.0

    def restart(self) -> None:
        """Begin with the first row once more."""
        self._last = 0.0

    def seconds(self, cell: str) -> float:
        """Time since the first one [s].

        Raises
        ------
        ValueError
            It is no time, or has a date where the first had none, or none where it had one.
        """
        found = _parts(cell)
        if found is None or found[1] != self.dated:
            raise ValueError(cell)
        since = found[0] - self.first
        if not self.dated:
            since += DAY * round((self._last - since) / DAY)
        self._last = since
        return since


def clock_of(cell: str) -> TextClock | None:
    """The clock that begins with a cell; None where that is no time."""
    found = _parts(cell.strip())
    if found is None:
        return None
    seconds, dated, zoned = found
    began = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds) if dated and zoned else None
    return TextClock(seconds, began, dated)


def _parts(cell: str) -> tuple[float, bool, bool] | None:
    """Seconds, whether there is a date, and whether there is a zone; None where it is no time."""
    match = CLOCK.fullmatch(cell)
    if match is None:
        return None
    try:
        day = _date(match)
    except ValueError:  # no such day
        return None
    hour, minute, second = int(match["hour"]), int(match["minute"]), float(match["second"].replace(",", "."))
    if hour > 23 or minute > 59 or second >= 61.0:
        return None
    seconds = 3600.0 * hour + 60.0 * minute + second + (DAY * (day - EPOCH).days if day else 0.0)
    if match["sign"]:
        seconds -= float(f"{match['sign']}1") * (3600.0 * int(match["east"]) + 60.0 * int(match["more"]))
    return seconds, day is not None, bool(match["sign"]) or cell.endswith("Z")


def _date(match: re.Match[str]) -> date | None:
    if match["iso"]:
        return date.fromisoformat(match["iso"])
    return date(int(match["year"]), int(match["month"]), int(match["day"])) if match["year"] else None

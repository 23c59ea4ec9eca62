"""Recordings that have landed in a folder: whole, by their size and time, and no longer written to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.store.sources import SUFFIX

if TYPE_CHECKING:
    from pathlib import Path

END = b"\x89MCAP0\r\n"
"""Bytes with which a recording that was closed ends."""

PATIENCE = 10.0
"""How many times longer a recording is waited for that has not been closed."""


@dataclass(frozen=True)
class _Seen:
    """A file as it was last seen: its size, its time, since when [s], and whether it was given out."""

    size: int
    changed: int
    since: float
    given: bool = False


class Landings:
    """Files of a folder watched by size and time of change.

    Parameters
    ----------
    folder : Path
        The folder; folders below it count.
    settle : float
        Time for which a closed recording must not change [s]. One without its end is waited for `PATIENCE` times as
        long, then given out all the same: its recorder stopped. What it holds can be saved; an
        empty one is named.
    """

    def __init__(self, folder: Path, settle: float) -> None:
        self._folder = folder
        self._settle = settle
        self._seen: dict[Path, _Seen] = {}

    def look(self, now: float) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
        """Recordings that have become whole since the last look, and those still being written.

        Parameters
        ----------
        now : float
            Time on a clock that never goes back [s].
        """
        whole: list[Path] = []
        open_: list[Path] = []
        there: dict[Path, _Seen] = {}
        for path in sorted(self._folder.rglob(f"*{SUFFIX}")):
            try:
                facts = path.stat()
                closed = _closed(path, facts.st_size)
            except OSError:  # gone again, or not readable yet
                continue
            seen = self._seen.get(path)
            if seen is None or (seen.size, seen.changed) != (facts.st_size, facts.st_mtime_ns):
                seen = _Seen(facts.st_size, facts.st_mtime_ns, now)
            if not seen.given:
                wait = self._settle * (1.0 if closed else PATIENCE)
                ready = now - seen.since >= wait
                seen = _Seen(seen.size, seen.changed, seen.since, ready)
                (whole if ready else open_).append(path)
            there[path] = seen
        self._seen = there
        return tuple(whole), tuple(open_)


def _closed(path: Path, size: int) -> bool:
    """Whether a recorder has written the end of a recording."""
    if size < len(END):
        return False
    with path.open("rb") as file:
        file.seek(size - len(END))
        return file.read() == END

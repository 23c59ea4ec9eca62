"""A table of a TOML file, read key by key, each fault told with its place."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

NOWHERE: Mapping[str, str] = MappingProxyType({})


class Reader:
    """A table of the file whose keys are taken out one by one; what is left at the end is unknown.

    Parameters
    ----------
    where : str
        File, and the table within it.
    table : dict
        Its content.
    """

    def __init__(self, where: str, table: dict[str, Any]) -> None:
        self.where, self.table, self.asked = where, dict(table), set[str]()

    def _take(self, key: str, default: object) -> Any:  # noqa: ANN401 - TOML values; every caller checks the kind
        self.asked.add(key)
        if key not in self.table and default is None:
            known = near_miss(key, self.table) if self.table else f"Add {key}."
            raise BenchError(f"{self.where}: {key}", "missing", "this key", known)
        return self.table.pop(key, default)

    def text(self, key: str, default: str | None = None) -> str:
        """A text."""
        value = self._take(key, default)
        if not isinstance(value, str):
            raise BenchError(f"{self.where}: {key}", repr(value), "text in quotation marks", "Correct the value.")
        return value

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """A number within a range."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise BenchError(
                f"{self.where}: {key}", repr(value), f"a number from {low:g} to {high:g}", "Correct the value."
            )
        return float(value)

    def whole(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number within a range."""
        value = self.number(key, low, high, default)
        if value != int(value):
            raise BenchError(f"{self.where}: {key}", f"{value:g}", "a whole number", "Correct the value.")
        return int(value)

    def word(self, key: str, known: Iterable[str], default: str | None = None) -> str:
        """One of some words."""
        value, names = self.text(key, default), sorted(known)
        if value not in names:
            raise BenchError(f"{self.where}: {key}", repr(value), "a known word", near_miss(value, names))
        return value

    def words(self, key: str, known: Iterable[str]) -> list[str]:
        """A list of some words, at least one."""
        value, names = self._take(key, None), sorted(known)
        if not isinstance(value, list) or not value:
            raise BenchError(f"{self.where}: {key}", repr(value), "a list of words", f"Known: {', '.join(names)}.")
        for word in value:
            if word not in names:
                raise BenchError(f"{self.where}: {key}", repr(word), "a known word", near_miss(str(word), names))
        return value

    def sub(self, key: str, *, optional: bool = False) -> Reader:
        """A table within."""
        value = self._take(key, {} if optional else None)
        if not isinstance(value, dict):
            raise BenchError(f"{self.where}: {key}", repr(value), f"a table [{key}]", "Write it as a table.")
        return Reader(f"{self.where}: {key}", value)

    def rows(self, key: str) -> list[Reader]:
        """Tables of an optional list."""
        value = self._take(key, [])
        if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
            raise BenchError(f"{self.where}: {key}", "not a list of tables", f"[[{key}]]", "Write it as tables.")
        return [Reader(f"{self.where}: {key} {i}", row) for i, row in enumerate(value, 1)]

    def done(self, elsewhere: Mapping[str, str] = NOWHERE) -> None:
        """Complain about a key that nobody asked for; ``elsewhere`` says beside what a key would be known."""
        for key in self.table:
            if key in elsewhere:
                do = f"Add {elsewhere[key]}, or leave {key} out."
                raise BenchError(f"{self.where}: {key}", "no meaning here", f"it beside {elsewhere[key]}", do)
            raise BenchError(f"{self.where}: {key}", "unknown key", "a known one", near_miss(key, self.asked))

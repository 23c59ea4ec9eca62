"""JSON messages read into numbers by field."""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.layouts.jsonalike import read_alike
from pmg.pipeline.recording.layouts.layout import Columns, gathered

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.container.messages import Messages
    from pmg.pipeline.recording.layouts.jsonalike import Piece

DEEPEST_OBJECT = 8
"""Objects within objects that are followed."""
WIDEST = 256
"""Fields of one message that are followed."""
NUMBER = (int, float)
TEXT_TIME = "#utc"
"""Follows the name of a field that holds a time as text."""
LATEST_YEAR = "2200"
"""Nanoseconds since 1970 fit into a signed number up to beyond this year."""
UTC_TEXT = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d(?:\.\d+)?Z", flags=re.ASCII)
"""Form of such a time; numpy alone takes offsets and parts of a time too."""
INT64 = 1 << 63


def read_json(payloads: Messages) -> Columns:
    """Numbers of JSON objects by field, the names of nested objects with dots between.

    Notes
    -----
    Texts are times where they read as RFC 3339 in UTC (``2025-04-23T08:00:00.25Z``), given as nanoseconds since 1970
    under their name with `TEXT_TIME`; other texts, truth values and nulls are no numbers and are left out. NaN and
    Infinity, which strict JSON does not know, are taken as numbers that are not finite.
    """
    columns = Columns(len(payloads))
    alike, done = read_alike(payloads, lambda value, found: _take(value, "", 0, found, 0))
    found: dict[str, tuple[list[int], list[Any]]] = {}
    ranks: dict[str, tuple[int, int]] = {}
    if not done.all():
        _one_by_one(payloads, done, columns, found)
    for rank, (path, (places, _)) in enumerate(found.items()):
        ranks[path] = places[0], rank
    for path, pieces in alike.items():
        ranks[path] = min(ranks.get(path, (len(payloads), 0)), *((int(p.places[0]), p.rank) for p in pieces))
    # As many fields as one by one are followed, in the order in which the messages bring them.
    for path in sorted(ranks, key=ranks.__getitem__)[:WIDEST]:
        noted = found.get(path, ([], []))
        columns.counts[path], columns.values[path] = _column(len(payloads), *noted, alike.get(path, []))
    return columns


def _one_by_one(
    payloads: Messages, done: npt.NDArray[np.bool_], columns: Columns, found: dict[str, tuple[list[int], list[Any]]]
) -> None:
    """Note the fields of the messages that are left, and those that are no JSON objects."""
    decoder = json.JSONDecoder()
    read = decoder.raw_decode
    for place, payload in payloads.those(~done):
        try:
            text = payload.decode("utf-8")
            value, end = read(text) if text[:1] == "{" else (None, -1)
            if end != len(text):
                # White space around it, or no JSON: the slow way tells.
                value = decoder.decode(text)
        except (UnicodeDecodeError, ValueError, RecursionError):
            columns.faults[place] = "it is no JSON"
            continue
        if not isinstance(value, dict):
            columns.faults[place] = f"it is a JSON {type(value).__name__}, not an object"
            continue
        for name, inner in value.items():
            kind = type(inner)
            if (kind is int or kind is float) and name in found:
                entry = found[name]
                if entry[0][-1] != place:
                    entry[0].append(place)
                    entry[1].append(inner)
            else:
                _take({name: inner}, "", place, found, 0)


def _take(
    value: dict[str, Any], prefix: str, place: int, found: dict[str, tuple[list[int], list[Any]]], depth: int
) -> None:
    """Note the fields of an object."""
    for name, inner in value.items():
        kind = type(inner)
        if kind is dict:
            if depth < DEEPEST_OBJECT:
                _take(inner, f"{prefix}{name}.", place, found, depth + 1)
            continue
        if kind is float or kind is int or kind is str or kind is list:
            path = f"{prefix}{name}{TEXT_TIME}" if kind is str else prefix + name
            entry = found.get(path)
            if entry is None:
                if len(found) >= WIDEST:
                    continue
                entry = found[path] = [], []
            elif entry[0][-1] == place:
                continue
            entry[0].append(place)
            entry[1].append(inner)


def _column(
    size: int, places: list[int], values: list[Any], pieces: list[Piece]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[Any]]:
    """Count of numbers in a field of each message, and the numbers; one by one, or together from messages alike."""
    if pieces and set(map(type, values)) <= set(NUMBER):
        own = _numbers(values) if values else np.empty(0, dtype=np.int64)
        if own.dtype != np.uint64:
            read = [(piece.places, piece.numbers[:, None]) for piece in pieces]
            return gathered(size, [*read, (np.array(places, dtype=np.int64), own[:, None])])
    if pieces:
        every = [*places, *(place for piece in pieces for place in piece.places.tolist())]
        numbers = [*values, *(number for piece in pieces for number in piece.numbers.tolist())]
        order = sorted(range(len(every)), key=every.__getitem__)
        places, values = [every[place] for place in order], [numbers[place] for place in order]
    counts = np.zeros(size, dtype=np.int64)
    kinds = set(map(type, values))
    if kinds <= set(NUMBER):
        counts[places] = 1
        return counts, _numbers(values)
    flat: list[Any] = []
    for place, value in zip(places, values, strict=True):
        if type(value) is list:
            numbers = [v for v in value if type(v) in NUMBER]
            if len(numbers) == len(value):
                counts[place] = len(numbers)
                flat.extend(numbers)
        elif type(value) is str:
            if (time := _time(value)) is not None:
                counts[place] = 1
                flat.append(time)
        else:
            counts[place] = 1
            flat.append(value)
    return counts, _numbers(flat)


def _numbers(values: list[Any]) -> npt.NDArray[Any]:
    """Whole numbers as such where all are, else numbers in double precision."""
    if set(map(type, values)) == {int}:
        if all(-INT64 <= value < INT64 for value in values):
            return np.array(values, dtype=np.int64)
        if all(0 <= value < 2 * INT64 for value in values):
            return np.array(values, dtype=np.uint64)
    return np.array([double(value) for value in values], dtype=np.float64)


def double(value: float) -> float:
    """A number in double precision; one that is too large is not finite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _time(text: str) -> int | None:
    """Nanoseconds since 1970 of a time in UTC."""
    if not UTC_TEXT.fullmatch(text) or not "1970" <= text[:4] <= LATEST_YEAR:
        return None
    try:
        return int(np.datetime64(f"{text[:10]}T{text[11:-1]}", "ns").astype(np.int64))
    except (ValueError, OverflowError):
        return None

"""Many JSON messages read at once, as far as they differ in the digits of their numbers only."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.container.messages import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy.typing as npt

    from pmg.pipeline.recording.container.messages import Bytes, Messages, Places

    Fields = dict[str, tuple[list[int], list[Any]]]

TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|(?P<number>-?(?P<whole>\d+)(?P<part>\.\d+)?(?P<power>[eE][-+]?\d+)?)')
"""A text or a number of JSON; outside of texts nothing else holds a digit."""
EXACT_DIGITS, WHOLE_DIGITS = 15, 18
"""Most digits of a number that doubles hold exactly without its point, and of a whole one that surely fits 64 bits."""
MOST_FORMS = 64
"""Forms tried on the messages of one length; beyond, they are left to be read one by one."""
FEWEST = 32
"""Messages of one length that pay for the search for a form."""
SHARE = 8
"""A form must take one in so many of the messages it is tried on, or the search ends."""
ZERO = ord("0")


@dataclass(frozen=True)
class _NumberField:
    """A number in a form: path of its field, place of its first byte, and of its point and its end."""

    path: str
    start: int
    point: int
    stop: int


@dataclass(frozen=True)
class _MessageForm:
    """Messages that differ only in the digits of their numbers.

    Parameters
    ----------
    data : array of bytes
        One of them.
    digits : array of bool
        Which of its bytes are digits of its numbers.
    firsts : array of int
        Places of first digits that another digit follows, which are never zero.
    numbers : list of _NumberField
        Its numbers, in order.
    """

    data: npt.NDArray[np.uint8]
    digits: npt.NDArray[np.bool_]
    firsts: npt.NDArray[np.int64]
    numbers: list[_NumberField]

    def alike(self, rows: Bytes) -> npt.NDArray[np.bool_]:
        """Which of the messages (n, length) are of this form."""
        same: npt.NDArray[np.bool_] = (rows[:, ~self.digits] == self.data[~self.digits]).all(axis=1)
        same &= ((rows[:, self.digits] - np.uint8(ZERO)) <= 9).all(axis=1)
        same &= (rows[:, self.firsts] != ZERO).all(axis=1)
        return same


@dataclass(frozen=True)
class Piece:
    """Numbers of one field from messages of one form: their places, how manieth field it is there, the numbers."""

    places: Places
    rank: int
    numbers: npt.NDArray[Any]


def read_alike(payloads: Messages, take: Callable[[dict[str, Any], Fields], None]) -> tuple[Any, npt.NDArray[np.bool_]]:
    """Numbers by field of the messages that stand alike, and which messages those are.

    Parameters
    ----------
    payloads : Messages
        JSON objects.
    take : callable
        Notes the fields of an object under their paths.

    Returns
    -------
    pieces : dict of str to list of Piece
        By path.
    done : (n,) array of bool
        Messages that were read; the others are to be read one by one.
    """
    found: dict[str, list[Piece]] = {}
    done = np.zeros(len(payloads), dtype=np.bool_)
    for places, rows in payloads.by_length(TOGETHER):
        for own, form in _forms(rows, take):
            there = places[own]
            for rank, number in enumerate(form.numbers):
                piece = Piece(there, rank, _values(rows[own, number.start : number.stop], number))
                found.setdefault(number.path, []).append(piece)
            done[there] = True
    return found, done


def _forms(rows: Bytes, take: Callable[[dict[str, Any], Fields], None]) -> Iterator[tuple[Places, _MessageForm]]:
    """Forms of messages of one length, (n, length), and which of them each form takes."""
    left = np.arange(len(rows))
    for _ in range(MOST_FORMS):
        if len(left) < FEWEST or rows.shape[1] == 0:
            return
        form = _form_of(rows[left[0]].tobytes(), take)
        if form is None:
            return
        alike = form.alike(rows[left])
        yield left[alike], form
        if np.count_nonzero(alike) * SHARE < len(left) and np.count_nonzero(alike) < FEWEST:
            return
        left = left[~alike]


def _form_of(data: bytes, take: Callable[[dict[str, Any], Fields], None]) -> _MessageForm | None:
    """The form of a message; None for one that is not an object of plain numbers, objects, truth values and nulls."""
    tokens = [token for token in TOKEN.finditer(data) if token["number"] is not None]
    order = iter(range(len(tokens)))
    try:
        value = json.loads(data.decode("utf-8"), parse_int=lambda _: next(order), parse_float=lambda _: next(order))
    except (ValueError, RecursionError, StopIteration, RuntimeError):
        return None
    if not isinstance(value, dict) or next(order, None) is not None:
        return None
    found: Fields = {}
    take(value, found)
    digits = np.zeros(len(data), dtype=np.bool_)
    firsts, numbers = [], []
    for path, (_, noted) in found.items():
        if len(noted) != 1 or type(noted[0]) is not int:
            return None
        token = tokens[noted[0]]
        whole, part = token["whole"], token["part"] or b""
        if token["power"] or (not part and len(whole) > WHOLE_DIGITS):
            return None
        digits[token.start("whole") : token.end()] = True
        if part:
            digits[token.start("part")] = False
        if len(whole) > 1:
            firsts.append(token.start("whole"))
        point = token.start("part") if part else token.end()
        numbers.append(_NumberField(path, token.start(), point, token.end()))
    return _MessageForm(np.frombuffer(data, np.uint8), digits, np.array(firsts, dtype=np.int64), numbers)


def _values(rows: Bytes, number: _NumberField) -> npt.NDArray[Any]:
    """Numbers as they stand in JSON, (n, length), as `int` and `float` read them.

    Notes
    -----
    Up to `EXACT_DIGITS` digits and powers of ten up to 22 are exact in double precision, so that one division of the
    two gives the nearest double, which is what the text stands for.
    """
    below = rows[0, 0] == ord("-")
    decimals = number.stop - number.point - 1
    whole = rows[:, int(below) : number.point - number.start]
    count = whole.shape[1] + max(decimals, 0)
    if decimals >= 0 and count > EXACT_DIGITS:
        text = np.ascontiguousarray(rows)
        return text.view(f"S{text.shape[1]}")[:, 0].astype(np.float64)
    value = np.zeros(len(rows), dtype=np.int64)
    for column in (*whole.T, *(rows[:, number.point - number.start + 1 :].T if decimals >= 0 else ())):
        value *= 10
        value += column
        value -= ZERO
    if decimals < 0:
        return -value if below else value
    exact = value / 10.0**decimals
    return np.negative(exact) if below else exact

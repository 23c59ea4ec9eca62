"""Kinds of signals and shafts by the words of names and by units: what a header alone tells."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pmg.pipeline.importers.source import BRACKETED
from pmg.pipeline.wording.units import ANGLE, COUNT, ELECTRIC, FREQUENCY, SPEED, TIME, TORQUE, declared

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

WORD = re.compile(r"[A-ZÄÖÜ]?[a-zäöüß]+|[A-ZÄÖÜ]+(?![a-zäöüß])|\d+|[φθωτ]")
"""A word of a name, by case and digits."""
COLUMN = re.compile(r"\((\d+,:|:,\d+)\)$|[@#]\d+$")
"""Number of a column, of a group or of a name that comes again: no word of the name."""
SPELLED_TEMPERATURES = ("degC", "°C", "C", "K", "degF", "°F")
"""Units of temperatures."""

KIND_WORDS = {
    "torque": "torque torques drehmoment trq tq moment",
    "speed": "speed drehzahl rpm omega velocity vel geschwindigkeit ω",
    "angle": "angle winkel phi theta position pos encoder count counts counter drehwinkel φ θ",
    "temperature": "temp temperature temperatur",
    "current": "current strom amps iq",
    "time": "time zeit timestamp clock elapsed uhrzeit seconds sec secs",
    "ticks": "tick ticks timer",
}
"""Words that say what a signal is."""
SYMBOLS = {
    **dict.fromkeys(("M", "tau", "τ"), ("torque",)),
    **dict.fromkeys(("n", "qd", "dq", "qdot"), ("speed",)),
    "q": ("angle",),
    "T": ("torque", "temperature"),
    "t": ("time",),
    "I": ("current",),
}
"""Symbols at the beginning of a name that may say so; what has a unit is judged by that alone."""
WARM_PLACES = {"oil", "oel", "öl", "ambient", "amb"}
"""Words of what has a temperature, whose symbol is a letter of an angle, too."""
SIDE_WORDS: tuple[Mapping[str, str], ...] = (
    {"sun": "sun sonne sonnenrad", "ring": "ring hohlrad"},
    {
        "sun": "input drive in antrieb eingang",
        "ring": "output load out abtrieb ausgang",
    },
    {"sun": "1", "ring": "2"},
)
"""Words that say which shaft, the more certain ones first."""
LONE_UNITS = {
    "s": f"{KIND_WORDS['time']} t",
    "A": f"{KIND_WORDS['current']} i I iq id",
    "N": "force kraft F",
    "V": "voltage spannung command",
    "m": "position pos weg travel stroke hub x",
    "C": f"{KIND_WORDS['temperature']} T theta θ",
    "K": f"{KIND_WORDS['temperature']} T theta θ",
    "%": KIND_WORDS["torque"],
}
"""Units of one letter at the end of a name, as in ``force_N``, and the words before them that make them units."""
SET_WORDS = frozenset(
    ["set", "setpoint", "soll", "sollwert", "cmd", "command", "ref", "reference", "demand", "target", "desired", "des"],
)
"""Words of what was asked for and not measured."""


def words_of(name: str) -> list[str]:
    """Words of a name in small letters; single letters stay as they are."""
    return [word if len(word) == 1 else word.lower() for word in WORD.findall(COLUMN.sub("", name))]


def _parts(name: str) -> tuple[str, str, str]:
    """Groups above, last part, and unit in brackets of a name."""
    found = BRACKETED.fullmatch(COLUMN.sub("", name))
    plain, unit = (found["name"], found["unit"]) if found and found["name"] else (name, "")
    above, _, last = plain.rpartition("/")
    return above, last, unit


def side_of(name: str, known_words: tuple[Mapping[str, str], ...] = SIDE_WORDS) -> str:
    """Shaft that a name speaks of: its last part decides, then the groups above; empty where none or both are named."""
    above, last, _ = _parts(name)
    for part in (last, above):
        words = set(words_of(part))
        for rank in known_words:
            sides = [side for side, known in rank.items() if words & set(known.split())]
            if sides:
                return sides[0] if len(sides) == 1 else ""
    return ""


def is_set_point(name: str) -> bool:
    """Whether a name speaks of what was asked for."""
    words = words_of(_parts(name)[1])
    return bool(set(words) & SET_WORDS) or words[:2] in (["q", "d"], ["qr"])


def kinds_by_name(name: str) -> tuple[tuple[str, ...], bool]:
    """Kinds that a name may speak of, and whether words say so; a symbol is a weak sign."""
    words = words_of(_parts(name)[1])
    found = tuple(kind for kind, known in KIND_WORDS.items() if set(words) & set(known.split()))
    if found == ("angle",) and set(words) & {"theta", "θ"} and set(words) & WARM_PLACES:
        found = ("temperature",)
    if found:
        return found, True
    symbols = [word for word in words[:1] if word in SYMBOLS]
    return (SYMBOLS[symbols[0]], False) if symbols else ((), False)


def unit_by_name(name: str, more: Iterable[str] = ()) -> str:
    """Unit in brackets behind a name, or at its end, as in ``M_Nm``, ``n_rad_s``; else empty.

    One letter needs a word of `LONE_UNITS` before it.
    """
    _, plain, bracketed = _parts(name)
    known = {*TORQUE, *SPEED, *ANGLE, *ELECTRIC, *FREQUENCY, *TIME, *SPELLED_TEMPERATURES, *more}
    if declared(bracketed) in known:
        return declared(bracketed)
    *before, last = re.split(r"[\s_\-.]", plain)
    *_, above = [word for word in before if word != "per"] or [""]
    if len(before) > 1 and (ratio := declared(f"{above}/{last}")) in known:
        return ratio
    unit = declared(last)
    if len(unit) == 1 and not set(words_of(" ".join(before))) & set(LONE_UNITS.get(unit, "").split()):
        return ""
    return unit if before and unit in known else ""


def kind_by_unit(unit: str, named: tuple[str, ...]) -> str:
    """Kind that a unit stands for, with the kinds by name where the unit alone does not tell; else empty."""
    plain = declared(unit)
    if plain in SPELLED_TEMPERATURES:
        return "temperature"
    for kind, known in (("torque", TORQUE), ("speed", SPEED), ("angle", ANGLE), ("time", TIME)):
        if plain in known:
            return kind
    if plain in ELECTRIC or plain in FREQUENCY:
        current = plain.endswith("A") and "torque" not in named
        return "current" if current else "torque" if named == ("torque",) else ""
    if plain in COUNT:
        return "ticks" if "ticks" in named else "angle" if "angle" in named else ""
    return ""

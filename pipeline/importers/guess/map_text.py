"""A proposed channel map as TOML: what was guessed with its reason, what is open as lines that the user completes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from pmg.pipeline.importers.channel_map import SCHEMA
from pmg.pipeline.recording.run import CONFIGURATIONS, DRIVES, NUMBERS
from pmg.pipeline.wording.safe_text import printable
from pmg.pipeline.wording.units import TIME

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.importers.guess.map_guess import MapGuess, SignalGuess, TopicGuess
    from pmg.pipeline.importers.guess.time_guess import TimeOption

OPEN = "#? "
"""Begin of a line that the user completes."""
PLACELESS = ("current", "time", "ticks")
"""Kinds of signals that no table of a channel takes."""
HINTS = {
    "topic": "its topic, as the others here; see pipeline/importers/README.md",
    "unit": "its unit",
    "Nm_per_unit": "torque [N m] of one unit; add zero where no torque is not 0",
    "wraps_at": "where the angle begins anew, in its unit",
    "bits": "width of the counter",
    "frequency_Hz": "its ticks per second",
    "rate_Hz": "samples per second",
}
"""What is to be filled in behind a key."""


def map_text(guess: MapGuess) -> str:
    """The TOML of a proposed map."""
    return "\n".join(_lines(guess)) + "\n"


def quoted(text: str) -> str:
    """A string of TOML on one line, with every sign that does not print as its code."""
    plain = json.dumps(text, ensure_ascii=False)
    return "".join(sign if sign.isprintable() else f"\\U{ord(sign):08X}" for sign in plain)


def _lines(guess: MapGuess) -> Iterator[str]:
    source = guess.source
    yield f"# Proposed for {printable(source.path.name)} ({source.format}) by pmg import --guess: look at each line."
    mark = OPEN.strip()
    yield f"# Lines that begin with '{mark}' are open: take '{mark}' away and complete them; what is not wanted stays."
    if source.reading:
        read = ", ".join(f"{key.replace('_', ' ')} {word}" for key, word in source.reading.items())
        yield f"# Read with {printable(read)}."
    lengths = {one.seen.channel.length for each in guess.topics for one in each.candidates}
    if len(lengths) > 1:
        yield "# The channels differ in length: those of one map must have as many rows."
    yield f"schema = {quoted(SCHEMA)}"
    yield f'{OPEN}calibration = ""  # TOML file next to the map; raw/LAYOUT.md shows one'
    yield ""
    yield "[run]"
    yield f'{OPEN}campaign = ""'
    yield 'point = { file = "stem" }  # the name of the file without its end, so that each file is a point'
    yield f'{OPEN}configuration = ""  # {", ".join(CONFIGURATIONS)}'
    yield f"{OPEN}gear =   # {', '.join(NUMBERS)}"
    yield f'{OPEN}drive = ""  # {", ".join(DRIVES)}'
    if source.started_at is None:
        yield f"{OPEN}started_at =   # such as 2026-03-04T09:30:00Z; the file does not say it"
    else:
        yield f"# started_at: the file says {source.started_at.isoformat()}"
    yield "# What was asked for, if known: sun_speed_set_rpm, ring_speed_set_rpm, ring_torque_set_Nm."
    yield ""
    yield from _time(guess)
    for topic in guess.topics:
        yield from _topic(topic)
    if guess.left:
        yield ""
        yield "# --- not proposed ---"
    for one in guess.left:
        yield from _left(one)


def _time(guess: MapGuess) -> Iterator[str]:
    time = guess.time
    yield "[time]"
    if time.stated:
        yield f"# {printable(time.stated)}"
        return
    if not time.options:
        yield "# no channel rises steadily that is a time by its unit or name"
        yield f"{OPEN}rate_Hz =   # {HINTS['rate_Hz']}; or source and unit ({', '.join(TIME)}) of a column"
        return
    if len(time.options) > 1:
        yield f"# {len(time.options)} candidates, none chosen: take one"
    for option in time.options:
        yield from _option(option, "" if option is time.chosen else OPEN)


def _option(option: TimeOption, mark: str) -> Iterator[str]:
    yield f"# why: {printable(option.reason)}"
    if option.doubt:
        yield f"# but: {printable(option.doubt)}"
    for key, value in option.keys.items():
        yield f"{mark}{key} = {quoted(value) if isinstance(value, str) else repr(value)}"
    for key in option.missing:
        yield _open_key(key, f": {', '.join(TIME)}" if key == "unit" else "")


def _topic(topic: TopicGuess) -> Iterator[str]:
    yield ""
    count, chosen = len(topic.candidates), topic.chosen
    if not count:
        yield f"# {topic.topic}: no channel fits"
        yield from _block(topic.topic, "", "", {}, ("unit",), OPEN)
        return
    if chosen is None:
        one = "1 candidate, not chosen" if count == 1 else f"{count} candidates, none chosen: take one"
        yield f"# {topic.topic}: {one}"
    for guess in topic.candidates:
        yield f"# why: {printable(guess.reason)}"
        if guess.doubt:
            yield f"# but: {printable(guess.doubt)}"
        yield f"# seen: {printable(guess.seen.description())}"
        yield from _block(topic.topic, guess.name, guess.unit, guess.keys, guess.missing, "" if chosen else OPEN)


def _block(
    topic: str, name: str, unit: str, keys: dict[str, str], missing: tuple[str, ...], mark: str
) -> Iterator[str]:
    """A table of a channel; every line of it is marked where something is open."""
    yield f"{mark}[[channel]]"
    yield f"{mark}topic = {quoted(topic)}"
    yield f"{mark}source = {quoted(name)}"
    if unit:
        yield f"{mark}unit = {quoted(unit)}"
    for key, value in keys.items():
        yield f"{mark}{key} = {value}"
    for key in missing:
        yield _open_key(key)


def _open_key(key: str, more: str = "") -> str:
    """A key that the user completes; a text already between its quotes."""
    value = '""' if key in ("unit", "topic") else ""
    return f"{OPEN}{key} = {value}  # {HINTS[key]}{more}"


def _left(guess: SignalGuess) -> Iterator[str]:
    yield ""
    yield f"# {quoted(guess.name)}: {printable(guess.reason)}"
    if not guess.seen.fault:
        yield f"#   seen: {printable(guess.seen.description())}"
    if guess.kind in PLACELESS or guess.seen.fault:
        return
    yield f"{OPEN}[[channel]]"
    yield _open_key("topic")
    yield f"{OPEN}source = {quoted(guess.name)}"
    yield f"{OPEN}unit = {quoted(guess.unit)}" if guess.unit else _open_key("unit")

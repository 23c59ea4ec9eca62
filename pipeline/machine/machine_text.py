"""A proposed machine file as TOML: what was guessed with its reason, what is open as lines that the user completes."""

from __future__ import annotations

import re
import tomllib
from typing import TYPE_CHECKING, Any

from pmg.pipeline.importers.guess.map_text import OPEN, quoted
from pmg.pipeline.machine.channel import COMMANDS, COUNT, TIMES
from pmg.pipeline.machine.machine_file import MACHINE_SCHEMA
from pmg.pipeline.wording.safe_text import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.machine.channel_guess import ChannelGuess
    from pmg.pipeline.machine.machine_guess import MachineGuess

THINNED_HZ = 50.0
"""Rate to which a proposed file thins the samples [Hz]."""
BAND = 0.64
"""Low-pass of the motion over that rate: 1.6 times what thinning keeps of the torque, so that it cuts nothing there."""
MOST_LEFT_OUT = 100
"""Largest decimation that a machine file takes."""


def machine_text(guess: MachineGuess) -> str:
    """The TOML of a proposed machine."""
    return "\n".join(_lines(guess)) + "\n"


def _lines(guess: MachineGuess) -> Iterator[str]:
    source, mark = guess.source, OPEN.strip()
    yield f"# Proposed for {printable(source.path.name)} ({source.format}) by pmg import --guess --machine."
    yield f"# Look at each line. Those that begin with '{mark}' are open: take '{mark}' away and complete them."
    if source.reading:
        read = ", ".join(f"{key.replace('_', ' ')} {word}" for key, word in source.reading.items())
        yield f"# Read with {printable(read)}."
    yield f"schema = {quoted(MACHINE_SCHEMA)}"
    yield f"title = {quoted(source.path.stem)}  # of the report: put the name of the machine"
    yield f'{OPEN}source = ""  # of every number that names no other'
    shafts = guess.shafts
    if len(shafts) > 1:
        yield from (
            "",
            "[gear]",
            'kind = "rigid"  # or "none", where one shaft goes through; "magnetic": with pole pairs',
        )
        yield from (f'{end} = "{end}"' for end in ("input", "output"))
        if guess.ratio is None:
            apart = guess.apart.get("velocity", guess.apart.get("position", ""))
            why = f"the speeds were not set side by side: {printable(apart)}" if apart else "the speeds do not show it"
            yield f'{OPEN}ratio = {{ value = , unit = "1", source = "" }}  # {why}'
        else:
            value = f'{{ value = {guess.ratio!r}, unit = "1", source = {quoted("speeds of " + source.path.name)} }}'
            yield f"ratio = {value}  # by the slope of one speed over the other: put that of the teeth"
    for shaft in shafts or ("shaft",):
        yield from _shaft(guess, shaft)
    yield from _records(guess)
    if guess.left:
        yield from ("", "# --- not proposed ---")
    for one in guess.left:
        yield f"# {quoted(one.name)}: {printable(one.reason)}"
        if not one.seen.fault:
            yield f"#   seen: {printable(one.seen.description())}"


def _shaft(guess: MachineGuess, shaft: str) -> Iterator[str]:
    axis = guess.axis
    yield from ("", f"[shaft.{shaft}]", f'moves = "{"turns" if axis.turn else "slides"}"')
    yield f'{OPEN}inertia = {{ value = , unit = "{axis.mass}", u = , source = "" }}  # needed if it coasts'
    of_current = any(one.unit == "A" for one in guess.channels.get((shaft, "force"), ()))
    if of_current:
        unit = f"{axis.push}/A"
        yield from ("", f"[shaft.{shaft}.motor]")
        yield f'{OPEN}constant = {{ value = , unit = "{unit}", source = "" }}  # makes a {axis.pushes} of its current'
    elif (shaft, "force") in guess.channels:
        yield from ("", f"{OPEN}[shaft.{shaft}.transducer]")
        yield f'{OPEN}nominal = {{ value = , unit = "{axis.push}", source = "" }}  # a warning where readings exceed it'
        if all((one, "force") in guess.channels for one in guess.shafts) and len(guess.shafts) > 1:
            yield f'{OPEN}tolerance = {{ value = , unit = "%", source = "" }}  # a gain is compared with it'
    if any(one.unit == COUNT for one in guess.channels.get((shaft, "position"), ())):
        yield from ("", f"{OPEN}[shaft.{shaft}.encoder]")
        key, unit = ("counts_per_turn", "1") if axis.turn else ("resolution", "um")
        yield f'{OPEN}{key} = {{ value = , unit = "{unit}", source = "" }}  # 4 times the lines if every edge counts'
    yield from ("", f"[shaft.{shaft}.channel]")
    for kind in ("position", "velocity", "force"):
        fitting = guess.channels.get((shaft, kind), ())
        word = axis.pushes if kind == "force" else kind
        if len(fitting) > 1:
            gear = "" if not axis.turn or len(guess.shafts) > 1 else "; of two shafts, write both and a [gear]"
            yield f"# {word}: {len(fitting)} candidates, none chosen: take one{gear}"
        for one in fitting:
            turned = ", sign = -1" if kind == "force" and guess.against and shaft == guess.shafts[-1] else ""
            if len(guess.shafts) > 1 and not one.end:
                yield f"# no word tells of which shaft: take '{OPEN.strip()}' away, or move it to the other one"
            if kind == "force" and not one.unit:
                yield f"# unit: missing; one of {', '.join(axis.forces)}; for V, A or % add {axis.factor}"
            yield from _channel(word, one, "" if guess.chosen(shaft, kind) is one else OPEN, axis.factor, turned)
            if turned:
                yield "# sign: both torques would put power in most of the time, so one counts what comes out"
            elif kind == "force" and shaft == guess.shafts[-1] and (why := _sign_open(guess)):
                yield f"# sign: open, as not set side by side ({printable(why)}): -1 if this counts what comes out"
    if not any((shaft, kind) in guess.channels for kind in ("position", "velocity")):
        known = (*axis.positions, *axis.speeds)
        yield f'{OPEN}velocity = {{ name = "", unit = "" }}  # no channel fits: one of {", ".join(known)}'
    if (shaft, "force") not in guess.channels:
        yield f"# no {axis.pushes}: if none is recorded of any shaft the machine coasts"


def _sign_open(guess: MachineGuess) -> str:
    """Why both torques could not be set against each other; empty where nothing stood apart that this needs."""
    needed = guess.apart if guess.ratio is None else {"force": guess.apart.get("force", "")}
    return "; ".join(filter(None, needed.values()))


def _channel(word: str, one: ChannelGuess, mark: str, factor: str = "", more: str = "") -> Iterator[str]:
    yield f"# why: {printable(one.reason)}"
    if one.seen.constant:
        yield "# but: it is constant: a set value, or nothing was connected"
    yield f"# seen: {printable(one.seen.description())}"
    if one.unit in COMMANDS:
        other = " or state motor.constant above and leave that out" if one.unit == "A" else ""
        yield f"# one {one.unit} makes how much: complete {factor}{other}"
        more = f", {factor} = {more}"
    yield f"{mark}{word} = {{ name = {quoted(one.name)}, unit = {quoted(one.unit)}{more} }}"


def _records(guess: MachineGuess) -> Iterator[str]:
    yield from ("", "[records]")
    if len(guess.time) > 1:
        yield f"# time: {len(guess.time)} candidates, none chosen: take one"
    for one in guess.time:
        sure = len(guess.time) == 1 and one.unit in TIMES and one.reason.startswith("unit")
        yield from _channel("time", one, "" if sure else OPEN)
    if not guess.time:
        yield "# no column that is a time and rises: the file's own clock is used where it has one, else rate_Hz"
    for one in guess.temperature:
        sure = len(guess.temperature) == 1 and bool(one.unit)
        yield from _channel("temperature", one, "" if sure else OPEN)
    rate = guess.rate_hz
    if rate is None:
        yield f"{OPEN}rate_Hz =   # samples per second"
        yield f"{OPEN}low_pass_Hz =   # at least {BAND} rate_Hz / keep_every, below the first resonance"
        yield f"{OPEN}keep_every = "
    else:
        keep = min(max(round(rate / THINNED_HZ), 1), MOST_LEFT_OUT)
        mark = OPEN if guess.rate_by_steps else ""
        yield f"{mark}rate_Hz = {rate!r}" + ("  # if that column is the time" if mark else "")
        yield f"{mark}low_pass_Hz = {BAND * rate / keep:.4g}  # {BAND} rate_Hz / keep_every; below the first resonance"
        yield f"{mark}keep_every = {keep}"
    yield f'{OPEN}withheld = [""]  # files that take part in no fit, as "run_3.csv" or "run_3*"; or withheld_part = 0.3'
    yield f'{OPEN}zero = [""]  # files at rest with the drive off, as "rest*": their mean is the zero'
    yield from (
        "",
        "[model]",
        'baseline = ["inertia", "viscous", "coulomb"]  # terms of which no one doubts that they act',
    )


def for_other_records(text: str) -> str:
    """The text of a sound machine file with the names of recordings as comments: they go with a folder.

    As it is where the names do not stand in lines of their own.
    """
    return _as_comment(_as_comment(text, "withheld"), "zero")


def _as_comment(text: str, key: str) -> str:
    """The text with what the key of `[records]` lists as a comment; as it is where that needs more than its lines."""
    lines = text.split("\n")
    first = next((at for at, line in enumerate(lines) if re.match(rf"\s*{key}\s*=", line)), len(lines))
    last = first
    while last < len(lines) and _table("\n".join(lines[first : last + 1])) is None:
        last += 1
    without = "\n".join(f"# {line}" if first <= at <= last else line for at, line in enumerate(lines))
    expected = _table(text)
    if expected is not None and isinstance(records := expected.get("records"), dict):
        records.pop(key, None)
    return without if _table(without) == expected else text


def _table(text: str) -> dict[str, Any] | None:
    """Some lines as TOML; None where they are none by themselves."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None

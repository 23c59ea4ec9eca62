"""Single messages of the layout in JSON, CDR or another protobuf message: the same fields under the same names."""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pmg.pipeline.recording.layouts.cdr import cdr_template
from pmg.pipeline.recording.layouts.descriptor import message_of, protobuf_template
from pmg.pipeline.recording.layouts.jsonmessages import double
from pmg.pipeline.recording.layouts.layout import read_columns
from pmg.pipeline.recording.layouts.wire import ClockMark, IndexPulse, LineEvent, TestStep, WireError

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.layouts.layout import Template

Event = TypeVar("Event")

OPTIONAL: dict[str, Any] = {"clock_id": 0, "changed": 0, "u_ns": 0.0, "source": "", "setpoint": {}}
"""Value of a field that is left out; the other fields are required."""
LARGEST = 1 << 64
SETPOINT = "setpoint."
SETPOINT_NAMES = (f"{SETPOINT}key", f"{SETPOINT}name")
"""Where the names of set-points stand in CDR, if each is a message of its own."""


@dataclass(frozen=True)
class Read:
    """Messages in file order, and why some cannot be read."""

    messages: tuple[Any, ...]
    faults: tuple[str, ...]


def read_other(topic: Topic, kind: type[Event]) -> Read:
    """Messages of a kind that are not in the layout's own encoding.

    Parameters
    ----------
    topic : Topic
        Its messages are in JSON, CDR or protobuf.
    kind : type
        `IndexPulse`, `LineEvent`, `ClockMark` or `TestStep`. The last one holds texts and is read from JSON and CDR.

    Raises
    ------
    WireError
        When the encoding or its schema is not read.
    """
    if topic.encoding == "json":
        return _from_json(topic, kind)
    encoding, data = topic.definition
    if kind is TestStep and topic.encoding == "cdr":
        return _from_cdr(topic, kind)
    if kind is TestStep:
        raise WireError(f"texts in '{topic.encoding}' are not read; 'json', 'cdr' or the layout's own messages are")
    if topic.encoding == "cdr":
        columns = read_columns(topic.payloads, cdr_template(topic.schema, encoding, data.decode("utf-8", "replace")))
    elif topic.encoding == "protobuf":
        columns = read_columns(topic.payloads, protobuf_template(message_of(topic.schema, data)))
    else:
        raise WireError(f"encoding '{topic.encoding}' is not read")
    found: dict[str, list[Any]] = {}
    for each in fields(kind):  # type: ignore[arg-type]  # all of them are dataclasses
        values = columns.one(each.name)
        if values is not None:
            found[each.name] = np.asarray(values).tolist()
        elif each.name not in OPTIONAL:
            raise WireError(f"field '{each.name}' is missing in its messages")
    rows = [dict(zip(found, row, strict=True)) for row in zip(*found.values(), strict=True)]
    return Read(tuple(_made(kind, row) for row in rows), tuple(columns.faults.values()))


def _from_json(topic: Topic, kind: type[Event]) -> Read:
    messages: list[Event] = []
    faults: list[str] = []
    for payload in topic.payloads:
        try:
            value = json.loads(payload)
            if not isinstance(value, dict):
                raise WireError(f"it is a JSON {type(value).__name__}, not an object")
            messages.append(_made(kind, value))
        except (ValueError, RecursionError) as fault:
            faults.append(str(fault)[:80])
    return Read(tuple(messages), tuple(faults))


def _from_cdr(topic: Topic, kind: type[Event]) -> Read:
    """Messages with texts, taken apart one by one."""
    encoding, data = topic.definition
    take_apart = cdr_template(topic.schema, encoding, data.decode("utf-8", "replace"))
    messages: list[Event] = []
    faults: list[str] = []
    for payload in topic.payloads:
        try:
            messages.append(_made(kind, _step_of(take_apart(payload))))
        except ValueError as fault:
            faults.append(str(fault)[:80])
    return Read(tuple(messages), tuple(faults))


def _step_of(message: Template) -> dict[str, Any]:
    """Fields of a step, as JSON would give them.

    CDR knows no maps. Set-points are a message with a number for each, in which NaN is one that is not asked for; or a
    sequence of messages with a text ``key`` or ``name`` and a number ``value``.
    """
    numbers: dict[str, list[Any]] = {}
    texts: dict[str, list[str]] = {}
    for leaf in message.leaves:
        found = np.frombuffer(message.data, leaf.form, leaf.count, leaf.at).tolist()
        numbers.setdefault(leaf.path, []).extend(found)
    for path, start, stop in message.texts:
        texts.setdefault(path, []).append(message.data[start:stop].decode("utf-8").removesuffix("\0"))
    value: dict[str, Any] = {path: found[0] for path, found in (numbers | texts).items() if len(found) == 1}
    names = next((texts[path] for path in SETPOINT_NAMES if path in texts), None)
    if names is not None:
        values = numbers.get(f"{SETPOINT}value", [])
        if len(names) != len(values):
            raise WireError(f"'setpoint' holds {len(names)} names and {len(values)} numbers")
        asked = dict(zip(names, values, strict=True))
    else:
        asked = {path.removeprefix(SETPOINT): each for path, each in value.items() if path.startswith(SETPOINT)}
        asked = {name: each for name, each in asked.items() if not math.isnan(each)}
    return {name: each for name, each in value.items() if "." not in name} | {"setpoint": asked}


def _made(kind: type[Event], value: dict[str, Any]) -> Event:
    """The message of those fields; numbers of samples and counts are whole."""
    given: dict[str, Any] = {}
    for each in fields(kind):  # type: ignore[arg-type]  # all of them are dataclasses
        if each.name not in value:
            if each.name not in OPTIONAL and each.default is MISSING:
                raise WireError(f"field '{each.name}' is missing")
            given[each.name] = OPTIONAL[each.name]
            continue
        came = value[each.name]
        if each.name in ("point", "phase", "source"):
            sound = isinstance(came, str)
        elif each.name == "setpoint":
            sound = isinstance(came, dict) and all(type(v) in (int, float) for v in came.values())
            came = {name: double(number) for name, number in came.items()} if sound else came
        elif each.name == "u_ns":
            sound = type(came) in (int, float)
            came = double(came) if sound else came
        else:
            sound = type(came) in (int, float) and came == came // 1 and 0 <= came < LARGEST
            came = int(came) if sound else came
        if not sound:
            raise WireError(f"field '{each.name}' holds {str(came)[:40]!r}")
        given[each.name] = came
    return kind(**given)


KINDS: dict[str, type[Any]] = {
    "/daq/encoder_sun/index": IndexPulse,
    "/daq/encoder_ring/index": IndexPulse,
    "/events/lines": LineEvent,
    "/sys/clock": ClockMark,
    "/test/step": TestStep,
}
"""Messages of each topic of single messages."""

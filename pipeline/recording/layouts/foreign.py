"""A topic in another message layout read into numbers: JSON, CDR, any protobuf; one sample a message, or scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.channels import ENCODING, LARGEST_RATE, SPECS, ChannelSpec
from pmg.pipeline.recording.container.contents import Topic
from pmg.pipeline.recording.container.gathered import FIELDS_KEY
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.layouts.cdr import cdr_template
from pmg.pipeline.recording.layouts.descriptor import message_of, protobuf_template
from pmg.pipeline.recording.layouts.jsonmessages import read_json
from pmg.pipeline.recording.layouts.layout import Columns, read_columns
from pmg.pipeline.recording.layouts.moments import Moments, is_time, moments_of
from pmg.pipeline.recording.layouts.wire import WireError
from pmg.pipeline.recording.run import finite
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings

VALUE_FIELDS = ("value", "data", "samples", "values")
"""Fields that hold the samples of a topic of one channel, the likeliest first."""
MINORITY = 0.1
"""Part of the messages that may lack the index or stamp and are then left out; where more do, it is not used."""
SHORT = {spec.topic.removeprefix("/daq/").replace("/", "_"): spec.topic for spec in SPECS.values()}
"""Names of the channels as fields of a scan, such as ``torque_sun_frequency``."""


@dataclass(frozen=True)
class Foreign:
    """A topic in another layout, read into numbers."""

    topic: Topic
    columns: Columns
    targets: tuple[tuple[str, ChannelSpec], ...]
    moments: Moments
    rate_hz: float | None

    @property
    def sound(self) -> npt.NDArray[np.bool_]:
        """Which messages could be read."""
        return self.columns.sound()

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """Samples of each sound message: those of its longest channel."""
        per_field = [self.columns.counts[path][self.sound] for path, _ in self.targets]
        return np.asarray(np.max(per_field, axis=0))


def read_foreign(topic: Topic, findings: Findings) -> Foreign | None:
    """A topic as numbers, its messages let go; None, with findings, where nothing of it can be used."""
    try:
        columns = _columns(topic, topic.payloads)
        faults = dict(columns.faults) | _timeless(columns)
        if len(faults) > len(columns.faults):
            kept = Messages.of(payload for place, payload in enumerate(topic.payloads) if place not in faults)
            columns = _columns(topic, kept)
    except WireError as fault:
        findings.error(
            Code.MESSAGE_ENCODING,
            topic.name,
            f"{topic.count} messages '{topic.schema}' in '{topic.encoding}': {fault}; expected protobuf, json or cdr "
            "with its schema",
            "Record this topic in one of them. The other topics are read all the same.",
            lost=f"{topic.count} messages",
        )
        return None
    places_of: dict[str, list[int]] = {}
    for place, text in faults.items():
        places_of.setdefault(text, []).append(place)
    for text, places in places_of.items():
        findings.error(
            Code.MESSAGE_MALFORMED,
            topic.name,
            f"{len(places)} of {len(topic.payloads)} messages, the first number {min(places)}, cannot be read: {text}; "
            f"expected '{topic.schema}' in '{topic.encoding}'",
            "Their samples are missing. Check the recorder's encoder of this topic.",
            kept=f"the other {len(topic.payloads) - len(faults)} messages",
            lost=f"{len(places)} messages",
        )
    if not (targets := _targets(topic, columns, findings)):
        return None
    moments, used = moments_of(columns), dict.fromkeys(path for path, _ in targets)
    counts, values = ({path: each[path] for path in used} for each in (columns.counts, columns.values))
    topic.payloads.let_go()
    rate = declared_rate(topic, findings)
    return Foreign(topic, Columns(columns.size, counts, values, columns.faults), tuple(targets), moments, rate)


def _columns(topic: Topic, payloads: Messages) -> Columns:
    """Messages as numbers by field."""
    encoding, data = topic.definition
    if topic.encoding == "json":
        return read_json(payloads)
    if topic.encoding == "cdr":
        return read_columns(payloads, cdr_template(topic.schema, encoding, data.decode("utf-8", "replace")))
    if topic.encoding == ENCODING:
        return read_columns(payloads, protobuf_template(message_of(topic.schema, data)))
    raise WireError(f"encoding '{topic.encoding}' is not read")


def _timeless(columns: Columns) -> dict[int, str]:
    """Messages without the index or stamp that most of the others have, so that these few do not take it from all."""
    sound = columns.sound()
    lacking: dict[int, str] = {}
    for path, counts in columns.counts.items():
        without = sound & (counts != 1)
        if is_time(path) and 0 < np.count_nonzero(without) < MINORITY * np.count_nonzero(sound):
            lacking |= dict.fromkeys(np.flatnonzero(without).tolist(), f"field '{path}' is missing")
    return lacking


def declared_rate(topic: Topic, findings: Findings) -> float | None:
    """Rate in the metadata of a topic [Hz]; None where there is none, with a finding where it is no rate."""
    if "rate_hz" not in topic.metadata:
        return None
    try:
        rate = finite(topic.metadata["rate_hz"])
    except ValueError:
        rate = 0.0
    if 0.0 < rate <= LARGEST_RATE:
        return rate
    findings.error(
        Code.CHANNEL_VALUE,
        topic.name,
        f"rate_hz '{topic.metadata['rate_hz']}'; expected a positive number of at most {LARGEST_RATE:g}",
        "Correct it in the recorder.",
    )
    return None


def _targets(topic: Topic, columns: Columns, findings: Findings) -> list[tuple[str, ChannelSpec]]:
    """Which field is which channel."""
    paths = [path for path in columns.values if len(columns.values[path]) and not is_time(path)]
    if FIELDS_KEY in topic.metadata:
        pairs = [each.partition("=") for each in topic.metadata[FIELDS_KEY].split(",") if each.strip()]
        named = [(path.strip(), target.strip()) for path, _, target in pairs]
    elif topic.name in SPECS:
        likely = [path for path in VALUE_FIELDS if path in paths] or paths
        if len(likely) == 1 or (likely and likely[0] in VALUE_FIELDS):
            return [(likely[0], SPECS[topic.name])]
        no_field(topic, f"numbers in {likely or 'no field'}", f"one of {', '.join(VALUE_FIELDS)}", "", findings)
        return []
    else:
        plain = {path: path.removeprefix("/daq/").strip("/").replace("/", "_").replace(".", "_") for path in paths}
        named = [(path, SHORT[short]) for path, short in plain.items() if short in SHORT]
        if not named:
            hint = near_miss(next(iter(plain.values()), ""), SHORT)
            no_field(topic, f"fields {sorted(plain)[:20]}", f"some of {', '.join(SHORT)}", hint, findings)
    targets = []
    for path, target in named:
        if path not in paths or target not in SPECS:
            came = f"'{path}={target}' in metadata '{FIELDS_KEY}'"
            hint = near_miss(path, paths) if path not in paths and paths else near_miss(target, SPECS)
            no_field(topic, came, "a field of the messages and a topic of the layout", hint, findings)
        else:
            targets.append((path, SPECS[target]))
    return targets


def no_field(topic: Topic, came: str, expected: str, hint: str, findings: Findings) -> None:
    """Tell that the messages of a topic do not hold what is needed."""
    do = hint or f"Name the field in the channel's metadata '{FIELDS_KEY}': path=topic."
    findings.error(Code.MESSAGE_FIELD, topic.name, f"{came}; expected {expected}", do, lost=f"{topic.count} messages")

"""Channels that the layout expects, and the check of a recording against them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.recording.findings import LISTED, Code
from pmg.pipeline.recording.run import finite
from pmg.sim.errors import near_miss
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings

SAMPLE_SCHEMA = "pmg.v1.SampleBlock"
ENCODING = "protobuf"
SHARED_CLOCK = 0
COUNTERS = ("u32", "u64")
"""Sample types of counters."""
SMALLEST_RATE, LARGEST_RATE = 1e-6, 1e8
"""Smallest and largest sample rate taken in [Hz]; beyond them the number is a slip of the unit."""


@dataclass(frozen=True)
class ChannelSpec:
    """Specification of a channel by the layout.

    Parameters
    ----------
    topic, quantity, unit : str
        Topic, and its metadata.
    dtypes : tuple of str
        Sample types that the layout allows.
    numbers : tuple of str
        Further metadata keys that must be positive numbers when present.
    required : tuple of str
        Those of them that must be present.
    """

    topic: str
    quantity: str
    unit: str
    dtypes: tuple[str, ...]
    numbers: tuple[str, ...] = ()
    required: tuple[str, ...] = ()


def frequency(side: str) -> ChannelSpec:
    """Frequency output of a torque transducer."""
    return ChannelSpec(f"/daq/torque_{side}/frequency", "frequency", "Hz", ("f64", "f32"))


def edges(side: str) -> ChannelSpec:
    """Cumulative count of the edges of a frequency output."""
    return ChannelSpec(f"/daq/torque_{side}/edges", "count", "1", COUNTERS, ("bits",))


def edge_ticks(side: str) -> ChannelSpec:
    """Time-base tick of the last edge."""
    return ChannelSpec(
        f"/daq/torque_{side}/edge_ticks", "tick", "1", COUNTERS, ("timebase_hz", "bits"), ("timebase_hz",)
    )


def encoder(side: str) -> ChannelSpec:
    """Free-running quadrature count."""
    return ChannelSpec(f"/daq/encoder_{side}/count", "count", "1", COUNTERS, ("counts_per_rev", "bits"))


LINES = ChannelSpec("/daq/lines", "mask", "1", ("u32",))

EVENT_SCHEMAS = {
    "/daq/encoder_sun/index": "pmg.v1.IndexPulse",
    "/daq/encoder_ring/index": "pmg.v1.IndexPulse",
    "/events/lines": "pmg.v1.LineEvent",
    "/sys/clock": "pmg.v1.ClockMark",
    "/test/step": "pmg.v1.TestStep",
}
"""Topics of single messages that are read, and their schema."""

SPECS = {
    spec.topic: spec
    for spec in (
        *(make(side) for make in (frequency, edges, edge_ticks, encoder) for side in SIDES),
        LINES,
    )
}
"""Sampled channels that are read, by topic."""

TEMPERATURE_TOPICS = "/daq/temperature/"
"""Where the topics of temperatures begin; the place follows."""
KNOWN_PREFIXES = ("/daq/emf/", TEMPERATURE_TOPICS, "/drive/")
"""Topics of the layout that are read beside torque and angle, or left unread."""


def temperature(topic: str) -> ChannelSpec:
    """A temperature, on the clock of the samples."""
    return ChannelSpec(topic, "temperature", "degC", ("f64", "f32"))


def spec_of(topic: str) -> ChannelSpec:
    """The spec of a topic that `SPECS` has, or of a temperature."""
    return temperature(topic) if topic.startswith(TEMPERATURE_TOPICS) else SPECS[topic]


SCAN = "/daq/scan"
"""Topic, or beginning of topics, whose messages hold several channels."""


def wanted(topic: str) -> bool:
    """Whether the decoder reads this topic."""
    return topic in SPECS or topic in EVENT_SCHEMAS or topic.startswith(SCAN)


@dataclass(frozen=True)
class ChannelTerms:
    """Metadata of a channel that met its spec.

    Parameters
    ----------
    spec : ChannelSpec
        What it met.
    dtype : str
        Declared sample type; empty when it is not declared.
    rate_hz : float
        Sample rate [Hz].
    numbers : mapping of str to float
        Further numbers that are present.
    """

    spec: ChannelSpec
    dtype: str
    rate_hz: float
    numbers: Mapping[str, float]


def check_channel(topic: Topic, spec: ChannelSpec, findings: Findings) -> ChannelTerms | None:
    """The channel's metadata, parsed; None, with findings, where samples under it could not be trusted.

    A missing `quantity`, `unit` or `dtype` is a warning, because the layout fixes the first two and the
    message shows the third; a contradicting one is an error, and nothing is converted silently.
    """
    given = topic.metadata
    sound = _check_kind(topic, SAMPLE_SCHEMA, findings)
    for key, words in (("quantity", (spec.quantity,)), ("unit", (spec.unit,)), ("dtype", spec.dtypes)):
        expected = " or ".join(f"'{word}'" for word in words)
        if key not in given:
            findings.warning(
                Code.CHANNEL_KEY,
                topic.name,
                f"metadata '{key}' is missing; expected {expected}, and taken as that",
                _hint(key, given),
            )
        elif given[key] not in words:
            findings.error(
                Code.CHANNEL_VALUE,
                topic.name,
                f"{key} '{given[key]}'; expected {expected}",
                "Convert it in the recorder: pmg does not guess scales.",
            )
            sound = False
    numbers: dict[str, float] = {}
    for key in ("rate_hz", *spec.numbers):
        if key in given:
            value = _positive(given[key])
            if value is None or (key == "rate_hz" and not SMALLEST_RATE <= value <= LARGEST_RATE):
                findings.error(
                    Code.CHANNEL_VALUE,
                    topic.name,
                    f"{key} '{given[key]}'; expected a positive number",
                    "Correct it in the recorder.",
                )
                sound = False
            else:
                numbers[key] = value
        elif key in ("rate_hz", *spec.required):
            findings.error(
                Code.CHANNEL_KEY,
                topic.name,
                f"metadata '{key}' is missing; expected a positive number",
                _hint(key, given),
            )
            sound = False
    clock = given.get("clock_id", str(SHARED_CLOCK))
    if clock != str(SHARED_CLOCK):
        findings.error(
            Code.CHANNEL_VALUE,
            topic.name,
            f"clock_id '{clock}'; expected '{SHARED_CLOCK}', the shared sample clock",
            "Record torque and encoders on one clock.",
        )
        sound = False
    if not sound:
        return None
    rate = numbers.pop("rate_hz")
    return ChannelTerms(spec, given.get("dtype", ""), rate, numbers)


def report_unread(topics: Iterable[Topic], findings: Findings) -> None:
    """Name the topics that hold messages and are not read."""
    known = (*SPECS, *EVENT_SCHEMAS)
    unread = (topic for topic in topics if not (wanted(topic.name) or topic.name.startswith(KNOWN_PREFIXES)))
    for number, topic in enumerate(unread):
        findings.info(
            Code.TOPIC_UNKNOWN,
            topic.name,
            f"{topic.count} messages outside the layout; expected topics of layout pmg.v1. Not read",
            near_miss(topic.name, known) if number < LISTED else "",  # those beyond are only counted
        )


def _check_kind(topic: Topic, schema: str, findings: Findings) -> bool:
    if (topic.encoding, topic.schema) == (ENCODING, schema):
        return True
    findings.error(
        Code.CHANNEL_VALUE,
        topic.name,
        f"messages '{topic.schema}' in encoding '{topic.encoding}'; expected '{schema}' in '{ENCODING}'",
        "Record this topic in layout pmg.v1.",
    )
    return False


def _positive(text: str) -> float | None:
    try:
        value = finite(text)
    except ValueError:
        return None
    return value if value > 0.0 else None


def _hint(key: str, given: Mapping[str, str]) -> str:
    strange = sorted(set(given) - {"quantity", "unit", "dtype", "rate_hz", "clock_id"})
    return near_miss(key, strange) if strange else f"Add '{key}' to the channel's metadata in the recorder."

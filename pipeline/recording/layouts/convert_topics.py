"""Topics in other message layouts taken over as blocks of samples of layout pmg.v1."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import COUNTERS, ENCODING, EVENT_SCHEMAS, SAMPLE_SCHEMA, SCAN, SPECS
from pmg.pipeline.recording.container.gathered import FIELDS_KEY
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.layouts.foreign import declared_rate, no_field, read_foreign
from pmg.pipeline.recording.layouts.moments import by_stamp, rate_of, scatter
from pmg.pipeline.recording.layouts.repack import packed, repacked
from pmg.pipeline.recording.run import finite

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from pmg.pipeline.recording.channels import ChannelSpec
    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.layouts.foreign import Foreign

EARLIEST_NS = 946_684_800 * 1_000_000_000
"""The year 2000 [ns]: stamps before it count from the start of a computer."""


def convert_topics(topics: Mapping[str, Topic], findings: Findings) -> dict[str, Topic]:
    """The topics, with those in other layouts as blocks of samples.

    Parameters
    ----------
    topics : mapping of str to Topic
        Topics of the container. The messages of those that are taken over are let go.
    findings : Findings
        Receives what was taken over and how, and what could not be.

    Notes
    -----
    A topic of the layout may hold its samples as JSON, CDR or another protobuf message: in the field `VALUE_FIELDS`
    names first, or in its only field of numbers. A topic that begins with ``/daq/scan`` holds several channels, each
    in a field named as its topic with underscores (``torque_sun_frequency``), or as the channel's metadata `FIELDS_KEY`
    says: ``path=topic`` with commas between. A field holds one number or an array of samples. Units are those of the
    layout. The index comes from a field `first_sample` or `sample`; else from the stamp, index 0 being the earliest
    stamp of the file; else from the order, at the declared rate. The time of logging is not looked at.
    """
    adopted: dict[str, Topic] = {}
    foreign: list[Foreign] = []
    for name, topic in topics.items():
        if (topic.encoding, topic.schema) == (ENCODING, SAMPLE_SCHEMA) and FIELDS_KEY not in topic.metadata:
            adopted[name] = repacked(topic)
        elif name in EVENT_SCHEMAS or not topic.payloads:
            adopted[name] = topic
        elif name in SPECS or name.startswith(SCAN) or FIELDS_KEY in topic.metadata:
            if (read := read_foreign(topic, findings)) is not None:
                foreign.append(read)
            elif name in SPECS:
                adopted[name] = topic
        else:
            adopted[name] = topic
    rate = _common_rate(foreign, topics, findings)
    stamps = [int(each.moments.stamp.min()) for each in foreign if each.moments.stamp is not None]
    origin = min(stamps, default=0)
    if stamps and origin < EARLIEST_NS:
        findings.warning(
            Code.CLOCK_UNSET,
            next(each.topic.name for each in foreign if each.moments.stamp is not None),
            f"stamps begin {origin / 1e9:.3f} s after 1970; expected the time of day",
            "The clock was not set; samples are placed by their distance, and the run by started_at.",
        )
    while foreign:
        each = foreign.pop(0)
        for name, taken in _blocks(each, rate, origin, findings).items():
            if name in adopted:
                findings.error(
                    Code.CHANNEL_CONFLICT,
                    each.topic.name,
                    f"it holds {name} too; expected each channel once. Its samples are left out",
                    "Record each channel under one topic.",
                )
            else:
                adopted[name] = taken
    return adopted


def _common_rate(foreign: list[Foreign], topics: Mapping[str, Topic], findings: Findings) -> float | None:
    """The rate of topics that declare none: that of the others, else by the first stamps that tell one."""
    lacking = [each for each in foreign if each.rate_hz is None and "rate_hz" not in each.topic.metadata]
    if not lacking:
        return None
    for each in foreign:
        if each.rate_hz is not None:
            return each.rate_hz
    for name in SPECS:
        if name in topics and "rate_hz" in topics[name].metadata:
            return declared_rate(topics[name], findings)
    for each in lacking:
        if each.moments.stamp is not None:
            rate = rate_of(each.moments.stamp, each.counts)
            if rate is not None:
                findings.warning(
                    Code.MESSAGE_TIME,
                    each.topic.name,
                    f"no topic declares rate_hz; expected it in the channel's metadata. {rate:.10g} Hz by the stamps",
                    "Let the recorder write rate_hz.",
                )
                return rate
    return None


def _blocks(each: Foreign, common: float | None, origin: int, findings: Findings) -> dict[str, Topic]:
    """Topics of the layout, one for each channel that the messages hold."""
    rate = each.rate_hz if each.rate_hz is not None else common
    topic, moments = each.topic, each.moments
    if rate is None:
        if "rate_hz" not in topic.metadata:
            findings.error(
                Code.CHANNEL_KEY,
                topic.name,
                "metadata 'rate_hz' is missing, and no stamps tell it; expected a positive number",
                "Add 'rate_hz' to the channel's metadata in the recorder.",
                lost=f"{topic.count} messages",
            )
        return {}
    counts, first = each.counts, moments.index
    source = f"field '{moments.field}'"
    if moments.stamp is not None:
        first, gave_way = by_stamp(moments.stamp, counts, rate, origin)
        if gave_way:
            findings.warning(
                Code.MESSAGE_TIME,
                topic.name,
                f"stamps in '{moments.field}' scatter by {scatter(moments.stamp, rate):.2f} samples; expected less "
                "than half a sample. As many samples came as the time holds, so they are taken in their order",
                "Stamp messages with the time of the sample, not that of their making.",
                kept="all samples",
            )
    elif first is None:
        first, source = np.concatenate(([0], np.cumsum(counts[:-1]))), "their order"
        findings.warning(
            Code.MESSAGE_TIME,
            topic.name,
            "messages hold neither a sample index nor a stamp; expected one. They are taken in their order",
            "A lost message shows nowhere: let the recorder write the index.",
        )
    channels: dict[str, Topic] = {}
    for path, spec in each.targets:
        numbers = _cast(each, path, spec, findings)
        if numbers is None:
            continue
        dtype, values = numbers
        own = each.columns.counts[path][each.sound]
        metadata = {"quantity": spec.quantity, "unit": spec.unit} | dict(topic.metadata)
        metadata |= {"rate_hz": repr(rate), "dtype": dtype}
        payloads = packed(first, own, dtype, values)
        channels[spec.topic] = replace(
            topic, name=spec.topic, encoding=ENCODING, schema=SAMPLE_SCHEMA, metadata=metadata, payloads=payloads
        )
        findings.info(
            Code.MESSAGE_FIELD,
            topic.name,
            f"field '{path}' of '{topic.schema or topic.encoding}' is read as {spec.topic} [{spec.unit}] at "
            f"{rate:.10g} Hz, samples placed by {source}; expected blocks of layout pmg.v1",
            "Nothing is lost.",
        )
    return channels


def _cast(each: Foreign, path: str, spec: ChannelSpec, findings: Findings) -> tuple[str, npt.NDArray[Any]] | None:
    """Numbers as a sample type of the channel; counts below zero as their counter shows them."""
    values = each.columns.values[path]
    if "f64" in spec.dtypes:
        return "f64", values.astype(np.float64)
    if values.dtype.kind == "f":
        if not np.all(np.isfinite(values) & (values == np.rint(values)) & (np.abs(values) < 2.0**53)):
            no_field(each.topic, f"'{path}' holds numbers that are not whole", "counts", "", findings)
            return None
        values = values.astype(np.int64)
    if spec.dtypes != COUNTERS or (values.min() >= 0 and values.max() < 1 << 32):
        return "u32", values
    if "bits" in each.topic.metadata:
        bits = int(finite(each.topic.metadata["bits"])) if each.topic.metadata["bits"].isdigit() else 64
        mask = np.uint64((1 << min(max(bits, 1), 64)) - 1)
        whole = values.astype(np.uint64)
        return "u64", np.where(values < 0, whole & mask, whole)
    return "u32", (values.astype(np.uint64) & np.uint64(0xFFFF_FFFF))

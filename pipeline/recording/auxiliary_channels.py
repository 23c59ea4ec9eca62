"""Auxiliary channels of a recording: voltages of the coils, temperatures, index pulses, width of the counters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.channels import (
    SAMPLE_SCHEMA,
    TEMPERATURE_TOPICS,
    ChannelSpec,
    check_channel,
    encoder,
    temperature,
)
from pmg.pipeline.recording.events import read_events
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.recording.frequency import DEFAULT_BITS
from pmg.pipeline.recording.join import join_blocks
from pmg.pipeline.recording.layouts import wire
from pmg.pipeline.recording.run import finite
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.recording.container.contents import Topic
    from pmg.pipeline.recording.findings import Finding
    from pmg.pipeline.recording.layouts.wire import IndexPulse
    from pmg.sim.signals import Array

COILS = "/daq/emf/"
"""Where the topics of the coils begin."""
BESIDES = (COILS, TEMPERATURE_TOPICS)
"""Where the topics begin whose samples are read only where they are asked for."""
INDEX = "/daq/encoder_{}/index"


@dataclass(frozen=True)
class Coil:
    """Voltage of one coil.

    Parameters
    ----------
    name : str
        Such as ``radial_1``.
    first : int
        Sample index of the first value.
    rate_hz : float
        Sample rate [Hz].
    voltage : (n,) array
        Voltage [V], NaN where nothing was recorded.
    """

    name: str
    first: int
    rate_hz: float
    voltage: Array

    def part(self, first: int, stop: int) -> Array:
        """Voltage over these samples; NaN where it does not reach."""
        whole = np.full(max(0, stop - first), np.nan)
        low, high = max(first, self.first), min(stop, self.first + len(self.voltage))
        if low < high:
            whole[low - first : high - first] = self.voltage[low - self.first : high - self.first]
        return whole


@dataclass(frozen=True)
class AuxiliaryChannels:
    """Auxiliary channels of a recording, next to torque and angle.

    Parameters
    ----------
    coils : tuple of Coil
        By name.
    temperatures : mapping of str to tuple of float
        Lowest and highest of each place [degC].
    pulses : mapping of str to tuple of IndexPulse
        By shaft, in file order.
    bits : mapping of str to int
        Width of the counters.
    findings : tuple of Finding
        What is wrong with the coils.
    """

    coils: tuple[Coil, ...]
    temperatures: Mapping[str, tuple[float, float]]
    pulses: Mapping[str, tuple[IndexPulse, ...]]
    bits: Mapping[str, int]
    findings: tuple[Finding, ...]


NO_AUXILIARY = AuxiliaryChannels((), {}, dict.fromkeys(SIDES, ()), dict.fromkeys(SIDES, DEFAULT_BITS), ())
"""Of a recording that was not asked."""


def counter_bits(topics: Mapping[str, Topic]) -> dict[str, int]:
    """Width that the channel of each counter declares; the default where it declares none that is a number."""

    def declared(side: str) -> int:
        topic = topics.get(encoder(side).topic)
        try:
            return DEFAULT_BITS if topic is None else int(finite(topic.metadata.get("bits", "")))
        except ValueError:
            return DEFAULT_BITS

    return {side: declared(side) for side in SIDES}


def read_auxiliary_channels(
    topics: Mapping[str, Topic], bits: Mapping[str, int], findings: Findings
) -> AuxiliaryChannels:
    """Coils, temperatures and index pulses among the topics of a recording.

    Parameters
    ----------
    topics : mapping of str to Topic
        By name, their messages not yet decoded.
    bits : mapping of str to int
        Width of the counters.
    findings : Findings
        Those of the recording, which receive what is wrong with a temperature. What its index pulses lack was reported
        when the angles were decoded.
    """
    elsewhere, of_coils = Findings(findings.file), Findings(findings.file)
    coils = [
        coil
        for name in sorted(topics)
        if name.startswith(COILS) and (coil := _coil(topics[name], of_coils)) is not None
    ]
    pulses = {side: read_events(topics, INDEX.format(side), wire.index_pulse, elsewhere) for side in SIDES}
    warm = {
        name.removeprefix(TEMPERATURE_TOPICS): extremes
        for name in sorted(topics)
        if name.startswith(TEMPERATURE_TOPICS) and (extremes := _extremes(topics[name], findings)) is not None
    }
    return AuxiliaryChannels(tuple(coils), warm, pulses, bits, of_coils.listed())


def _extremes(topic: Topic, findings: Findings) -> tuple[float, float] | None:
    """Lowest and highest temperature [degC]; None, with findings, where its channel does not keep to the layout."""
    if topic.schema != SAMPLE_SCHEMA:
        findings.info(
            Code.TOPIC_UNKNOWN,
            topic.name,
            f"{topic.count} messages '{topic.schema}'; expected '{SAMPLE_SCHEMA}'. Not read",
            "Record it in blocks of samples if it is to stand among the conditions of the campaign.",
        )
        return None
    terms = check_channel(topic, temperature(topic.name), findings)
    track = None if terms is None else join_blocks(topic, terms, findings)
    known = np.zeros(0) if track is None else track.values[track.present & np.isfinite(track.values)]
    return (float(known.min()), float(known.max())) if len(known) else None


def _coil(topic: Topic, findings: Findings) -> Coil | None:
    """One coil in volts; None, with findings, where its channel does not keep to the layout."""
    spec = ChannelSpec(topic.name, "voltage", "V", ("i32", "f32", "f64"), ("scale",))
    terms = check_channel(topic, spec, findings)
    track = None if terms is None else join_blocks(topic, terms, findings)
    if terms is None or track is None:
        return None
    scale = terms.numbers.get("scale", 1.0)
    voltage = np.where(track.present, track.values.astype(np.float64) * scale, np.nan)
    return Coil(topic.name.removeprefix(COILS), track.first, terms.rate_hz, voltage)

"""What a recording holds beside torque and angle: voltages of the coils, index pulses, width of the counters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.orders.angle import find_index
from pmg.pipeline.recording.calibration import SIDES
from pmg.pipeline.recording.channels import ChannelSpec, check_channel, encoder
from pmg.pipeline.recording.container.contents import open_container
from pmg.pipeline.recording.decode import DEFAULT_BITS
from pmg.pipeline.recording.events import read_events
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.join import join_blocks
from pmg.pipeline.recording.layouts import wire

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.orders.angle import Index
    from pmg.pipeline.recording import Finding, Recording
    from pmg.pipeline.recording.container.contents import Container, Topic
    from pmg.pipeline.recording.layouts.wire import IndexPulse
    from pmg.sim.signals import Array

COILS = "/daq/emf/"
"""Where the topics of the coils begin."""
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
class Beside:
    """What a recording holds beside torque and angle.

    Parameters
    ----------
    coils : tuple of Coil
        By name.
    pulses : mapping of str to tuple of IndexPulse
        By shaft, in file order.
    bits : mapping of str to int
        Width of the counters.
    findings : tuple of Finding
        What is wrong with the coils.
    """

    coils: tuple[Coil, ...]
    pulses: Mapping[str, tuple[IndexPulse, ...]]
    bits: Mapping[str, int]
    findings: tuple[Finding, ...]

    def index(self, recording: Recording, side: str) -> Index | None:
        """Place of the index of a shaft."""
        angle = recording.samples[f"angle_{side}"].to_numpy()
        counts = recording.calibration.counts_per_rev(side)
        return find_index(angle, recording.first_sample, self.pulses[side], counts, self.bits[side])


NOTHING = Beside((), dict.fromkeys(SIDES, ()), dict.fromkeys(SIDES, DEFAULT_BITS), ())
"""Of a recording that is no longer there."""


def read_beside(path: Path, name: str | None = None) -> Beside:
    """Coils and index pulses of a recording.

    Parameters
    ----------
    path : Path
        A file of layout pmg.v1 that `read_recording` could read; damage that it told of is not told again.
    name : str, optional
        Name under which it is known in findings.

    Raises
    ------
    UnusableRecordingError
        When the file cannot be read at all.
    """
    damage, findings = Findings(name or path.name), Findings(name or path.name)
    container = open_container(path, _wanted, damage)
    topics = container.topics
    coils = [
        coil
        for topic in sorted(topics)
        if topic.startswith(COILS) and (coil := _coil(topics[topic], findings)) is not None
    ]
    pulses = {side: read_events(topics, INDEX.format(side), wire.index_pulse, damage) for side in SIDES}
    return Beside(tuple(coils), pulses, {side: _bits(container, side) for side in SIDES}, findings.told())


def _wanted(topic: str) -> bool:
    return topic.startswith(COILS) or topic in [INDEX.format(side) for side in SIDES]


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


def _bits(container: Container, side: str) -> int:
    """Width of a counter that `read_recording` has found in order."""
    topic = container.topics.get(encoder(side).topic)
    return DEFAULT_BITS if topic is None else int(float(topic.metadata.get("bits", DEFAULT_BITS)))

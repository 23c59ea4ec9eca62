"""Under which conditions a campaign was run, as far as its recordings tell."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pmg.pipeline.recording.run_records import RunRecord
    from pmg.pipeline.store.manifest import Manifest, StoredWindow

NOT_RECORDED = "not recorded"
UNRECORDED = (
    "Air temperature",
    "Bearing temperature",
    "Magnet temperature",
    "Lubricant",
    "Running-in before the test",
)
"""Conditions that the layout of recordings has no field for, or the bench no sensor."""
WORD_OF_PLACE = re.compile("[A-Z]?[a-z]+|[A-Z]+")
"""A word of the place of a temperature, such as the bearing of `bearing_ring`."""


@dataclass(frozen=True)
class Conditions:
    """Test conditions that the recordings of a campaign state.

    Parameters
    ----------
    rows : tuple of (label, value)
        In the order of a test protocol; a value that nobody wrote down is `NOT_RECORDED`.
    """

    rows: tuple[tuple[str, str], ...]


def conditions(manifests: Sequence[Manifest]) -> Conditions:
    """The conditions that the manifests of a campaign hold; without manifests nothing but what is not recorded."""
    runs = [manifest.run for manifest in manifests]
    windows = [window for manifest in manifests for window in manifest.windows]
    rows = [
        ("Campaign", _each(manifest.campaign for manifest in manifests)),
        ("Time of the test", _span(runs)),
        ("Recordings", str(len(manifests)) if manifests else NOT_RECORDED),
        ("Gear stage", _each(str(run.gear) for run in runs)),
        ("Driving side", _each(window.drive for window in windows)),
        *((f"Transducer, {side}", _transducer(manifests, side)) for side in SIDES),
        ("Encoders", _encoders(manifests)),
        ("Sampling rate", _each(f"{manifest.rate_hz:g} Hz" for manifest in manifests)),
        ("Length of a window", _lengths(windows)),
        *_temperatures(manifests),
        ("Notes of the recorder", _each(run.note for run in runs if run.note)),
    ]
    places = {place for manifest in manifests for place in manifest.temperatures}
    words = {word.lower().removesuffix("s") for place in places for word in WORD_OF_PLACE.findall(place)}
    told = {f"{word.capitalize()} temperature" for word in words}
    return Conditions((*rows, *((label, NOT_RECORDED) for label in UNRECORDED if label not in told)))


def _temperatures(manifests: Sequence[Manifest]) -> Iterator[tuple[str, str]]:
    """Range of each temperature that was recorded, over all recordings."""
    for place in sorted({place for manifest in manifests for place in manifest.temperatures}):
        ends = [manifest.temperatures[place] for manifest in manifests if place in manifest.temperatures]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        part = "" if len(ends) == len(manifests) else f", in {len(ends)} of {len(manifests)} recordings"
        yield f"Temperature, {place}", f"{low:.1f} to {high:.1f} °C{part}"


def _each(values: Iterable[str]) -> str:
    """Values that differ, in the order of their first use."""
    seen = list(dict.fromkeys(values))
    if len(seen) > 4:
        return f"{', '.join(seen[:3])} and {len(seen) - 3} more"
    return ", ".join(seen) or NOT_RECORDED


def _span(runs: Sequence[RunRecord]) -> str:
    starts = sorted(datetime.fromisoformat(run.started_at) for run in runs if run.started_at)
    if not starts:
        return NOT_RECORDED
    first, last = starts[0], starts[-1]
    if first == last:
        return f"{first:%Y-%m-%d %H:%M} UTC"
    return f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC (starts of the first and the last recording)"


def _transducer(manifests: Sequence[Manifest], side: str) -> str:
    found = []
    for manifest in manifests:
        of = manifest.calibration[side]
        parts = (f"{of.nominal_torque:g} N m", f"span {of.span_hz:g} Hz", of.serial or "no serial number")
        found.append(", ".join(parts))
    return _each(found)


def _encoders(manifests: Sequence[Manifest]) -> str:
    return _each(
        ", ".join(f"{manifest.calibration.counts_per_rev[side]} counts a turn ({side})" for side in SIDES)
        for manifest in manifests
    )


def _lengths(windows: Sequence[StoredWindow]) -> str:
    lengths = sorted({round(window.means.duration, 3) for window in windows})
    if not lengths:
        return NOT_RECORDED
    return f"{lengths[0]:g} s" if len(lengths) == 1 else f"{lengths[0]:g} to {lengths[-1]:g} s"

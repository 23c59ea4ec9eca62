"""The channels of a recording on one even clock, those of a second file with a clock of its own brought to it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.diagnosis.balance.records.channel_values import channels_in_si
from pmg.pipeline.importers.clocks.clock import Clock, EvenStretch, even_stretches
from pmg.pipeline.importers.clocks.clock_offset import offset_between
from pmg.pipeline.recording.findings import Code
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.importers.clocks.clock_offset import Offset
    from pmg.pipeline.machine.channel import Channel
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

COMMON = ("velocity", "position", "force")
"""Channels that two files may have in common, the best first."""

FEWEST_OF_SPLINE = 4
"""Samples that a cubic spline needs."""

T_95_LARGE = 1.96
"""Half-width of a 95 % interval in standard errors."""


def clock_of(path: Path, case: Case, findings: Findings) -> Clock:
    """A recording stretch by stretch on an even clock, channels in SI.

    Parameters
    ----------
    path : Path
        The file, the first of two where the second shaft has one of its own.
    case : Case
        Its channels.
    findings : Findings
        Receives what is told about times and channels.

    Raises
    ------
    RecordingError
        When a file or a channel is missing, times tell of no even sampling, or two clocks cannot be brought together.
    """
    if case.second is None:
        return _even(path, case, case.channels, case.prepare.rate_hz, findings)
    first, second = clocks_apart(path, case, findings)
    there = case.second.of(path)
    own, other = (clock.stretches[0].channels for clock in (first, second))
    where = f"{path.name} and {there.name}"
    kind = next((k for k in COMMON if k in own and OUTPUT + k in other), None)
    if kind is None:
        came, do = "no kind of channel that both hold", "Record the speed, or the torque, in both."
        raise RecordingError(where, came, "a signal that follows the same thing", do)
    one, two = (max(clock.stretches, key=lambda stretch: len(stretch.time)) for clock in (first, second))
    found = offset_between(
        (one.time, _changing(kind, one.channels[kind])),
        (two.time, _changing(kind, two.channels[OUTPUT + kind])),
        where=where,
    )
    stretches = tuple(
        whole
        for one in first.stretches
        for two in second.stretches
        if (whole := _with_second(one, two, found)) is not None
    )
    if not stretches:
        came, do = "no time in common", "Check which files belong together."
        raise RecordingError(where, came, "recordings that overlap", do)
    lost = sum(len(one.time) for one in first.stretches) - sum(len(one.time) for one in stretches)
    _tell(found, kind, lost, findings)
    return replace(first, stretches=stretches)


def clocks_apart(path: Path, case: Case, findings: Findings) -> tuple[Clock, ...]:
    """The clock of a recording, and that of the second file where there is one: at rest nothing brings them together.

    Raises
    ------
    RecordingError
        As `clock_of`.
    """
    if case.second is None:
        return (clock_of(path, case, findings),)
    own = {kind: each for kind, each in case.channels.items() if not kind.startswith(OUTPUT)}
    other = {kind: each for kind, each in case.channels.items() if kind.startswith(OUTPUT)} | {"time": case.second.time}
    return (
        _even(path, case, own, case.prepare.rate_hz, findings),
        _even(case.second.of(path), case, other, None, findings),
    )


def _even(
    path: Path, case: Case, channels: Mapping[str, tuple[Channel, float]], rate_hz: float | None, findings: Findings
) -> Clock:
    values = channels_in_si(path, case, channels, findings)
    time = values.pop("time")
    return even_stretches(time, rate_hz, values, f"{path}: time", findings)


def _with_second(one: EvenStretch, other: EvenStretch, found: Offset) -> EvenStretch | None:
    """A stretch with the channels of one of the second file at its times; None where they have none in common."""
    times = other.time + found.offset + found.drift * (other.time - found.at)
    rows = np.flatnonzero((one.time >= times[0]) & (one.time <= times[-1]))
    if len(rows) < 2 or len(times) < FEWEST_OF_SPLINE:
        return None
    inner = slice(int(rows[0]), int(rows[-1]) + 1)
    brought = {key: make_interp_spline(times, values)(one.time[inner]) for key, values in other.channels.items()}
    here = {key: values[inner] for key, values in one.channels.items()}
    return replace(one, start=float(one.time[inner][0]), time=one.time[inner], channels=here | brought)


def _changing(kind: str, values: Array) -> Array:
    """What two recordings have in common of a signal: of an angle, which counts from anywhere, how it changes."""
    return np.asarray(np.gradient(values) if kind == "position" else values)


def _tell(found: Offset, kind: str, lost: int, findings: Findings) -> None:
    """Tell the offset with its error, what it was found by, and what it can no longer show."""
    message = (
        f"the clock of the second file is {found.offset:.6g} ± {T_95_LARGE * found.offset_error:.2g} s behind (95 %) "
        f"at its {found.at:.6g} s, {1e6 * found.drift:+.0f} ± {T_95_LARGE * 1e6 * found.drift_error:.0f} ppm apart, "
        f"by the {kind} of both (correlation {found.correlation:.3f})"
    )
    if lost:
        message += f"; {lost} samples outside what both recorded are left out"
    do = "A lag between the two files is taken for their clocks." if kind == "force" else "Nothing to do."
    if found.others:
        message += f"; {', '.join(f'{other:.4g} s' for other in found.others)} would do as well"
        do = "Record something that does not repeat, or on one clock."
    (findings.warning if found.others else findings.info)(Code.CLOCK_DRIFT, "time", message, do)

"""Torque readings that a sound transducer does not give: outside its band, stuck, or its shunt switched on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.renewal import tell_renewals
from pmg.pipeline.recording.checks.stretches import joined, pieces, stretches, tell_stretches
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.join import Blemish

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.calibration import Calibration, Transducer
    from pmg.pipeline.recording.findings import Findings
    from pmg.pipeline.recording.frequency import Decoded
    from pmg.sim.signals import Array

    Ranges = npt.NDArray[np.int64]

BAND_HZ = 5_000.0, 15_000.0
"""Rated range of the frequency output [Hz]."""
APART_S = 0.05
"""Readings outside that lie closer than this are reported as one stretch [s]."""
STUCK_S, STUCK_SAMPLES = 0.1, 20
"""Least time [s] and samples of one value, to the bit, that a live transducer does not give."""
DEAD_S = 1.0
"""Least time [s] of one value where neither shaft is lively: readings of coarse steps stand still for shorter times."""
LIVELY = 0.5
"""Part of the other steps of a record that must change the value before a still stretch in it is suspicious."""
QUIET_S, QUIET_PARTS = 0.1, 3
"""Length of the parts whose noise is compared [s], and how many quiet ones behind each other make a stretch."""
QUIET = 0.2
"""Noise of a part, as part of what is usual in the record, below which a reading may stand still but for dither."""
DITHER, LIVELY_STEPS = 2.5, 3.0
"""Range of a part in steps of the readings that dither has, and noise of the others from which that is suspicious."""
DEAD = 0.02
"""Noise of a part, as part of the usual one, that no state of the bench has."""
MOST_COMPARED = 20_000
"""Samples from which the step of the readings is found."""
SHUNT, SHUNT_TOLERANCE = 0.5, 0.05
"""The shunt signal as part of the nominal torque, and by how much of the nominal torque it may be off."""
SHUNT_S, SHUNT_SAMPLES = 0.02, 5
"""Time [s] and least samples over which the torque before and after a flank is averaged."""
FLANK = 3
"""Samples within which a switch is done; a shaft under load takes longer."""
SHARED_STEP = 0.1
"""Part of a step that the other shaft may show; a load shows on both."""


def check_torques(
    sun: Decoded | None, ring: Decoded | None, calibration: Calibration, findings: Findings
) -> tuple[Blemish, ...]:
    """Stretches of both torques that are no measurement; each is a finding too.

    Parameters
    ----------
    sun, ring : Decoded or None
        Torques [N m]; None where there is none. The shunt is looked for only next to the other one.
    calibration : Calibration
        Their transducers.
    findings : Findings
        Receives what is found.

    Notes
    -----
    Outside the rated band a reading is a bound. A value that stays the same to the bit while the record, or the
    other shaft, is otherwise lively is a held value: the cable is off or the counter stopped. Where neither is
    lively, a value is held that stays for `DEAD_S`, or over the whole record: no transducer is without noise. A
    held value may have dither (`_quiet`); one that is held from each renewal to the next is told with its delay. A
    step by half the nominal torque within `FLANK` samples, and the same step back, which the other shaft does not
    see, is the shunt signal. Readings that are marked as simulated may stand still.
    """
    marks: list[Blemish] = []
    for side, track, other in (("sun", sun, ring), ("ring", ring, sun)):
        if track is None:
            continue
        transducer = calibration[side]
        _out_of_band(track, transducer, findings)
        if not any(f.code is Code.SIMULATED and f.where == track.topic for f in findings.gathered):
            words = (
                "hold one value to the bit",
                "readings with noise",
                "The cable is off, or the counter or the supply stopped. Windows over them are rejected.",
            )
            held = _held(track, other)
            tell_stretches(findings.error, Code.STUCK, track.topic, held, words, lost="{n} samples")
            quiet = np.empty((0, 2), dtype=np.int64) if len(held) else _quiet(track)
            words = (
                "stand still but for dither",
                "the noise of the rest of the record",
                "The transducer or its counter stopped for a while: check cable and supply. Windows over them are "
                "rejected.",
            )
            tell_stretches(findings.error, Code.STUCK, track.topic, quiet, words, lost="{n} samples")
            marks += [Blemish(track.topic, Code.STUCK, *stretch) for stretch in (*held.tolist(), *quiet.tolist())]
            tell_renewals(track.topic, track.values, 1.0 / track.rate_hz, findings)
        if other is None:
            continue
        words = (
            f"are shifted by about {SHUNT:.0%} of the nominal torque, on this shaft alone",
            "the torque of the shaft",
            "The shunt signal was on: switch it off before the test. Windows over them are rejected.",
        )
        shunted = _shunted(track, other, transducer.nominal_torque)
        tell_stretches(findings.error, Code.SHUNT, track.topic, shunted, words, lost="{n} samples")
        marks += [Blemish(track.topic, Code.SHUNT, start, stop) for start, stop in shunted.tolist()]
    return tuple(marks)


def _out_of_band(track: Decoded, transducer: Transducer, findings: Findings) -> None:
    (low, high), nominal = BAND_HZ, transducer.nominal_torque
    least, most = np.sort(transducer.torque(np.array(BAND_HZ)))
    if max(least, -nominal) <= track.values.min() and track.values.max() <= min(most, nominal):
        return
    apart = max(1, round(APART_S * track.rate_hz))
    outside, beyond = (np.zeros(len(track.values), dtype=np.bool_) for _ in range(2))
    for part in pieces(len(track.values)):
        torque = track.values[part]
        outside[part] = (torque < least) | (torque > most)
        beyond[part] = (np.abs(torque) > nominal) & ~outside[part]
    words = (
        f"lie outside the rated {low / 1e3:g} to {high / 1e3:g} kHz",
        "frequencies in the band. Windows over them are rejected",
        "Overload, a broken wire or a wrong calibration: readings there are bounds at best.",
    )
    found = joined(stretches(outside), apart) + track.first
    tell_stretches(findings.error, Code.OUT_OF_BAND, track.topic, found, words, kept="the other samples")
    words = (
        f"lie beyond the nominal torque of {nominal:g} N m",
        "torques within it. Windows over them are rejected",
        "The transducer was overloaded: check its zero before the next test.",
    )
    found = joined(stretches(beyond), apart) + track.first
    tell_stretches(findings.warning, Code.BEYOND_NOMINAL, track.topic, found, words, kept="the other samples")


def _held(track: Decoded, other: Decoded | None) -> Ranges:
    """Stretches of one value, as sample indices; where nothing is lively, only long ones or one over all the record."""
    least = max(STUCK_SAMPLES, round(STUCK_S * track.rate_hz))
    still = track.values[1:] == track.values[:-1]
    runs = stretches(still)
    long = runs[runs[:, 1] - runs[:, 0] + 1 >= least]
    if not len(long):
        return long
    covered = np.zeros(len(still), dtype=np.bool_)
    for start, stop in long.tolist():
        covered[start:stop] = True
    rest = ~covered & np.isfinite(track.values[1:]) & np.isfinite(track.values[:-1])
    enough = np.count_nonzero(rest) >= least
    lively = float(np.mean(~still[rest])) if enough else 0.0 if other is None else _liveliness(other)
    if lively <= LIVELY:
        known = int(np.count_nonzero(np.isfinite(track.values)))
        dead = min(max(least, round(DEAD_S * track.rate_hz)), known)
        long = long[long[:, 1] - long[:, 0] + 1 >= dead]
    return np.asarray(long + np.array([0, 1]) + track.first)


def _quiet(track: Decoded) -> Ranges:
    """Stretches that stand still but for dither while the rest of the record is lively, as sample indices.

    Of parts of `QUIET_S`, the standard deviation of the steps between samples is held against the upper quartile of
    all. A shaft at rest is quieter too, but not to one or two steps of its readings (`DITHER`), nor to `DEAD`.
    """
    nothing = np.empty((0, 2), dtype=np.int64)
    size = max(STUCK_SAMPLES, round(QUIET_S * track.rate_hz))
    count = (len(track.values) - 1) // size
    sound = np.isfinite(track.values)
    known = track.values if sound.all() else track.values[sound]
    if count < 4 * QUIET_PARTS or len(known) < 2:
        return nothing
    with np.errstate(over="ignore", invalid="ignore"):  # readings beyond any transducer are reported as out of band
        noise = np.diff(track.values[: count * size + 1]).reshape(count, size).std(axis=1)
        reach = np.ptp(track.values[: count * size].reshape(count, size), axis=1)
    noises = noise[np.isfinite(noise)]
    usual = float(np.quantile(noises, 0.75)) if len(noises) else 0.0
    gaps = np.diff(np.unique(known[:MOST_COMPARED]))
    step = float(gaps.min()) if len(gaps) else 0.0
    if usual < LIVELY_STEPS * step:
        return nothing
    found = stretches((noise < DEAD * usual) | ((noise < QUIET * usual) & (reach <= DITHER * step)))
    return np.asarray(found[found[:, 1] - found[:, 0] >= QUIET_PARTS] * size + track.first)


def _liveliness(track: Decoded) -> float:
    known = track.values[np.isfinite(track.values)]
    return float(np.mean(np.diff(known) != 0.0)) if len(known) > 1 else 0.0


def _shunted(track: Decoded, other: Decoded, nominal: float) -> Ranges:
    """Stretches between a flank up by the shunt signal and the same flank back, as sample indices."""
    nothing = np.empty((0, 2), dtype=np.int64)
    width = max(SHUNT_SAMPLES, round(SHUNT_S * track.rate_hz))
    if len(track.values) < 4 * width:
        return nothing
    if not _any_flank(track.values, 0.8 * SHUNT * nominal):
        return nothing
    step, sharp = _steps(track.values, width)
    wanted = (np.abs(np.abs(step) - SHUNT * nominal) < SHUNT_TOLERANCE * nominal) & (sharp > 0.8 * SHUNT * nominal)
    flanks = []
    for start, stop in joined(stretches(wanted), width).tolist():
        at = start + int(np.argmax(np.abs(step[start:stop])))
        place = at + track.first - other.first
        around = other.values[max(0, place - width) : place], other.values[max(0, place + FLANK) :][:width]
        if all(len(part) for part in around):
            seen = abs(float(np.mean(around[1]) - np.mean(around[0])))
            if seen > SHARED_STEP * SHUNT * nominal:
                continue
        flanks.append((at, float(step[at])))
    found = []
    while len(flanks) > 1:
        (start, up), (stop, down) = flanks[0], flanks[1]
        if abs(up + down) < SHUNT_TOLERANCE * nominal:
            found.append((start + track.first, stop + FLANK + track.first))
            flanks = flanks[2:]
        else:
            flanks = flanks[1:]
    return np.array(found, dtype=np.int64) if found else nothing


def _any_flank(values: Array, least: float) -> bool:
    """Whether the value changes by so much within `FLANK` samples anywhere."""
    if float(values.max()) - float(values.min()) <= least:
        return False
    before, after = values[: -FLANK - 1], values[FLANK + 1 :]
    return any(bool((np.abs(after[part] - before[part]) > least).any()) for part in pieces(len(before)))


def _steps(values: Array, width: int) -> tuple[Array, Array]:
    """Change of the local mean across each sample, and change of the value itself; 0 near the ends and next to gaps."""
    n = len(values)
    total = np.concatenate(([0.0], np.cumsum(np.nan_to_num(values))))
    means = (total[width:] - total[:-width]) / width
    step, sharp = np.zeros(n), np.zeros(n)
    inner = slice(width, n - width - FLANK + 1)
    step[inner] = means[width + FLANK :][: n - 2 * width - FLANK + 1] - means[: n - 2 * width - FLANK + 1]
    sharp[inner] = np.abs(values[width + FLANK : n - width + 1] - values[width - 1 : n - width - FLANK])
    unknown = np.concatenate(([0], np.cumsum(np.isnan(values))))
    low, high = np.maximum(np.arange(n) - width, 0), np.minimum(np.arange(n) + width + FLANK, n)
    spoilt = unknown[high] > unknown[low]
    step[spoilt] = sharp[spoilt] = 0.0
    return step, sharp

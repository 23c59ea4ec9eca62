"""Runs in motion of a recording, judged: which shafts turn, which samples are no measurement, which runs are lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.grid.crosschecks.declared import RATIO_LIMIT
from pmg.pipeline.motion.faults import clipped, leaps, longest_piece, spikes, stand_outs, still
from pmg.pipeline.motion.phases import spans
from pmg.pipeline.recording.checks.stretches import stretches, tell_stretches
from pmg.pipeline.recording.checks.transducers import BAND_HZ
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.recording.tracks import COLUMNS
from pmg.pipeline.store.moving_record import Extremes, MaskedStretch, MovingRecord
from pmg.pipeline.windows.gaps import missing_channels
from pmg.pipeline.wording.plurals import counted
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.motion.phases import MovingSpan
    from pmg.pipeline.recording.findings import Finding
    from pmg.pipeline.recording.read import Recording
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array, Mask

FEW_COUNTS = 10.0
"""Counts by which the angle of a shaft that is held, or at rest, may move."""
SPEED_S, ACCELERATION_S = 0.05, 0.2
"""Time over which speed and acceleration are taken [s]."""
PERIOD = REVOLUTION
"""Period of the pole angle [rad]."""
ONSET_S = 0.1
"""Time before the poles are half a period off from which a slip is left out [s]."""
RATIO_UNSURE = 0.5
"""Part of the limit of a ratio by which what the poles give way may change it over the travel of a run."""
LEAST_S, LEAST_PART = 1.0, 0.5
"""Least time [s], and part of a run, in which all signals must be known."""


def judge_motion(recording: Recording, bench: BenchParameters) -> tuple[tuple[MovingRecord, ...], tuple[Finding, ...]]:
    """The runs in motion of a recording, and what speaks against them; none of a steady recording."""
    if not recording.run.manoeuvre.moves:
        return (), ()
    findings = Findings(recording.file)
    records = tuple(_Judge(recording, bench, span, findings).record() for span in spans(recording, findings))
    return records, findings.listed()


class _Judge:
    """One run in motion while it is judged."""

    def __init__(self, recording: Recording, bench: BenchParameters, span: MovingSpan, findings: Findings) -> None:
        """Take the samples of the run."""
        self.recording, self.bench, self.span, self.findings = recording, bench, span, findings
        begin = span.first_sample - recording.first_sample
        part = recording.samples.slice(begin, span.stop_sample - span.first_sample)
        self.signals: dict[str, Array] = {name: part[name].to_numpy().copy() for name in COLUMNS}
        self.masked: list[MaskedStretch] = []
        self.reasons = list(span.reasons) + list(missing_channels(recording))

    def record(self) -> MovingRecord:
        """The run as it is kept."""
        rate, span = self.recording.rate_hz, self.span
        if not self.reasons:
            self._mask_blemishes()
            self._mask_torques()
            self._mask_angles()
            self._mask_spikes()
            self._require_motion()
            self._require_its_gear()
            self._mask_slip()
            self._require_enough()
        calibration = self.recording.calibration
        angle = per_shaft(lambda side: self.signals[f"angle_{side}"])
        speed = angle.map(lambda one: _slope(one, rate, SPEED_S))
        return MovingRecord(
            point=span.point,
            started_at_s=self.recording.time_of(span.first_sample).timestamp(),
            first_sample=span.first_sample,
            stop_sample=span.stop_sample,
            phases=span.phases,
            turns=per_shaft(lambda side: _moves(angle[side], REVOLUTION / calibration.counts_per_rev[side])),
            speed=speed.map(_extremes),
            acceleration=speed.map(lambda one: _extremes(_slope(one, rate, ACCELERATION_S))),
            masked=tuple(self.masked),
            reasons=tuple(self.reasons),
        )

    def _mask(self, column: str, found: npt.NDArray[np.int64], why: str) -> npt.NDArray[np.int64]:
        """Take stretches (k, 2) of samples of this run from a signal; gives their sample indices."""
        for start, stop in found.tolist():
            self.signals[column][start:stop] = np.nan
        there = found + self.span.first_sample
        self.masked += [MaskedStretch(column, start, stop, why) for start, stop in there.tolist()]
        return there

    def _mask_blemishes(self) -> None:
        """Samples that the recorder marks as bad, or in which the reading found a fault."""
        first, stop = self.span.first_sample, self.span.stop_sample
        for mark in self.recording.blemishes:
            side = SIDES[SIDES[1] in mark.topic]
            column = f"{'angle' if 'encoder' in mark.topic else 'torque'}_{side}"
            low, high = max(mark.start, first) - first, min(mark.stop, stop) - first
            if high > low:
                self._mask(column, np.array([[low, high]]), mark.code.value)
                if mark.code is Code.ENCODER_SLIPPED:
                    self._keep_longest(column, np.array([low, high]))

    def _mask_torques(self) -> None:
        """Torques beyond what the transducer can read, or flat at their largest value."""
        for side in SIDES:
            column, transducer = f"torque_{side}", self.recording.calibration[side]
            least, most = np.sort(transducer.torque(np.array(BAND_HZ)))
            low, high = max(least, -transducer.nominal_torque), min(most, transducer.nominal_torque)
            beyond = (self.signals[column] < low) | (self.signals[column] > high)
            self._mask(column, stretches(beyond), Code.BEYOND_NOMINAL.value)
            found = self._mask(column, clipped(self.signals[column], self.recording.rate_hz), Code.CLIPPED.value)
            words = (
                "stand at the largest value of the run to the bit",
                "readings with noise",
                "The input or the counter was at its end: use a larger range. These samples are left out.",
            )
            tell_stretches(self.findings.error, Code.CLIPPED, column, found, words, lost="{n} samples")

    def _mask_angles(self) -> None:
        """Angles while a counter stands still, and beyond a jump, where the count is off by an unknown angle."""
        for side in SIDES:
            column, rate = f"angle_{side}", self.recording.rate_hz
            count = REVOLUTION / self.recording.calibration.counts_per_rev[side]
            found = self._mask(column, still(self.signals[column], rate, count), Code.ANGLE_LOST.value)
            words = (
                "hold one count though the shaft turns right before or after",
                "a count that follows the shaft",
                "Check encoder, cable and supply. These samples are left out.",
            )
            tell_stretches(self.findings.error, Code.ANGLE_LOST, column, found, words, lost="{n} samples")
            cuts = leaps(self.signals[column], rate)
            if len(cuts):
                left = self._keep_longest(column, cuts)
                self.findings.error(
                    Code.ANGLE_LOST,
                    column,
                    f"the angle jumps before sample {int(cuts[0]) + self.span.first_sample}; expected a count that "
                    "follows the shaft",
                    "Check encoder, cable and supply. The longest piece without a jump is kept.",
                    lost=f"{left} samples",
                )

    def _mask_spikes(self) -> None:
        """Torques that stand out for an instant though the motor does not feel it, or though the shaft is held."""
        rate, inertia = self.recording.rate_hz, float(self.bench.motor.inertia)
        for side in SIDES:
            column, count = f"torque_{side}", REVOLUTION / self.recording.calibration.counts_per_rev[side]
            torque, angle = self.signals[column], self.signals[f"angle_{side}"]
            turns = _moves(angle, count)
            found = spikes(torque, angle, rate, inertia, count) if turns else stand_outs(torque, rate)
            if not len(found):
                continue
            size = max(float(np.ptp(torque[start - 1 : stop + 1])) for start, stop in found.tolist())
            what = "that the speed of the motor does not show" if turns else "on a shaft that is held"
            there = self._mask(column, found, Code.SPIKES.value)
            self.findings.warning(
                Code.SPIKES,
                column,
                f"{counted(len(found), 'spike')} of up to {size:.2g} N m {what}; expected torques that change a speed",
                "Check cable, shield and earth of the transducer. Straight lines bridge these samples.",
                sample_range=(int(there[0, 0]), int(there[-1, 1])),
                lost=counted(int(np.sum(found[:, 1] - found[:, 0])), "sample"),
            )

    def _keep_longest(self, column: str, cuts: npt.NDArray[np.int64]) -> int:
        """Leave out a signal but for its longest piece between cuts; gives the number of samples left out."""
        other = stretches(~longest_piece(len(self.signals[column]), cuts))
        self._mask(column, other, Code.ANGLE_LOST.value)
        return int(np.sum(other[:, 1] - other[:, 0]))

    def _require_motion(self) -> None:
        """A shaft that turns."""
        counts = self.recording.calibration.counts_per_rev
        if any(_moves(self.signals[f"angle_{side}"], REVOLUTION / counts[side]) for side in SIDES):
            return
        manoeuvre = self.recording.run.manoeuvre
        self._set_aside(
            Code.NO_MOTION,
            f"no shaft moves by more than {FEW_COUNTS:g} counts; expected one that turns in manoeuvre '{manoeuvre}'",
            "Check that the drives were enabled and that the encoders count.",
        )

    def _require_its_gear(self) -> None:
        """An engaged gear that the machine has, and the ratio of its speeds where another one holds throughout."""
        run, bench = self.recording.run, self.bench
        if self.reasons or run.configuration is not Configuration.ENGAGED:
            return
        if run.gear not in bench.stages:
            has = " and ".join(f"gear {stage}" for stage in bench.stages)
            message = f"declared engaged in gear {run.gear}; expected {has} of this machine"
            self._set_aside(Code.OTHER_GEAR, message, "Name the file of the machine by --machine, or correct the gear.")
            return
        gear = bench.gear(run.gear)
        found = _ratio_held(self.signals["angle_sun"], self.signals["angle_ring"], 0.5 * PERIOD / gear.pole_pairs.sun)
        if found is not None and abs(found / gear.ratio - 1.0) > RATIO_LIMIT:
            message = f"the speeds have the ratio {found:.4g} throughout; expected {gear.ratio:.4g} of gear {run.gear}"
            do = "Correct the gear of the run, the counts per turn of an encoder, or name the machine by --machine."
            self._set_aside(Code.OTHER_GEAR, message, do)

    def _mask_slip(self) -> None:
        """All signals from where the poles of the engaged gear slip past each other."""
        run, first = self.recording.run, self.span.first_sample
        if self.reasons or run.configuration is not Configuration.ENGAGED:
            return
        poles = self.bench.gear(run.gear).pole_slip(self.signals["angle_sun"], self.signals["angle_ring"])
        known = np.flatnonzero(np.isfinite(poles))
        off = np.abs(poles[known] - poles[known[0]]) if len(known) else np.zeros(0)
        if not (off > PERIOD).any():
            return
        slipped = int(np.argmax(off > PERIOD))
        onset = int(known[np.flatnonzero(off[:slipped] <= 0.5 * PERIOD)[-1]])
        start = max(0, onset - round(ONSET_S * self.recording.rate_hz))
        for column in COLUMNS:
            self._mask(column, np.array([[start, len(poles)]]), Code.POLES_SLIPPED.value)
        self.findings.error(
            Code.POLES_SLIPPED,
            self.span.point,
            f"the poles of gear {run.gear} slip from sample {start + first} on; expected a pole angle that holds",
            "The load was above the pull-out torque, the gear was not engaged, or it is another machine (--machine). "
            "Samples from there on are left out.",
            sample_range=(start + first, self.span.stop_sample),
            lost=f"{len(poles) - start} samples",
        )

    def _require_enough(self) -> None:
        """Samples in which all signals are known."""
        known: Mask = np.logical_and.reduce([np.isfinite(signal) for signal in self.signals.values()])
        seconds, part = np.count_nonzero(known) / self.recording.rate_hz, float(np.mean(known)) if len(known) else 0.0
        if not self.reasons and (seconds < LEAST_S or part < LEAST_PART):
            self._set_aside(
                Code.TOO_LITTLE,
                f"both torques and angles are known over {seconds:.2f} s, {part:.0%} of the run; expected "
                f"{LEAST_S:g} s and {LEAST_PART:.0%} at least",
                "Mend what the other findings name, and run it again.",
            )

    def _set_aside(self, code: Code, message: str, do: str) -> None:
        self.findings.error(code, self.span.point, f"{message}. The run is set aside", do)
        self.reasons.append(f"{code.value}: {message}")


def _ratio_held(sun: Array, ring: Array, gives: float) -> float | None:
    """Ratio of the speeds that holds through a whole run; None where none does, or a shaft turns too little to tell.

    The sun may be off it by what coupled poles give way, `gives` [rad].
    """
    known = np.isfinite(sun) & np.isfinite(ring)
    if not known.any():
        return None
    sun, ring = sun[known] - sun[known][0], ring[known] - ring[known][0]
    if float(np.ptp(sun)) < gives / (RATIO_UNSURE * RATIO_LIMIT) or float(np.ptp(ring)) < REVOLUTION:
        return None
    ratio = float(sun @ ring) / float(ring @ ring)
    return abs(ratio) if float(np.abs(sun - ratio * ring).max()) < gives else None


def _moves(angle: Array, count: float) -> bool:
    """Whether a shaft moves by more than a few counts."""
    known = angle[np.isfinite(angle)]
    return len(known) > 1 and bool(np.ptp(known) > FEW_COUNTS * count)


def _slope(values: Array, rate: float, seconds: float) -> Array:
    """Rate of change over so many seconds (m,)."""
    lag = max(1, round(seconds * rate))
    return np.asarray((values[lag:] - values[:-lag]) * (rate / lag))


def _extremes(values: Array) -> Extremes:
    known = values[np.isfinite(values)]
    return Extremes(float(known.min()), float(known.max())) if len(known) else Extremes(np.nan, np.nan)

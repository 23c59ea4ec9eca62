"""Values of a foreign channel turned into the samples of its topic: hertz, counts, ticks, masks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.channels import TEMPERATURE_TOPICS, spec_of
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.frequency import DEFAULT_BITS
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.units import KINDS, ZERO_CELSIUS, declared, kind_of
from pmg.sim.errors import BenchError, RecordingError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.importers.channel_map import Mapped
    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

    Index = npt.NDArray[np.int64]


@dataclass
class Conversion:
    """One channel on its way, block after block.

    Parameters
    ----------
    mapped : Mapped
        What the map says of it.
    file_unit : str
        Unit that the file declares; empty where it does not.
    calibration : Calibration
        Turns torque into frequency and angle into counts, as it will turn them back.
    in_map : str
        Place in the map, for messages.
    where, place : str
        File and channel, and what rows are counted in, for messages.
    findings : Findings
        Receives what is missing.

    Raises
    ------
    BenchError
        When the unit is not known, or map and file contradict each other.

    Notes
    -----
    A torque [N m] becomes the frequency that the calibration turns back into it. An angle is cut down to whole
    counts of the encoder. A speed is added up by the trapezoidal rule to an angle first, so that the mean speed over
    a window comes back to within one count over its length; what the shaft did between two samples is not in it.
    """

    mapped: Mapped
    file_unit: str
    calibration: Calibration
    in_map: str
    where: str
    place: str
    findings: Findings
    unit: str = field(init=False)
    kind: str = field(init=False)
    missing: int = field(default=0, init=False)
    _first_missing: int = field(default=0, init=False)
    _last: tuple[int, float, float] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        mapped = self.mapped
        file_unit = declared(self.file_unit)
        spec = spec_of(mapped.topic)
        counter = spec.unit == "1"
        self.unit = declared(mapped.unit) or file_unit or ("1" if counter else "")
        if not self.unit:
            do = f"Add `unit` to [[channel]], such as '{spec.unit}'."
            raise BenchError(self.in_map, "no unit, neither in the map nor in the file", "one of them", do)
        if file_unit not in ("", self.unit, declared(mapped.file_unit)):
            came = f"unit '{mapped.unit}', but '{self.file_unit}' in the file"
            do = f"Correct the map; or add file_unit = '{self.file_unit}' to say that the file is wrong."
            raise BenchError(self.in_map, came, "one unit", do)
        self.kind = kind_of(mapped.topic, self.unit, self.in_map)
        if self.kind == "electric" and not mapped.torque_per_unit:
            do = "Add the sensitivity of the analogue output."
            raise BenchError(f"{self.in_map}: Nm_per_unit", "missing or 0", "N m of one unit", do)
        if self.kind in ("frequency", "temperature") and mapped.sign < 0:
            do = "Turn the sign of span_Hz in the calibration." if self.kind == "frequency" else "Leave it out."
            raise BenchError(f"{self.in_map}: sign", f"-1 for a {self.kind}", "1", do)

    @property
    def side(self) -> str:
        """Shaft that the topic is about; for the lines, any."""
        return "ring" if "_ring/" in self.mapped.topic else "sun"

    @property
    def dtype(self) -> str:
        """Type of the samples."""
        return spec_of(self.mapped.topic).dtypes[0]

    @property
    def bits(self) -> int:
        """Width of the counter in the recording: that of the source where it fits."""
        encoder = self.mapped.topic.endswith("/count")
        return (
            self.mapped.bits if encoder and self.kind == "count" and self.mapped.bits < DEFAULT_BITS else DEFAULT_BITS
        )

    @property
    def continuous(self) -> bool:
        """Whether what lies between two samples lies between their values; not so of ticks, edges and lines."""
        return self.mapped.topic.startswith(TEMPERATURE_TOPICS) or self.mapped.topic.endswith(("/frequency", "/count"))

    def counted_on(self, values: npt.NDArray[Any]) -> Array:
        """Values in their own unit without the steps at which they begin anew (n,); NaN where one is missing."""
        found = np.asarray(values, dtype=np.float64).copy()
        period = 2.0**self.mapped.bits if self.kind == "count" else self.mapped.wraps_at
        if period is not None and self.kind in ("count", "angle"):
            known = np.isfinite(found)
            found[known] = np.unwrap(found[known], period=period)
        return found

    def as_recorded(self, values: Array) -> Array:
        """Values of `counted_on` as `samples` takes them (n,): counts whole, and of their width."""
        return np.asarray(np.rint(values) % 2.0**self.mapped.bits if self.kind == "count" else values)

    def metadata(self, rate_hz: float) -> dict[str, str]:
        """Metadata of the channel in the recording."""
        spec = spec_of(self.mapped.topic)
        found = {"quantity": spec.quantity, "unit": spec.unit, "dtype": self.dtype, "rate_hz": repr(rate_hz)}
        found |= {"clock_id": "0", "imported_from": self.mapped.wanted.name, "imported_unit": self.unit}
        if self.mapped.topic.endswith("/count"):
            counts = str(self.calibration.counts_per_rev[self.side])
            found["counts_per_rev"] = counts
        if "bits" in spec.numbers:
            found["bits"] = str(self.bits)
        if self.mapped.timebase_hz is not None:
            found["timebase_hz"] = repr(self.mapped.timebase_hz)
        return found

    def samples(
        self, values: npt.NDArray[Any], index: Index, places: Index, rate_hz: float
    ) -> tuple[Index, npt.NDArray[Any]]:
        """Indices and samples of the rows that have both a place in time and a value.

        Raises
        ------
        RecordingError
            When a counter holds something that is no count of its width.
        """
        known = np.isfinite(values)
        lost = ~known & (index >= 0)
        if lost.any():
            self._first_missing = self._first_missing or int(places[np.argmax(lost)])
            self.missing += int(np.count_nonzero(lost))
        known &= index >= 0
        values, index, places = values[known], index[known], places[known]
        if not len(values):
            return index, np.zeros(0)
        if self.kind == "count":
            return index, self._counts(values, places)
        si = np.asarray(values, dtype=np.float64) * KINDS[self.kind][self.unit]
        if self.kind == "frequency":
            return index, si
        if self.kind == "temperature":
            return index, si - (ZERO_CELSIUS if self.unit == "K" else 0.0)
        if self.kind in ("torque", "electric"):
            return index, self.calibration[self.side].frequency(self._torque(values, si))
        angle = self._angle(si, index, rate_hz)
        counts = np.floor(angle / (REVOLUTION / self.calibration.counts_per_rev[self.side])).astype(np.int64)
        return index, counts % (1 << DEFAULT_BITS)

    def finish(self) -> None:
        """Tell what was missing."""
        if self.missing:
            self.findings.error(
                Code.NOT_FINITE,
                f"{self.where}, from {self.place} {self._first_missing}",
                f"{counted(self.missing, 'value')} missing; expected one in each row. What is missing becomes a gap",
                "Check the input's wiring and the recorder's conversion.",
                lost=f"{counted(self.missing, 'sample')} of {self.mapped.topic}",
            )

    def _torque(self, values: npt.NDArray[Any], si: Array) -> Array:
        if self.kind == "torque":
            return self.mapped.sign * si
        assert self.mapped.torque_per_unit is not None  # checked when the conversion was made
        return np.asarray(self.mapped.sign * (values - self.mapped.zero) * self.mapped.torque_per_unit)

    def _angle(self, si: Array, index: Index, rate_hz: float) -> Array:
        """Angle [rad] without wraps, from an angle or from a speed [rad/s]."""
        si = self.mapped.sign * si
        row, value, angle = self._last or (int(index[0]), float(si[0]), 0.0 if self.kind == "speed" else float(si[0]))
        if self.kind == "speed":
            means = (si + np.concatenate(([value], si[:-1]))) / 2.0
            steps = means * np.diff(index, prepend=row) / rate_hz
        else:
            steps = np.diff(si, prepend=value)
            if self.mapped.wraps_at is not None:
                turn = self.mapped.wraps_at * KINDS["angle"][self.unit]
                steps = (steps + turn / 2.0) % turn - turn / 2.0
        absolute = self.kind == "angle" and self.mapped.wraps_at is None
        found = si if absolute else angle + np.cumsum(steps)
        self._last = int(index[-1]), float(si[-1]), float(found[-1])
        return np.asarray(found)

    def _counts(self, values: npt.NDArray[Any], places: Index) -> npt.NDArray[Any]:
        bits = self.mapped.bits
        low, high = -(1 << (bits - 1)), 1 << bits
        odd = (values < low) | (values >= high) | (np.floor(values) != values)
        if odd.any():
            row = int(np.argmax(odd))
            came, do = f"{values[row]:.17g}", "Correct `bits` in the map, or map another channel."
            expected = f"a whole number that fits into {bits} bits"
            raise RecordingError(f"{self.where}, {self.place} {places[row]}", came, expected, do)
        whole = (self.mapped.sign * values.astype(np.int64)) % high
        return np.asarray(whole % (1 << DEFAULT_BITS))

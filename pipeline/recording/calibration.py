"""The calibration that travels inside each recording, and the torque that it makes of a frequency."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.run import LARGEST_NUMBER, SUPPLY
from pmg.sim.errors import near_miss
from pmg.sim.shafts import SIDES, PerShaft

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

ATTACHMENT = "calibration.toml"
SIZES = 1e-9, LARGEST_NUMBER
"""Sizes of the numbers of a calibration, beyond which there is no transducer and no encoder."""
LONGEST_SERIAL = 64
"""Bits of a serial number that is written as a number."""
NUMBERS = ("null_frequency_Hz", "nominal_torque_Nm", "span_Hz")


@dataclass(frozen=True)
class Transducer:
    """Sensitivity of a torque transducer with frequency output.

    Parameters
    ----------
    null_frequency_hz : float
        Frequency at no torque [Hz].
    nominal_torque : float
        Rated torque [N m].
    span_hz : float
        Change of frequency from no torque to the rated one [Hz].
    serial : str
        Serial number.
    """

    null_frequency_hz: float
    nominal_torque: float
    span_hz: float
    serial: str

    def torque(self, frequency: Array) -> Array:
        """Torque [N m] at a frequency [Hz]."""
        return (frequency - self.null_frequency_hz) / self.span_hz * self.nominal_torque

    def frequency(self, torque: Array) -> Array:
        """Frequency [Hz] at a torque [N m]."""
        return self.null_frequency_hz + torque / self.nominal_torque * self.span_hz


@dataclass(frozen=True)
class Calibration(PerShaft[Transducer]):
    """Transducers and encoders of both shafts.

    Parameters
    ----------
    sun, ring : Transducer
        Torque transducers.
    counts_per_rev_sun, counts_per_rev_ring : int
        Quadrature counts of one revolution.
    """

    counts_per_rev_sun: int
    counts_per_rev_ring: int

    @property
    def counts_per_rev(self) -> PerShaft[int]:
        """Encoder counts per revolution of each shaft."""
        return PerShaft(self.counts_per_rev_sun, self.counts_per_rev_ring)


def read_calibration(attachments: Iterable[tuple[str, bytes]], findings: Findings) -> Calibration | None:
    """The calibration among the attachments; None, with findings, where there is none that can be used."""
    listed = list(attachments)
    found = {data for name, data in listed if name == ATTACHMENT}
    if len(found) != 1:
        names = [name for name, _ in listed]
        findings.error(
            Code.CALIBRATION_MISSING,
            f"attachment '{ATTACHMENT}'",
            f"{len(found)} different ones among the attachments {names}; expected exactly one",
            "Without it a frequency is no torque: attach the calibration in the recorder"
            + (", exactly one." if found else f", or name one in {SUPPLY}."),
        )
        return None
    try:
        table = tomllib.loads(found.pop().decode("utf-8"))
    except (ValueError, RecursionError) as fault:  # no UTF-8, no TOML, thousands of digits or of brackets
        _fault(findings, "", f"it cannot be parsed ({fault})", "TOML text in UTF-8", "Correct the attachment.")
        return None
    sun, ring = (_transducer(table, side, findings) for side in SIDES)
    counts_sun, counts_ring = (_counts(table, side, findings) for side in SIDES)
    if sun is None or ring is None or counts_sun is None or counts_ring is None:
        return None
    return Calibration(sun, ring, counts_sun, counts_ring)


def _transducer(table: Mapping[str, Any], side: str, findings: Findings) -> Transducer | None:
    place = f"transducer.{side}"
    entries = _section(table, "transducer", side, findings)
    if entries is None:
        return None
    values = {key: _number(entries, key, place, findings) for key in NUMBERS}
    null, nominal, span = values.values()
    if null is None or nominal is None or span is None:
        return None
    if nominal <= 0.0 or span == 0.0 or null <= 0.0:
        came = f"nominal torque {nominal}, span {span}, null frequency {null}"
        _fault(findings, place, came, "positive torque and null, span other than 0", "Correct the attachment.")
        return None
    serial = entries.get("serial", "")
    if not isinstance(serial, str | int) or (isinstance(serial, int) and serial.bit_length() > LONGEST_SERIAL):
        _fault(findings, f"{place}.serial", f"a {type(serial).__name__}", "text in quotation marks", "Correct it.")
        return None
    return Transducer(null, nominal, span, str(serial))


def _counts(table: Mapping[str, Any], side: str, findings: Findings) -> int | None:
    place = f"encoder.{side}"
    entries = _section(table, "encoder", side, findings)
    value = None if entries is None else _number(entries, "counts_per_rev", place, findings)
    if value is None:
        return None
    if value < 1.0 or value != int(value):
        _fault(findings, f"{place}.counts_per_rev", f"{value}", "a whole number above 0", "Correct it.")
        return None
    return int(value)


def _section(table: Mapping[str, Any], kind: str, side: str, findings: Findings) -> Mapping[str, Any] | None:
    group = table.get(kind)
    entries = group.get(side) if isinstance(group, dict) else None
    if isinstance(entries, dict):
        return entries
    _fault(findings, f"{kind}.{side}", "the table is missing", f"a table [{kind}.{side}]", "Add it.")
    return None


def _number(entries: Mapping[str, Any], key: str, place: str, findings: Findings) -> float | None:
    value = entries.get(key)
    if isinstance(value, int | float) and not isinstance(value, bool):
        if value == 0 or SIZES[0] <= abs(value) <= SIZES[1]:
            return float(value)
        came = f"a whole number of {value.bit_length()} bits" if isinstance(value, int) else f"{value:g}"
        _fault(findings, f"{place}.{key}", came, f"a size from {SIZES[0]:g} to {SIZES[1]:g}", "Correct it.")
        return None
    came = (
        "the key is missing"
        if key not in entries
        else f"a {type(value).__name__}"
        if isinstance(value, dict | list)
        else f"{value!r:.80}"
    )
    hint = near_miss(key, entries) if key not in entries and entries else "Correct the attachment."
    _fault(findings, f"{place}.{key}", came, "a finite number", hint)
    return None


def _fault(findings: Findings, place: str, came: str, expected: str, do: str) -> None:
    where = f"{ATTACHMENT} {place}".strip()
    findings.error(Code.CALIBRATION_VALUE, where, f"{came}; expected {expected}", do)

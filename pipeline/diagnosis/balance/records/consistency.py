"""Channels of a recording against each other: position and speed, and what stands at its limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.diagnosis.balance.known_terms import of_its_recordings
from pmg.pipeline.machine.axis import DEGREE
from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.findings import Code
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.library.term import Motion
    from pmg.pipeline.diagnosis.balance.records.smoothing import Smoother
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

SPEED_TOLD = 2e-3
"""Part by which a recorded speed may differ from the slope of the recorded position before it is told."""

LIMIT_TOLD, LIMIT_RUN = 0.002, 5
"""Part of the samples that stand at the largest or smallest value, and how many of them in a row, that are told."""

OVERLOAD = 1.2
"""Part of the nominal value of a transducer from which on there is a warning."""

WRONG_UNITS = {
    1.0 / RPM: "as if rpm were read as rad/s",
    RPM: "as if rad/s were read as rpm",
    1.0 / DEGREE: "as if deg were read as rad",
    DEGREE: "as if rad were read as deg",
    REVOLUTION: "as if rad were read as turns",
    1.0 / REVOLUTION: "as if turns were read as rad",
    4.0: "as with edges counted four times",
    0.25: "as with a quarter of the edges",
    -1.0: "as with a sign turned",
}
"""Speeds over slopes of positions that a wrong unit makes."""


def check_motion(values: Mapping[str, Array], smoother: Smoother, findings: Findings) -> None:
    """Tell a recorded speed that is not the slope of the recorded position (of either shaft).

    Parameters
    ----------
    values : mapping of str to (n,) array
        Channels in SI.
    smoother : Smoother
        The low-pass of both.
    findings : Findings
        Receives what differs, with its factor.
    """
    for end in ("", OUTPUT):
        if f"{end}position" not in values or f"{end}velocity" not in values:
            continue
        slope = smoother.slope(smoother.smooth(values[f"{end}position"]))[smoother.settles : -smoother.settles]
        speed = smoother.smooth(values[f"{end}velocity"])[smoother.settles : -smoother.settles]
        size = float(slope @ slope)
        factor = float(slope @ speed) / size if size > 0.0 else 1.0
        if abs(factor - 1.0) < SPEED_TOLD:
            continue
        near = [words for known, words in WRONG_UNITS.items() if abs(factor / known - 1.0) < 10.0 * SPEED_TOLD]
        message = f"the recorded speed is {factor:.5g} times the slope of the recorded position"
        do = "Correct the unit, the sign or the counts per turn of one of them; both were used as they are."
        findings.warning(Code.CHANNEL_VALUE, f"{end}velocity", ", ".join([message, *near]), do)


def check_limits(values: Mapping[str, Array], findings: Findings) -> None:
    """Tell a force or torque that stands at its largest or smallest value: a drive at its limit, or a clipped reading.

    Parameters
    ----------
    values : mapping of str to (n,) array
        Channels in SI.
    findings : Findings
        Receives it with its value and share.
    """
    for kind in ("force", f"{OUTPUT}force"):
        force = values.get(kind)
        if force is None or float(np.ptp(force)) == 0.0:
            continue
        for name, at in (("largest", force == force.max()), ("smallest", force == force.min())):
            share = float(np.mean(at))
            if share < LIMIT_TOLD or np.diff(stretches(at)).max() < LIMIT_RUN:
                continue
            value = float(force.max() if name == "largest" else force.min())
            findings.warning(
                Code.CHANNEL_VALUE,
                kind,
                f"it stands at its {name} value, {value:.4g} N or N m, in {100.0 * share:.1f} % of the samples",
                "A drive at its limit, or a reading that is clipped: what acts there is not what is recorded.",
            )


def check_nominal(values: Mapping[str, Array], nominal: Mapping[str, float], unit: str, findings: Findings) -> None:
    """Tell a torque or force beyond what its transducer is made for, for longer than a few samples.

    Parameters
    ----------
    values : mapping of str to (n,) array
        Channels in SI.
    nominal : mapping of str to float
        Nominal value of the transducer of a channel [N, N m].
    unit : str
        Of both.
    findings : Findings
        Receives what is exceeded in `LIMIT_TOLD` of the samples.
    """
    for kind, most in nominal.items():
        reached = float(np.quantile(np.abs(values[kind]), 1.0 - LIMIT_TOLD)) if kind in values else 0.0
        if reached > OVERLOAD * most:
            message = f"{reached:.4g} {unit} is exceeded in {LIMIT_TOLD:.1%} of the samples, on a transducer of "
            message += f"{most:.4g} {unit}"
            do = "Correct the unit, the factor or the channel; a transducer that was overloaded is calibrated anew."
            findings.warning(Code.CHANNEL_VALUE, kind, message, do)


def check_known(name: str, motion: Motion, case: Case) -> None:
    """Refuse a known term that needs a channel which was not recorded, or whose size these recordings do not share."""
    for each in case.known:
        if missing := set(each.term.needs) - set(motion.besides):
            came, do = f"no {' and no '.join(sorted(missing))}", f"Name the channel, or leave {each.term.key} out."
            raise RecordingError(name, came, f"what the known term {each.term.key} needs", do)
        if of_its_recordings(each.term, motion, each.shape):
            came = f"the known term {each.term.key}, whose size goes with the recordings that it was found in"
            raise RecordingError(name, came, "one that is the same in all", "Leave it out of [model.known].")


def check_seen(name: str, free: Array, names: Sequence[str]) -> None:
    """Refuse a term of the baseline that recordings with zeros of their own cannot show, by its column (n, k)."""
    gone = [term for term, column in zip(names, free.T, strict=True) if not column.any()]
    if gone:
        came = f"{', '.join(gone)} is the same throughout each recording, as its zero"
        do = 'Set zeros = "common", leave it out of the baseline, or record both directions.'
        raise RecordingError(name, came, "recordings that tell it from their zeros", do)

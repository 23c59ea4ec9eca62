"""The two encodings of one torque, edges and frequency, against each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.recording.calibration import Transducer
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

APART_OF_NOMINAL = 0.002
"""How far two encodings of one torque may be apart in the mean, as part of the nominal torque."""


def compare_encodings(
    values: tuple[Array, Array], firsts: tuple[int, int], transducer: Transducer, topic: str, findings: Findings
) -> None:
    """Compare the torque by the edges, which is used, with the one by the frequency that was recorded next to them.

    Parameters
    ----------
    values : two arrays
        Frequencies [Hz] by the edges, and those recorded.
    firsts : two int
        Index of the first sample of each.
    transducer : Transducer
        Gives the torques.
    topic : str
        Of the frequency.
    findings : Findings
        Receives how far they are apart: an error beyond `APART_OF_NOMINAL`.
    """
    begin = max(firsts)
    parts = [each[begin - first :] for each, first in zip(values, firsts, strict=True)]
    count = min(map(len, parts))
    by_edges, by_frequency = (transducer.torque(part[:count]) for part in parts)
    known = np.isfinite(by_edges) & np.isfinite(by_frequency)
    limit = APART_OF_NOMINAL * transducer.nominal_torque
    if not known.any():
        message = (
            "the frequency next to the edges holds no sample that they hold; expected both over the run. The edges"
        )
        findings.info(Code.CHANNEL_CONFLICT, topic, f"{message} are used", "Nothing is lost.")
        return
    off = abs(float(np.mean(by_edges[known] - by_frequency[known])))
    if off <= limit:
        findings.info(
            Code.CHANNEL_CONFLICT,
            topic,
            f"the torque is recorded as frequency and as edges; both agree to {1e3 * off:.2f} mN m, limit "
            f"{1e3 * limit:.1f} mN m. The edges are used",
            "Nothing is lost.",
        )
        return
    findings.warning(
        Code.TORQUES_DISAGREE,
        topic,
        f"the torques by this frequency and by the edges next to it are {off:.3f} N m apart in the mean, limit "
        f"{limit:.3f} N m. The edges are used",
        "Find out which is wrong (timebase_hz, rate_hz, wiring), and record that one no more.",
    )

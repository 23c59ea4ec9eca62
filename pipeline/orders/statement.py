"""A line that is present, in a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pmg.pipeline.orders.survey import LineSurvey

UNITS = {"torque": ("mN m", 1e-3), "speed": ("rpm", RPM), "flux": ("mT", 1e-3)}
"""Display unit of each kind of signal, and its SI value."""


def unit_of(signal: str) -> tuple[str, float]:
    """Display unit of a signal, and its SI value."""
    return UNITS[signal.split("_")[0]]


def statement(line: LineSurvey) -> str:
    """One sentence on a line that is present."""
    unit, scale = unit_of(line.signal)
    size = f"{line.amplitude.value / scale:.3g} {unit} (u {line.amplitude.u / scale:.2g})"
    text = f"{line.signal}, {line.line}, {line.configuration} gear {line.gear}: {size}"
    text += f", beyond its band in {line.beyond} of {line.points} points"
    if line.exponent is not None:
        text += f"; grows with speed to the power {line.exponent.value:.3f} (u {line.exponent.u:.3f})"
    if line.per_load is not None:
        change = abs(line.per_load.value) > 2.0 * line.per_load.u
        rate = f"{line.per_load.value / scale:+.2g} {unit} per N m of load (u {line.per_load.u / scale:.1g})"
        text += f"; {rate}" if change else f"; no growth with load beyond 2 u: {rate}"
    return f"{text}. {line.remark[:1].upper()}{line.remark[1:]}."

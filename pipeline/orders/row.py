"""One line of one signal at one point, as it is stored and reported."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from pmg.pipeline.orders.fit import Orders
    from pmg.pipeline.orders.lines import Group, Line


@dataclass(frozen=True)
class OrderRow:
    """One line of one signal at one point; numbers are NaN where `reason` says why there are none.

    Parameters
    ----------
    signal : str
        ``torque_sun`` [N m], ``speed_sun`` [rad/s], ``flux_radial_1`` [T] and so on.
    line : str
        Name of the group.
    order_sun, order_ring : int
        Of its first line.
    rate : float
        Rate of its phase [rad/s].
    amplitude, u, low, high, band : float
        Amplitude, its standard uncertainty, ends of its 95 % interval, and what noise exceeds in 5 % of lines.
        Of a speed, the steps of the encoder are in them.
    dof : float
        Degrees of freedom of the noise.
    phase, u_phase : float
        Phase against the zero of the angles, and its standard uncertainty by noise and index [rad].
    u_delay : float
        Standard uncertainty of the phase by what a sample of torque may stand behind that of angle [rad].
    from_index : bool
        Whether the zero of the angles is that of the index pulses; else it is the first sample of the window.
    reason : str
        Why there are no numbers.
    """

    signal: str
    line: str
    order_sun: int
    order_ring: int
    rate: float
    amplitude: float
    u: float
    low: float
    high: float
    band: float
    dof: float
    phase: float
    u_phase: float
    u_delay: float
    from_index: bool
    reason: str


@dataclass(frozen=True)
class LineFit:
    """Fit of one line in one signal: amplitude, its uncertainty, interval and band."""

    c: complex
    u: float
    dof: float
    low: float
    high: float
    band: float

    @classmethod
    def of(cls, orders: Orders, at: int, place: int) -> Self:
        """Of the signal and the group at these places."""
        low, high = orders.interval
        return cls(
            complex(orders.amplitude[at, place]),
            float(orders.u[at, place]),
            float(orders.dof[at, place]),
            float(low[at, place]),
            float(high[at, place]),
            float(orders.band[at, place]),
        )


@dataclass(frozen=True)
class Made:
    """Conversion of a fit to a line of the signal.

    Parameters
    ----------
    rate : float
        Rate of the phase [rad/s].
    per_sample : float
        Phase of one sample [rad].
    factor : complex
        What turns the amplitude that was fitted into that of the signal.
    counted : float
        Amplitude that the steps of an encoder may make, in the unit of what was fitted.
    from_index : bool
        Whether the zero of the angles is that of the index pulses.
    u_zero : float
        Standard uncertainty of the phase by them [rad].
    """

    rate: float
    per_sample: float
    factor: complex
    counted: float
    from_index: bool
    u_zero: float


def fitted_row(signal: str, group: Group, found: LineFit, made: Made) -> OrderRow:
    """One line of one signal; without numbers where nothing tells its noise."""
    line = group.lines[0]
    if not math.isfinite(found.band):
        return empty_row(signal, line, "too few bins of noise next to it", group.name)
    size, scale = found.c * made.factor, abs(made.factor)
    u = math.hypot(found.u, made.counted / math.sqrt(2.0))
    band = math.hypot(found.band, made.counted)
    seen = abs(found.c) > band
    length = math.sqrt(abs(found.c) ** 2 - 2.0 * u**2) if seen else math.nan
    return OrderRow(
        signal=signal,
        line=group.name,
        order_sun=line.order_sun,
        order_ring=line.order_ring,
        rate=made.rate,
        amplitude=abs(size),
        u=u * scale,
        low=max(found.low - made.counted, 0.0) * scale if seen else 0.0,
        high=(found.high + made.counted) * scale,
        band=band * scale,
        dof=found.dof,
        phase=math.atan2(size.imag, size.real) if seen else math.nan,
        u_phase=math.hypot(u / length, made.u_zero),
        u_delay=abs(made.per_sample) / math.sqrt(3.0),
        from_index=made.from_index,
        reason="",
    )


def empty_row(signal: str, line: Line, reason: str, name: str = "") -> OrderRow:
    """A line without numbers."""
    no = math.nan
    return OrderRow(
        signal, name or line.name, line.order_sun, line.order_ring, *(no,) * 10, from_index=False, reason=reason
    )

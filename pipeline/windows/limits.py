"""Limits of a steady window, such as speed drift, and of a change between two: fixed before any window is looked at."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

from pmg.pipeline.wording.quantities import RATE, RATIO, SPEED_OF_SHAFT, TIME_SPAN, Dimension
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Mapping

SPEEDS = ("speed_change", "speed_offset", "step_speed")
"""Limits that a file may give as numbers in rpm, with that unit in their name."""
DIMENSIONS: dict[str, Dimension] = {
    **dict.fromkeys(SPEEDS, SPEED_OF_SHAFT),
    **dict.fromkeys(("shortest", "step_beside", "settle"), TIME_SPAN),
    **dict.fromkeys(("frequency_low", "frequency_high"), RATE),
    **dict.fromkeys(("completeness", "speed_change_relative", "speed_offset_relative"), RATIO),
    **dict.fromkeys(("torque_drift", "step_torque"), RATIO),
}
"""Kinds of limits that may be written with their unit, such as ``speed_change = "0.5 rpm"``."""


MEANING = "meaning"
"""Key of the metadata of a field of `Steadiness` with its meaning in a phrase."""


def _limit(value: float, meaning: str) -> Any:  # noqa: ANN401 - what a dataclass takes for a field
    """A limit: its default and its meaning."""
    return field(default=value, metadata={MEANING: meaning})


@dataclass(frozen=True)
class Steadiness:
    """Limits for a steady window.

    Parameters
    ----------
    shortest : float
        Shortest window [s]: two periods of the 0.5 Hz filter's cut-off would be 4 s; below 1 s the batches that
        give the uncertainty are shorter than the control loop's settling.
    completeness : float
        Least part of the length that the test step announces; a shorter one was cut off.
    speed_change : float
        Largest difference between the mean speeds of both halves, and largest standard deviation among the ten
        parts [rad/s]. Half a rpm over a window accelerates the rotors by less than the transducers resolve.
    speed_change_relative : float
        The same, as part of the speed; the larger of both limits holds.
    parts : int
        Parts of the window whose speeds are compared.
    counts : float
        Encoder counts per part that are added to the limit, so that the resolution alone never trips it.
    speed_offset, speed_offset_relative : float
        Largest distance from the set-point [rad/s] and as part of it; the sum of both holds. Beyond, the controller
        has not reached its target or the set-point in the file is another run's.
    torque_drift : float
        Largest change of the torque over the window, largest difference between its halves and largest excursion of
        one of its batches, as part of the nominal torque.
    torque_drift_sigmas : float
        Each must also be this many of its own standard errors: noise alone never trips the check. Warming up
        during a window stays far below both.
    frequency_low, frequency_high : float
        Rated range of the transducers' frequency output [Hz].
    step_speed, step_torque : float
        Where nothing marks the test points: change of a speed [rad/s], or of a torque as part of the nominal one,
        that ends a plateau. Set-points of the bench's grids lie farther apart.
    step_beside : float
        Stretch before and after a place whose means are compared to see such a change [s].
    settle : float
        Time after a change that belongs to no plateau [s].
    """

    shortest: float = _limit(1.0, "shortest window")
    completeness: float = _limit(0.9, "least part of the announced length")
    speed_change: float = _limit(0.5 * RPM, "largest change of a speed within a window")
    speed_change_relative: float = _limit(0.002, "the same, as part of the speed; the larger of both holds")
    parts: int = _limit(10, "parts of a window whose speeds are compared")
    counts: float = _limit(2.0, "encoder counts per part that are added to the change allowed")
    speed_offset: float = _limit(2.0 * RPM, "largest distance of a speed from its set-point")
    speed_offset_relative: float = _limit(0.005, "the same, as part of the set-point; the sum of both holds")
    torque_drift: float = _limit(0.01, "largest change of a torque within a window, as part of the nominal torque")
    torque_drift_sigmas: float = _limit(8.0, "and least size of it, in its own standard errors")
    frequency_low: float = _limit(5_000.0, "lower end of the rated output of the torque transducers")
    frequency_high: float = _limit(15_000.0, "upper end of it")
    step_speed: float = _limit(5.0 * RPM, "change of a speed that ends a plateau where nothing marks the points")
    step_torque: float = _limit(0.02, "the same of a torque, as part of the nominal torque")
    step_beside: float = _limit(1.0, "stretch before and after such a change whose means are compared")
    settle: float = _limit(1.0, "time after such a change that belongs to no plateau")

    def document(self) -> dict[str, float]:
        """As JSON, in SI."""
        return asdict(self)


LIMITS = Steadiness()
MEANINGS: dict[str, str] = {limit.name: limit.metadata[MEANING] for limit in fields(Steadiness)}
"""Meaning of each limit, in a phrase."""


def limit_text(name: str, values: Mapping[str, Any] | None = None) -> str:
    """A limit with its unit, such as ``0.5 rpm``; the default one where no values are given."""
    value = (asdict(LIMITS) if values is None else values)[name]
    dimension = DIMENSIONS.get(name)
    if dimension is None or not isinstance(value, int | float):
        return f"{value:g}" if isinstance(value, int | float) else str(value)
    if name in SPEEDS:
        return f"{value / RPM:.10g} {next(u for u, s in SPEED_OF_SHAFT.units.items() if s == RPM)}"
    if dimension is RATIO:
        return f"{100.0 * value:.10g} %"
    return f"{value:.10g} {dimension.unit}"

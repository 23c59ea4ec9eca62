"""Runs in motion as a manifest holds them: phases, which shafts turn, samples that are no measurement."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.json_values import with_nulls
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Phase:
    """A phase of a run in motion, from one sample to another, `stop_sample` left out."""

    name: str
    first_sample: int
    stop_sample: int


@dataclass(frozen=True)
class MaskedStretch:
    """Samples of a run in motion in which one signal is not known.

    Parameters
    ----------
    column : str
        Torque or angle of a shaft, such as ``angle_sun``.
    first_sample, stop_sample : int
        Sample indices, `stop_sample` left out.
    why : str
        What is wrong with them.
    """

    column: str
    first_sample: int
    stop_sample: int
    why: str


@dataclass(frozen=True)
class Extremes:
    """Lowest and highest value of a signal; NaN where it is not known."""

    lowest: float
    highest: float


@dataclass(frozen=True)
class MovingRecord:
    """A run in motion as it was judged; its samples stand in the store at full rate.

    Parameters
    ----------
    point : str
        Test point.
    started_at_s : float
        Time of the first sample since 1970 [s].
    first_sample, stop_sample : int
        Sample indices, `stop_sample` left out.
    phases : tuple of Phase
        In order, from the first sample to the last.
    turns : PerShaft of bool
        Whether a shaft moved by more than a few counts; one that did not is held.
    speed, acceleration : PerShaft of Extremes
        Of each shaft [rad/s], [rad/s^2].
    masked : tuple of MaskedStretch
        Samples that are no measurement.
    reasons : tuple of str
        Why the run is set aside; empty where it is evidence.
    """

    point: str
    started_at_s: float
    first_sample: int
    stop_sample: int
    phases: tuple[Phase, ...]
    turns: PerShaft[bool]
    speed: PerShaft[Extremes]
    acceleration: PerShaft[Extremes]
    masked: tuple[MaskedStretch, ...] = ()
    reasons: tuple[str, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether the run is evidence."""
        return not self.reasons

    def document(self) -> dict[str, Any]:
        """The record as it stands in its file."""
        return with_nulls(asdict(self))


def moving_record_of(plain: Mapping[str, Any]) -> MovingRecord:
    """The record that a file holds.

    Raises
    ------
    KeyError, TypeError
        It is damaged.
    """
    return MovingRecord(
        **dict(plain)
        | {
            "phases": tuple(Phase(**each) for each in plain["phases"]),
            "turns": PerShaft(**plain["turns"]),
            "speed": per_shaft(lambda side: _extremes(plain["speed"][side])),
            "acceleration": per_shaft(lambda side: _extremes(plain["acceleration"][side])),
            "masked": tuple(MaskedStretch(**each) for each in plain["masked"]),
            "reasons": tuple(map(str, plain["reasons"])),
        }
    )


def _extremes(plain: Mapping[str, float | None]) -> Extremes:
    return Extremes(*(math.nan if (end := plain[name]) is None else end for name in ("lowest", "highest")))

"""Where the turns of a shaft begin: an incremental encoder that begins anew gives every run another place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.motion.constants import ECCENTRICITY, RIPPLE
from pmg.sim.shafts import per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.motion.run import MovingRun

USUAL_PART = 0.5
"""Eccentricity of an encoder, over its standard deviation in the data sheet, from which on it aligns runs."""


@dataclass(frozen=True)
class TurnWave:
    """A wave of a turn of a shaft.

    Parameters
    ----------
    side : str
        The shaft.
    order : int
        Periods a turn.
    of_encoder : bool
        Whether its encoder shows it, and not the torque.
    engaged_only : bool
        Whether it is there in engaged runs alone.
    """

    side: str
    order: int
    of_encoder: bool = False
    engaged_only: bool = False

    @property
    def fast(self) -> bool:
        """Whether it is one of cogging."""
        return self.order not in RIPPLE

    @property
    def least(self) -> float:
        """Size from which on it aligns runs: a smaller one of an encoder is what else is amiss, seen through it."""
        return USUAL_PART * ECCENTRICITY if self.of_encoder else 0.0


@dataclass(frozen=True)
class TurnOrigins:
    """By how much the angle of a shaft is to be less in each run, so that its turns begin alike.

    Parameters
    ----------
    wave : TurnWave
        The wave that aligns them.
    angles : dict of str to float
        By run [rad]; a run that shows no wave is left as it is.
    """

    wave: TurnWave
    angles: dict[str, float]

    @property
    def sentence(self) -> str:
        """What was done, as people read it."""
        often = {1: "once", 2: "twice"}.get(self.wave.order, f"{self.wave.order} times")
        return (
            f"The {self.wave.side} encoder does not keep its turn from run to run: runs were aligned by the wave that "
            f"they show {often} a turn."
        )

    def of(self, run: MovingRun) -> MovingRun:
        """A run whose turns begin as those of the others."""
        moved, of = run.angle[self.wave.side] - self.angles.get(run.name, 0.0), self.wave.side
        return replace(run, angle=per_shaft(lambda side: moved if side == of else run.angle[side]))

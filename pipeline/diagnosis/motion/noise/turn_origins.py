"""Where the turns of a shaft begin: an incremental encoder that begins anew gives every run another place."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from pmg.pipeline.diagnosis.motion.constants import COGGING_ORDERS, RIPPLE, start_name
from pmg.pipeline.diagnosis.motion.noise.row_noise import USUAL, row_noise
from pmg.pipeline.diagnosis.motion.stance import eccentric
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.sim.shafts import SIDES, per_shaft

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise, SlowNoise
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.signals import Array

KEPT = 0.3
"""Spread of the pole angles at the starts of engaged runs [rad] up to which both counters kept their turn."""

BY_CHANCE = 1e-3
"""Probability, over all waves that are tried, up to which another phase in every run is no chance."""

AS_LARGE = 0.8
"""Part of what the waves explain, each in its phase, that they must explain with one size too: what is of a shaft is
as large in every run, and of noise alone this is pi/4."""


@dataclass(frozen=True)
class TurnOrigins:
    """By how much the angle of a shaft is to be less in each run, so that its turns begin alike.

    Parameters
    ----------
    side : str
        The shaft.
    order : int
        Periods a turn of the wave that aligns them.
    angles : dict of str to float
        By run [rad]; a run that shows no wave is left as it is.
    """

    side: str
    order: int
    angles: dict[str, float]

    @property
    def sentence(self) -> str:
        """What was done, as people read it."""
        often = {1: "once", 2: "twice"}.get(self.order, f"{self.order} times")
        return (
            f"The {self.side} encoder does not keep its turn from run to run: the runs were aligned by the wave that "
            f"they show {often} a turn."
        )

    def of(self, run: MovingRun) -> MovingRun:
        """A run whose turns begin as those of the others."""
        moved = run.angle[self.side] - self.angles.get(run.name, 0.0)
        return replace(run, angle=per_shaft(lambda side: moved if side == self.side else run.angle[side]))


def turn_origins(fitted: MotionBaseline, slow_noise: SlowNoise) -> TurnOrigins | None:
    r"""Origins of the turns of a shaft whose runs show a wave of a turn, each in a phase of its own; None without.

    Parameters
    ----------
    fitted : MotionBaseline
        The constants of a campaign, with what they leave.
    slow_noise : SlowNoise
        Wander that they show; any ripple of a turn up to the usual one passes for noise.

    Notes
    -----
    With the products :math:`G_r` of the two whitened columns of a wave in run r, and those :math:`b_r` with what is
    left, a phase for each of R runs explains :math:`\sum_r b_r^T G_r^{-1} b_r - b^T G^{-1} b` more than one phase for
    all, G and b being the sums; noise makes that :math:`\chi^2` with 2 (R - 1) degrees of freedom. Of the waves that
    are no chance, the one whose size is most alike in all runs aligns them.
    """
    if _keep_their_turn(fitted):
        return None
    views, slow_noise = views_of(fitted.clean), replace(slow_noise, ripple=USUAL.ripple)
    noise = [row_noise(fitted, place, slow_noise) for place in range(len(views))]
    left = [each.white(fitted.left(place)[:, None])[:, 0] for place, each in enumerate(noise)]
    unit = max(float(np.mean(np.concatenate(left) ** 2)), 1.0)
    tried, alike, found = tuple(_waves()), AS_LARGE, None
    for wave in tried:
        products = _products(wave, views, noise, left)
        if len(products) < 2:
            continue
        phases = {run: _phase(each) for run, each in products.items()}
        apart = sum(map(_explained, products.values()))
        more = (apart - _explained(np.sum(list(products.values()), axis=0))) / unit
        chance = len(tried) * float(chi2.sf(more, 2 * (len(products) - 1)))
        as_large = _explained(np.sum([_turned(each, phases[run]) for run, each in products.items()], axis=0)) / apart
        if chance < BY_CHANCE and as_large > alike:
            angles = {run: phase / wave.order for run, phase in phases.items()}
            alike, found = as_large, TurnOrigins(wave.side, wave.order, angles)
    return found


def _products(wave: _Wave, views: list[RotorView], noise: list[RowNoise], left: list[Array]) -> dict[str, Array]:
    """Products (2, 3) of the whitened columns of a wave with each other and with what is left, of each run with it."""
    found: dict[str, Array] = {}
    for view, each, rows in zip(views, noise, left, strict=True):
        columns = wave.columns(view)
        if columns is not None:
            run, white = view.state.stretch.run.run.name, each.white(view.state.stretch.of_rows(columns))
            found[run] = found.get(run, 0.0) + white.T @ np.c_[white, rows]
    return {run: each for run, each in found.items() if np.linalg.det(each[:, :2]) > 0.0}


@dataclass(frozen=True)
class _Wave:
    """A wave of a turn of a shaft; `of_encoder` where its encoder shows it, not the torque."""

    side: str
    order: int
    of_encoder: bool = False

    def columns(self, view: RotorView) -> Array | None:
        """Cosine and sine at the fine samples (n, 2); None where it does not act."""
        stretch = view.state.stretch
        if stretch.at_rest or not stretch.run.run.turns[self.side]:
            return None
        if self.of_encoder:
            return np.stack(eccentric(view.state, self.side), 1) if view.coupled or view.side == self.side else None
        return view.wave(self.side, self.order) if view.side == self.side else None


def _waves() -> Iterator[_Wave]:
    for side, order in itertools.product(SIDES, (*RIPPLE, *COGGING_ORDERS)):
        yield _Wave(side, order)
    yield from (_Wave(side, 1, of_encoder=True) for side in SIDES)


def _explained(products: Array) -> float:
    """Sum of squares that two columns explain, by their products with each other and with what is left (2, 3)."""
    return float(products[:, 2] @ np.linalg.solve(products[:, :2], products[:, 2]))


def _phase(products: Array) -> float:
    """Phase of the wave that two columns fit [rad]."""
    cosine, sine = np.linalg.solve(products[:, :2], products[:, 2])
    return float(np.arctan2(sine, cosine))


def _turned(products: Array, phase: float) -> Array:
    """The products of the columns of a wave that is earlier by a phase [rad]."""
    cosine, sine = np.cos(phase), np.sin(phase)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    return np.asarray(np.c_[turn.T @ products[:, :2] @ turn, turn.T @ products[:, 2]])


def _keep_their_turn(fitted: MotionBaseline) -> bool:
    """Whether the poles stand alike at the start of all engaged runs, as they do where no counter begins anew.

    Where no two runs are engaged, each run must go on where the one before it stopped.
    """
    engaged = {s.run.run.name for s in fitted.stretches if s.coupled}
    starts = np.exp(1j * fitted.values[[fitted.sheet.at(start_name(name)) for name in sorted(engaged)]])
    if len(starts) > 1:
        return bool(abs(starts.mean()) > np.exp(-0.5 * KEPT**2))
    return all(_goes_on([s.shaft.angle[[0, -1]] for s in fitted.stretches if s.side == side]) for side in SIDES)


def _goes_on(ends: list[Array]) -> bool:
    """Whether the first angle of most runs is near the last one of the run before, but for whole turns."""
    steps = [abs(np.angle(np.exp(1j * (after[0] - before[1])))) for before, after in itertools.pairwise(ends)]
    return not steps or float(np.median(steps)) < KEPT

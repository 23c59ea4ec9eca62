"""Runs whose counters begin their turns anew, aligned by a wave of a turn that they show."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from pmg.pipeline.diagnosis.motion.constants import (
    COGGING_ORDERS,
    RIPPLE,
    eccentricity_names,
    ripple_names,
    start_name,
)
from pmg.pipeline.diagnosis.motion.noise.row_noise import USUAL, row_noise
from pmg.pipeline.diagnosis.motion.noise.turn_origins import TurnOrigins, TurnWave
from pmg.pipeline.diagnosis.motion.stance import eccentric
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.sim.shafts import SIDES
from pmg.sim.signals import wrapped

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise, SlowNoise
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array

KEPT = 0.3
"""Spread of the pole angles at the starts of engaged runs [rad] up to which both counters kept their turn."""

BY_CHANCE = 1e-3
"""Probability, over all waves that are tried, up to which another phase in every run is no chance."""

AS_LARGE = 0.8
"""Part of what the waves explain, each in its phase, that they must explain with one size too: what is of a shaft is
as large in every run, and of noise alone this is pi/4."""

LEAST_SEEN = 1e-6
"""Determinant of the squares of two columns, over the square of their sum, from which on a run shows them both."""

REFINED = 3
"""Times that the same wave aligns runs at most."""


def turn_origins(
    fitted: MotionBaseline, slow_noise: SlowNoise, known: tuple[TurnOrigins, ...] = ()
) -> TurnOrigins | None:
    r"""Origins of the turns of a shaft whose runs show a wave of a turn, each in a phase of its own; None without.

    Parameters
    ----------
    fitted : MotionBaseline
        The constants of a campaign, with what they leave.
    slow_noise : SlowNoise
        Wander that they show; any ripple of a turn up to the usual one passes for noise.
    known : tuple of TurnOrigins
        By what the runs are aligned already. A shaft is aligned by a slow wave, of its encoder or once or twice a turn,
        and then by one fast wave, whose phases are finer; each again as the fit comes nearer to it.

    Notes
    -----
    With the products :math:`G_r` of the two whitened columns of a wave in run r, and those :math:`b_r` with what is
    left, a phase for each of R runs explains :math:`\sum_r b_r^T G_r^{-1} b_r - b^T G^{-1} b` more than one phase for
    all, G and b being the sums; noise makes that :math:`\chi^2` with 2 (R - 1) degrees of freedom. Of the waves that
    are no chance, a slow one before a fast one, that whose size is most alike in all runs aligns them, unless a wave in
    one phase explains as much: others show a part of it, in a phase that depends on the run.
    """
    if _keep_their_turn(fitted):
        return None
    slow_noise = replace(slow_noise, ripple=USUAL.ripple)
    noise = [row_noise(fitted, place, slow_noise) for place in range(len(fitted.stretches))]
    left = [each.white(fitted.left(place)[:, None])[:, 0] for place, each in enumerate(noise)]
    unit = max(float(np.mean(np.concatenate(left) ** 2)), 1.0)
    waves, tried = _products(fitted, noise, left), [origins.wave for origins in known]
    alike = _most_in_one_phase(waves)
    found: list[tuple[bool, float, TurnOrigins]] = []
    for wave, products in waves.items():
        apart = sum(_explained(each) for each in products.values())
        if len(products) < 2 or not apart or not _may_align(wave, tried):
            continue
        together = np.sum(list(products.values()), axis=0)
        phases = {run: _phase(each) for run, each in products.items()}
        more = apart - _explained(together)
        chance = len(waves) * float(chi2.sf(more / unit, 2 * (len(products) - 1)))
        aligned = np.sum([_turned(each, phases[run]) for run, each in products.items()], axis=0)
        as_large, size = _explained(aligned) / apart, float(np.linalg.norm(_fitted(aligned)))
        if chance < BY_CHANCE and more > alike[wave.side] and as_large > AS_LARGE and size > wave.least:
            off = {run: float(wrapped(phase - _phase(together))) for run, phase in phases.items()}
            origins = TurnOrigins(wave, {run: each / wave.order for run, each in off.items()})
            found.append((not wave.fast, as_large, origins))
    return max(found, key=lambda each: each[:2])[2] if found else None


def _most_in_one_phase(waves: dict[TurnWave, dict[str, Array]]) -> dict[str, float]:
    """The most that a wave in one phase for all runs explains of what is left, by shaft: others show it, too."""
    found = dict.fromkeys(SIDES, 0.0)
    for wave, products in waves.items():
        if products:
            whole = np.sum(list(products.values()), axis=0)
            found[wave.side] = max(found[wave.side], _explained(whole[:, [0, 1, 3]]))
    return found


def _may_align(wave: TurnWave, known: list[TurnWave]) -> bool:
    """Whether a wave may align runs that others aligned: the same again, or the first fast one of its shaft."""
    own = [each for each in known if each.side == wave.side]
    if wave in own:
        return own.count(wave) < REFINED and own[-1] == wave
    return not own or (wave.fast and not any(each.fast for each in own))


def _products(fitted: MotionBaseline, noise: list[RowNoise], left: list[Array]) -> dict[TurnWave, dict[str, Array]]:
    """Products (2, 4) of the whitened columns of each wave with each other, with what shows of it and what is left."""
    found: dict[TurnWave, dict[str, Array]] = {wave: {} for wave in _waves()}
    for view, each, rows in zip(views_of(fitted.clean), noise, left, strict=True):
        acting = [(wave, columns) for wave in found if (columns := _columns(wave, view)) is not None]
        if not acting:
            continue
        white = each.white(view.state.stretch.of_rows(np.hstack([columns for _, columns in acting])))
        run = view.state.stretch.run.run.name
        for (wave, _), own in zip(acting, np.split(white, len(acting), axis=1), strict=True):
            shown = rows + own @ _of_constants(wave, fitted)
            found[wave][run] = found[wave].get(run, 0.0) + own.T @ np.c_[own, shown, rows]
    return {wave: {run: each for run, each in of.items() if _seen(each)} for wave, of in found.items()}


def _seen(products: Array) -> bool:
    """Whether a run shows both columns of a wave."""
    squares = products[:, :2]
    return bool(np.linalg.det(squares) > LEAST_SEEN * np.trace(squares) ** 2)


def _columns(wave: TurnWave, view: RotorView) -> Array | None:
    """Cosine and sine at the fine samples (n, 2); None where it does not act."""
    stretch = view.state.stretch
    if stretch.at_rest or not stretch.run.run.turns[wave.side] or (wave.engaged_only and not view.coupled):
        return None
    if wave.of_encoder:
        return np.stack(eccentric(view.state, wave.side), 1) if view.coupled or view.side == wave.side else None
    return view.wave(wave.side, wave.order) if view.side == wave.side else None


def _of_constants(wave: TurnWave, baseline: MotionBaseline) -> Array:
    """Cosine and sine that the constants of a baseline have of it (2,)."""
    if wave.fast:
        return np.zeros(2)
    names = eccentricity_names(wave.side) if wave.of_encoder else ripple_names(wave.side, wave.order)
    return np.asarray(baseline.values[list(map(baseline.sheet.at, names))])


def _waves() -> Iterator[TurnWave]:
    for side in SIDES:
        yield TurnWave(side, 1, of_encoder=True)
        yield from (TurnWave(side, order) for order in (*RIPPLE, *COGGING_ORDERS))
        yield from (TurnWave(side, order, engaged_only=True) for order in COGGING_ORDERS)


def _explained(products: Array) -> float:
    """Sum of squares that two columns explain, by their products with each other and with what shows (2, 3 or 4)."""
    return float(products[:, 2] @ _fitted(products))


def _fitted(products: Array) -> Array:
    """Cosine and sine that fit (2,)."""
    return np.asarray(np.linalg.solve(products[:, :2], products[:, 2]))


def _phase(products: Array) -> float:
    """Phase of the wave that two columns fit [rad]."""
    cosine, sine = _fitted(products)
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
    steps = [abs(float(wrapped(after[0] - before[1]))) for before, after in itertools.pairwise(ends)]
    return not steps or float(np.median(steps)) < KEPT

"""Errors that steps of the encoders make beyond white noise: the same runs counted anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import upfirdn

from pmg.pipeline.diagnosis.motion.noise.filtered import LEAST
from pmg.pipeline.motion.smooth import MOST_COMMON, row_weights
from pmg.sim.shafts import SIDES, PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.motion.smooth import SmoothRun
    from pmg.sim.signals import Array

COUNTED = 8
"""Times that a campaign is counted anew."""


def off_by_steps(fitted: MotionBaseline, *, jitters: bool = False) -> list[Array]:
    r"""Errors (r, d) of the rows of each stretch [N m] with the steps of the encoders at other places, drawn d times.

    Parameters
    ----------
    fitted : MotionBaseline
        The constants, and signals that are free of noise as far as the balances tell.
    jitters : bool
        Whether the times of samples jitter as they did: all noise of the angles then, not the steps alone.

    Notes
    -----
    A shaft that turns by nearly a whole number of counts a sample, and swings by a few, is off by the same function of
    its swing in every period: an error of the amplitude that no density tells. The smooth angle is therefore counted
    anew from places that are drawn, :math:`e = c \lfloor (\theta + \delta)/c \rfloor + c/2 - \delta - \theta`, and
    the balance of a row makes :math:`J \ddot e + K p \sum p_i e_i` of it.
    """
    rng, found = np.random.default_rng(0), []
    counted: dict[str, PerShaft[tuple[Array, Array]]] = {}
    inertia = per_shaft(lambda side: fitted.values[fitted.sheet.at(f"inertia_{side}")])
    peak, poles = fitted.values[fitted.sheet.at("pull_out")], fitted.sheet.poles
    for stretch, clean in zip(fitted.stretches, fitted.clean.stretches, strict=True):
        if stretch.at_rest:
            found.append(np.zeros((len(stretch), COUNTED)))
            continue
        name = stretch.run.run.name
        if name not in counted:
            blurs = _blurs(clean.run, rng) if jitters else PerShaft(*np.zeros((2, 1, 1)))
            counted[name] = PerShaft(*(_errors(clean.run, side, rng, blurs[side]) for side in SIDES))
        off = inertia[stretch.side] * counted[name][stretch.side][1]
        if stretch.coupled:
            off = off + peak * poles[stretch.side] * sum(poles[side] * counted[name][side][0] for side in SIDES)
        found.append(off[stretch.rows])
    return found


def widened(covariance: Array, least: Array) -> Array:
    """A covariance (k, k) with no variance below `least` (k,); correlations stay."""
    wider = np.sqrt(np.maximum(least / np.maximum(np.diag(covariance), np.finfo(float).tiny), 1.0))
    return np.asarray(covariance * np.outer(wider, wider))


def _blurs(run: SmoothRun, rng: np.random.Generator) -> PerShaft[Array]:
    """What jitter of the times of samples adds to the angle of either shaft at each of them [rad], (n, d)."""
    sun, ring = rng.standard_normal((2, len(run.run.angle.sun), COUNTED))
    densities = run.shafts.map(lambda shaft: shaft.angle_noise.jitter)
    together = run.common / max(np.sqrt(densities.sun * densities.ring), LEAST)
    together = float(np.clip(together, -MOST_COMMON, MOST_COMMON))
    size = densities.map(lambda density: np.sqrt(0.5 * run.run.rate * density))
    return PerShaft(size.sun * sun, size.ring * (together * sun + np.sqrt(1.0 - together**2) * ring))


def _errors(run: SmoothRun, side: str, rng: np.random.Generator, blur: Array) -> tuple[Array, Array]:
    """Rows (m, d) of what the counts of an angle and of its second derivative are off [rad, rad/s2].

    `blur` (n, d) is what comes to the angle at each sample [rad].
    """
    angle, count, rate = run.shafts[side].angle, run.run.count[side], run.run.rate
    line = np.linspace(angle[0], angle[-1], len(angle))
    smooth = CubicSpline(run.time, run.in_band(angle - line) + line)
    time = np.arange(len(run.run.angle[side])) / rate
    inside = np.clip(time, run.time[0], run.time[-1])
    turned = (smooth(inside) + smooth(inside, 1) * (time - inside))[:, None]
    begun = rng.uniform(0.0, count, COUNTED)
    off = np.floor((turned + blur + begun) / count) * count + 0.5 * count - begun - turned
    every = round(rate / run.row_rate)

    def rows(weights: Array) -> Array:
        before = -(len(weights) - 1) % every  # so that the first whole product is one that is kept
        products = upfirdn(weights, np.pad(off, ((before, 0), (0, 0))), down=every, axis=0)
        return np.asarray(products[(len(weights) - 1 + before) // every :][: len(run)])

    low, curved = row_weights(run)
    return rows(low), rows(curved)

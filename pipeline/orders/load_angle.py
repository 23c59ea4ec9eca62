"""Angle by which the field of the gear is wound up, from counts and index pulses of both encoders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.pipeline.windows.reduce import mean_uncertainty
from pmg.pipeline.windows.revolutions import WholeRevolutions, whole_revolutions
from pmg.pipeline.wording.probability import CONFIDENCE
from pmg.sim import sources
from pmg.sim.errors import FitError
from pmg.sim.signals import REVOLUTION, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.orders.angle import Index
    from pmg.sim.bench import GearParameters
    from pmg.sim.signals import Array

FEWEST_POINTS = 3
"""Points from which the load angle's law is judged."""
LEAST_SPAN = 3.0
"""Span of the expected angle over the points, in standard uncertainties of a point, from which it is judged."""
MOST_DOF = 1e9
"""Degrees of freedom that stand for a known uncertainty."""

RHYTHMS = 32
"""Harmonics of the sawtooth of a counted angle that are summed."""

SOURCE = sources.THESIS.at("section 5.2.1: torque maps periodic in the poles of sun and ring")


@dataclass(frozen=True)
class LoadAngle:
    """Electrical angle between the rotors over one window.

    Parameters
    ----------
    angle : float
        Mean, between -pi and pi [rad]; its zero is that of the index pulses, or of this file's counts.
    u : float
        Standard uncertainty of the mean from what varies within the window [rad].
    dof : float
        Degrees of freedom of `u`, as far as it comes from the scatter of the window.
    u_index : float
        Standard uncertainty by the place of the index pulses, which all points of a file share [rad]; zero where the
        zero is that of the counts.
    swing : float
        Standard deviation within the window [rad].
    slipped : float
        Poles that were lost over the window.
    from_index : bool
        Whether the zero is that of the index pulses, the same in every file.
    """

    angle: float
    u: float
    dof: float
    u_index: float
    swing: float
    slipped: float
    from_index: bool


def load_angle(
    sun: Array, ring: Array, gear: GearParameters, steps: Mapping[str, float], index: Mapping[str, Index | None]
) -> LoadAngle:
    r"""Load angle of an engaged window, the carrier held.

    Parameters
    ----------
    sun, ring : (n,) array
        Angles as counted, finite [rad].
    gear : GearParameters
        Pole pairs.
    steps : mapping of str to float
        One count of either encoder [rad].
    index : mapping of str to Index or None
        Place of the index of either shaft.

    Notes
    -----
    :math:`\varphi = p_s\theta_s + p_r\theta_r`, as in the torque map. A turn of either shaft is a whole number of
    poles, so the angle is known modulo a turn without knowing which turn. How the encoders stand against the poles is
    not known: a change of the angle is a measurement, its value is not, until a point without load gives the zero.
    The encoders sit on the shafts of the motors, so twist of shafts and couplings is part of it. Means are taken over
    whole turns of the sun, which averages the eccentricity of its encoder, and the steps of the counts. What varies
    within the window is judged as that of a torque is (`_reduce_shaft`): where its memory outlives the batches, by it.

    References
    ----------
    `SOURCE`.
    """
    p_s, p_r = float(gear.pole_pairs_sun), float(gear.pole_pairs_ring)
    zero_sun, zero_ring = index["sun"], index["ring"]
    both = zero_sun is not None and zero_ring is not None
    offset, u_index = 0.0, 0.0
    if zero_sun is not None and zero_ring is not None:
        offset = p_s * zero_sun.angle + p_r * zero_ring.angle
        u_index = math.hypot(p_s * zero_sun.u, p_r * zero_ring.u)
    half = 0.5 * (p_s * steps["sun"] + p_r * steps["ring"])
    phase = p_s * sun + p_r * ring + half - offset
    middle = float(phase.mean())
    turned = WholeRevolutions(phase - middle, whole_revolutions(sun))
    u, dof, _, _ = mean_uncertainty(turned, turned.batches(), 1.0)
    u = math.hypot(u, math.hypot(p_s * _count_rhythm(sun, steps["sun"]), p_r * _count_rhythm(ring, steps["ring"])))
    tenth = max(1, len(phase) // 10)
    slipped = float(phase[-tenth:].mean() - phase[:tenth].mean()) / REVOLUTION
    mean = float(wrapped(np.array(middle + turned.mean())))
    return LoadAngle(mean, u, dof, u_index, float(phase.std()), slipped, both)


def _count_rhythm(angle: Array, step: float) -> float:
    r"""Standard uncertainty of a mean angle by the rhythm in which samples fall between the counts [rad].

    Parameters
    ----------
    angle : (n,) array
        Counted angle [rad].
    step : float
        One count [rad].

    Notes
    -----
    A shaft that turns by a whole number of counts in a few samples is read at the same few places between two counts
    all along, and its mean is off by up to half a count. The error of a count is a sawtooth, the sum of
    :math:`\sin(2\pi k x)/(\pi k)` over k with x the place between two counts; with :math:`M_k` the length of the
    mean of :math:`e^{2\pi i k x}` along a parabola through the angle, :math:`u^2 = \sum_k (M_k/\pi k)^2/2` counts.
    """
    time = np.linspace(-1.0, 1.0, len(angle))
    counts = (angle - angle[0]) / step
    smooth = np.polynomial.Polynomial.fit(time, counts, 2)(time)
    turn = np.exp(1j * REVOLUTION * smooth)
    power, square = turn.copy(), 0.0
    for k in range(1, RHYTHMS + 1):
        square += (abs(power.mean()) / (math.pi * k)) ** 2 / 2.0
        power *= turn
    return step * math.sqrt(square)


@dataclass(frozen=True)
class WindUp:
    """Load angle against load, with the angle that the pull-out torque implies.

    Parameters
    ----------
    slope : float
        Measured change for one of what is expected; 1 where the pull-out torque is the published one.
    u : float
        Its standard uncertainty.
    dof : float
        Degrees of freedom of `u`.
    reach : float
        Half of its 95 % interval, by Student's t.
    without_load : float
        Angle without load [rad].
    points : int
        How many.
    span : float
        Change of the expected angle over the points [rad].
    """

    slope: float
    u: float
    dof: float
    reach: float
    without_load: float
    points: int
    span: float


def wind_up(torque_ring: Array, angle: Array, u: Array, gear: GearParameters, dof: Array | float = math.inf) -> WindUp:
    r"""Fit of the load angle against what the load winds up.

    Parameters
    ----------
    torque_ring : (n,) array
        Torque that the gear carries, on the ring's side [N m].
    angle, u : (n,) array
        Load angles and their uncertainty [rad].
    gear : GearParameters
        Pull-out torque.
    dof : (n,) array or float
        Degrees of freedom of `u`.

    Raises
    ------
    FitError
        With fewer than `FEWEST_POINTS` points, or loads too much alike to tell.

    Notes
    -----
    :math:`\varphi = \varphi_0 + s\,\arcsin(T_r/\hat T_r)`, by weighted least squares. A weaker magnet winds up
    more: to first order s is the published pull-out torque over the real one. With the weights :math:`w_i`, s is
    :math:`\sum_i a_i\varphi_i`; where the points scatter no more than their own uncertainties say,
    :math:`u^2 = \sum_i a_i^2 u_i^2` has the effective degrees of freedom :math:`u^4/\sum_i (a_i u_i)^4/\nu_i` (GUM
    equation G.2b). Where they scatter more, their scatter gives u, with n - 2 degrees of freedom.
    """
    expected = np.arcsin(np.clip(torque_ring / float(gear.pull_out_torque_ring), -1.0, 1.0))
    span = float(np.ptp(expected)) if len(expected) else 0.0
    typical = float(np.median(u)) if len(u) else math.nan
    if len(angle) < FEWEST_POINTS or not span > LEAST_SPAN * typical:
        raise FitError(
            "load angle against load",
            f"{len(angle)} points over which it should change by {span:.4f} rad, known to {typical:.4f} rad each",
            f"{FEWEST_POINTS} points and a change of {LEAST_SPAN:g} times that",
            "Run points at several loads in one sequence, or record the index pulses.",
        )
    near = angle[0] + wrapped(angle - angle[0])
    weight = 1.0 / u**2
    centre = float((weight * expected).sum() / weight.sum())
    spread = float((weight * (expected - centre) ** 2).sum())
    slope = float((weight * (expected - centre) * near).sum()) / spread
    zero = float((weight * near).sum() / weight.sum()) - slope * centre
    rest = near - zero - slope * expected
    left = len(angle) - 2
    inflation = float((weight * rest**2).sum()) / left
    parts = (weight * (expected - centre)) ** 2 * u**2 / spread**2
    share = float((parts**2 / np.maximum(dof, 1.0)).sum())
    own = min(float(parts.sum()) ** 2 / share, MOST_DOF) if share > 0.0 else MOST_DOF
    width, freedom = (math.sqrt(inflation / spread), float(left)) if inflation > 1.0 else (spread**-0.5, own)
    reach = float(special.stdtrit(freedom, (1.0 + CONFIDENCE) / 2.0)) * width
    return WindUp(slope, width, freedom, reach, zero, len(angle), span)

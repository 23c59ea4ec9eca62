"""The magnetic torques of a stage, from one potential energy of the three angles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.roots import rising_root
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.bench import GearParameters
    from pmg.sim.signals import Array


_ROUNDING = 2.0 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class MagneticTorques:
    """Torques of the field on the three members [N m]; their sum is zero."""

    sun: Array
    ring: Array
    carrier: Array


@dataclass(frozen=True)
class PullOut:
    """The largest and smallest mean torque that the sun takes up before it slips [N m], and the phases there [rad]."""

    torque_low: float
    torque_high: float
    phase_low: float
    phase_high: float


@dataclass(frozen=True)
class Cogging:
    """Pull of the bare iron poles on one rotor.

    Parameters
    ----------
    amplitude : float
        Torque amplitude [N m].
    order : int or None
        Periods a turn against the carrier; None for the least common multiple of the magnets and the iron poles.
    """

    amplitude: float
    order: int | None = None


@dataclass(frozen=True)
class TorqueMap:
    r"""Torques as the slopes of one periodic energy, so that none can be gained in a closed loop.

    Parameters
    ----------
    pole_pairs_sun, pole_pairs_ring : int
        :math:`p_s` and :math:`p_r`; the carrier has :math:`Q = p_s + p_r` iron poles.
    orders_sun, orders_ring : (k,) array of int
        Periods a turn of each term in the sun's and the ring's angle against the carrier, :math:`m_k` and :math:`n_k`.
    cosine, sine : (k,) array
        Amplitudes of the energy [J].
    origin : str
        Where the numbers come from.

    Notes
    -----
    :math:`W = \sum_k a_k\cos\psi_k + b_k\sin\psi_k`, :math:`\psi_k = m_k(\theta_s-\theta_c) + n_k(\theta_r-\theta_c)`,
    and :math:`T_j = -\partial W/\partial\theta_j`. Only differences of angles enter, hence
    :math:`T_s + T_r + T_c = 0`. Terms with :math:`m_k : n_k = p_s : p_r` follow the electrical phase
    :math:`\varphi = p_s\theta_s + p_r\theta_r - Q\theta_c`; all others average out over a turn at constant phase.
    """

    pole_pairs_sun: int
    pole_pairs_ring: int
    orders_sun: npt.NDArray[np.int64]
    orders_ring: npt.NDArray[np.int64]
    cosine: Array
    sine: Array
    origin: str

    @property
    def iron_poles(self) -> int:
        """Iron poles of the carrier, Q."""
        return self.pole_pairs_sun + self.pole_pairs_ring

    def phase(self, sun: Array, ring: Array, carrier: Array | float = 0.0) -> Array:
        """Electrical phase [rad] of the three angles [rad]."""
        return np.asarray(self.pole_pairs_sun * sun + self.pole_pairs_ring * ring - self.iron_poles * carrier)

    def scaled(self, factor: float) -> TorqueMap:
        """The same map with all torques multiplied; a positive factor."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise BenchError(
                "map scale", str(factor), "a number above 0", "Choose a positive scale, 1 for the map as is."
            )
        return replace(self, cosine=factor * self.cosine, sine=factor * self.sine)

    def _terms(self, sun: Array, ring: Array, carrier: Array | float) -> Array:
        return np.multiply.outer(sun - carrier, self.orders_sun) + np.multiply.outer(ring - carrier, self.orders_ring)

    def potential(self, sun: Array, ring: Array, carrier: Array | float = 0.0) -> Array:
        """Magnetic energy [J] at the angles [rad] of the three members, less its mean."""
        psi = self._terms(sun, ring, carrier)
        return np.asarray(np.cos(psi) @ self.cosine + np.sin(psi) @ self.sine)

    def torques(self, sun: Array, ring: Array, carrier: Array | float = 0.0) -> MagneticTorques:
        """Torques on the three members [N m] at their angles [rad]."""
        psi = self._terms(sun, ring, carrier)
        pull = np.sin(psi) * self.cosine - np.cos(psi) * self.sine
        on_sun, on_ring = pull @ self.orders_sun, pull @ self.orders_ring
        return MagneticTorques(on_sun, on_ring, -(on_sun + on_ring))

    def stiffness(self, sun: Array, ring: Array, carrier: Array | float = 0.0) -> Array:
        """Second derivatives of the energy [N m/rad], (..., 3, 3) in the order sun, ring, carrier.

        Element (i, j) is minus the slope of the torque on i with the angle of j; the rows sum to zero.
        """
        psi = self._terms(sun, ring, carrier)
        orders = np.stack([self.orders_sun, self.orders_ring, -(self.orders_sun + self.orders_ring)])
        bend = -(np.cos(psi) * self.cosine + np.sin(psi) * self.sine)
        return np.asarray(np.einsum("...k,ik,jk->...ij", bend, orders, orders, optimize=True))

    @cached_property
    def _mean(self) -> tuple[Array, Array]:
        """Orders in the phase, and complex torque amplitudes on the sun, of the terms that do not average out."""
        p_s, p_r = self.pole_pairs_sun, self.pole_pairs_ring
        kept = (self.orders_sun * p_r == self.orders_ring * p_s) & (self.orders_sun != 0)
        orders = self.orders_sun[kept] / p_s
        return orders, p_s * orders * (self.sine + 1j * self.cosine)[kept]

    def mean_torque(self, phase: Array) -> tuple[Array, Array]:
        """Torque that the sun needs to hold a phase [N m], mean over a turn, and its slope [N m/rad]."""
        orders, amplitude = self._mean
        turned = np.exp(1j * np.multiply.outer(phase, orders)) * amplitude
        return turned.real.sum(axis=-1), (1j * orders * turned).real.sum(axis=-1)

    @cached_property
    def pull_out(self) -> PullOut:
        """The mean torques beyond which the rotors slip.

        Notes
        -----
        The slope of the mean torque is a polynomial in exp(i phi). Every extreme lies at the angle of one of its
        roots, however many harmonics there are; angles of roots off the unit circle are none and cannot win.
        """
        orders, amplitude = self._mean
        if not len(orders) or not np.abs(amplitude).any():
            raise BenchError(self.origin, "no torque that follows the phase", "a coupling", "Check the map.")
        whole = np.rint(orders).astype(np.int64)
        slope = 1j * orders * amplitude
        top = int(np.abs(whole).max())
        polynomial = np.zeros(2 * top + 1, dtype=np.complex128)
        np.add.at(polynomial, top - whole, 0.5 * slope)
        np.add.at(polynomial, top + whole, 0.5 * np.conj(slope))
        phases = np.asarray(np.angle(np.roots(polynomial)), dtype=np.float64)
        torque, _ = self.mean_torque(phases)
        low, high = int(np.argmin(torque)), int(np.argmax(torque))
        after = phases[low] + (phases[high] - phases[low]) % REVOLUTION
        shift = REVOLUTION * np.round(0.5 * (phases[low] + after) / REVOLUTION)
        return PullOut(float(torque[low]), float(torque[high]), float(phases[low] - shift), float(after - shift))

    def load_angle(self, torque_sun: Array) -> Array:
        """Steady phase [rad] at which the sun passes on the given torques.

        Parameters
        ----------
        torque_sun : (n,) array
            Torque that the outside applies to the sun rotor, bearings taken off [N m].

        Returns
        -------
        (n,) array
            Phase on the stable branch, between the two pull-out phases.

        Raises
        ------
        BenchError
            When a load is at or above the pull-out torque.

        Notes
        -----
        Cogging and every other term that averages out over a turn moves the rotors about this phase and is left out.
        """
        torque = np.atleast_1d(np.asarray(torque_sun, dtype=np.float64))
        limits = self.pull_out
        held = (torque > limits.torque_low) & (torque < limits.torque_high)
        if not held.all():
            i = int(np.flatnonzero(~held)[0])
            limit = limits.torque_high if torque[i] > 0.0 else limits.torque_low
            raise BenchError(
                f"load of point {i}",
                f"{torque[i]:.6g} N m on the sun against a pull-out of {limit:.6g} N m",
                f"a load between {limits.torque_low:.6g} and {limits.torque_high:.6g} N m",
                "Reduce the load, or the scale that reduces the map.",
            )

        def missing(phase: Array) -> tuple[Array, Array]:
            value, slope = self.mean_torque(phase)
            return value - torque, slope

        rounding = _ROUNDING * max(limits.torque_high, -limits.torque_low)
        ends = np.full_like(torque, limits.phase_low), np.full_like(torque, limits.phase_high)
        return rising_root(missing, *ends, rounding=rounding)[0]


def analytic_map(
    gear: GearParameters,
    scale: float = 1.0,
    harmonics: dict[int, float] | None = None,
    cogging_sun: Cogging | None = None,
    cogging_ring: Cogging | None = None,
) -> TorqueMap:
    r"""The map that the published pull-out torques imply.

    Parameters
    ----------
    gear : GearParameters
        Pole pairs and pull-out torques.
    scale : float
        Factor on all torques.
    harmonics : dict of int to float
        Order in the phase, from 2, and torque amplitude relative to the fundamental. The pull-out stays as published.
    cogging_sun, cogging_ring : Cogging
        Pull of the iron poles on each rotor; absent by default, as the source gives none.

    Notes
    -----
    :math:`W = -\hat W\cos\varphi` has pull-outs :math:`p_s\hat W, p_r\hat W, Q\hat W`. The three published values are
    rounded to 0.01 N m; :math:`\hat W` is their least-squares value,
    :math:`\sum p_j\hat T_j/\sum p_j^2`, and meets all three within rounding. The source draws the maps but prints no
    more than their peaks, so the sine is an assumption.
    """
    p_s, p_r = round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)
    poles = np.array([p_s, p_r, p_s + p_r], dtype=np.float64)
    peaks = np.array([gear.pull_out_torque_sun, gear.pull_out_torque_ring, gear.pull_out_torque_carrier], dtype=float)
    peak = float(poles @ peaks / (poles @ poles))
    shape = {1: 1.0, **(harmonics or {})}
    for order, share in shape.items():
        if order < 1 or order != int(order) or not math.isfinite(share) or (order == 1 and share != 1.0):
            raise BenchError(
                "harmonics", f"{{{order}: {share}}}", "orders from 2 and finite shares", "Correct the entry."
            )
    orders = np.array(list(shape), dtype=np.int64)
    cosine = -np.array([share / order for order, share in shape.items()])
    zeros = np.zeros(len(orders))
    plain = TorqueMap(p_s, p_r, p_s * orders, p_r * orders, cosine, zeros, "analytic map")
    coupling = plain.scaled(p_s * peak / plain.pull_out.torque_high)
    m, n, a = [coupling.orders_sun], [coupling.orders_ring], [coupling.cosine]
    for cogging, pairs, on_sun in ((cogging_sun, p_s, 1), (cogging_ring, p_r, 0)):
        if cogging is None:
            continue
        order = math.lcm(2 * pairs, p_s + p_r) if cogging.order is None else cogging.order
        if order < 1 or not math.isfinite(cogging.amplitude):
            raise BenchError("cogging", f"{cogging}", "an order from 1 and a finite amplitude", "Correct the entry.")
        m.append(np.array([order * on_sun]))
        n.append(np.array([order * (1 - on_sun)]))
        a.append(np.array([-cogging.amplitude / order]))
    cosines = np.concatenate(a)
    whole = replace(
        coupling,
        orders_sun=np.concatenate(m),
        orders_ring=np.concatenate(n),
        cosine=cosines,
        sine=np.zeros(len(cosines)),
    )
    return whole.scaled(scale)

"""The magnetic torques of a stage, from one potential energy of the three angles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.roots import ROUNDING, rising_root
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Number


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

    @cached_property
    def _plain(self) -> tuple[tuple[int, int, float, float, Number, Number], ...]:
        """Each term: its orders, its shares of phase and sun angle, its amplitudes."""
        p_s, p_r = self.pole_pairs_sun, self.pole_pairs_ring
        orders = [(int(m), int(n)) for m, n in zip(self.orders_sun, self.orders_ring, strict=True)]
        pairs = zip(orders, self.cosine.tolist(), self.sine.tolist(), strict=True)
        return tuple((m, n, n / p_r, (m * p_r - n * p_s) / p_r, a, b) for (m, n), a, b in pairs)

    @property
    def follows_phase(self) -> bool:
        """Whether nothing but the electrical phase matters: no cogging."""
        return all(per_sun == 0.0 for *_, per_sun, _, _ in self._plain)

    def without_cogging(self) -> TorqueMap:
        """The same map with the terms that follow the phase only."""
        kept = self.orders_sun * self.pole_pairs_ring == self.orders_ring * self.pole_pairs_sun
        return replace(
            self,
            orders_sun=self.orders_sun[kept],
            orders_ring=self.orders_ring[kept],
            cosine=self.cosine[kept],
            sine=self.sine[kept],
        )

    def law(self, phase: Number, sun: Number) -> tuple[Number, Number, Number]:
        """Torques on sun and ring [N m] and the energy [J]: plain arithmetic on floats, complex numbers or arrays.

        Parameters
        ----------
        phase : number
            Electrical phase [rad].
        sun : number
            Angle of the sun against the carrier [rad]; it matters to cogging only.
        """
        on_sun: Number = 0.0
        on_ring: Number = 0.0
        energy: Number = 0.0
        for m, n, per_phase, per_sun, a, b in self._plain:
            psi = per_phase * phase + per_sun * sun if per_sun else per_phase * phase
            sine, cosine = np.sin(psi), np.cos(psi)
            pull = a * sine - b * cosine
            on_sun, on_ring = on_sun + m * pull, on_ring + n * pull
            energy = energy + a * cosine + b * sine
        return on_sun, on_ring, energy

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
        carried = (torque > limits.torque_low) & (torque < limits.torque_high)
        if not carried.all():
            i = int(np.flatnonzero(~carried)[0])
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

        rounding = 0.5 * ROUNDING * max(limits.torque_high, -limits.torque_low)
        ends = np.full_like(torque, limits.phase_low), np.full_like(torque, limits.phase_high)
        return rising_root(missing, *ends, rounding=rounding)[0]

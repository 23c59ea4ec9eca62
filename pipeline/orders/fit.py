"""Amplitudes and phases of lines of both shafts, fitted together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.pipeline.orders.band import FALSE_ALARM, LineNoise, emptied, noise_around, periodogram
from pmg.pipeline.wording.probability import CONFIDENCE
from pmg.sim.errors import FitError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy.typing as npt

    from pmg.pipeline.orders.lines import Group
    from pmg.sim.signals import Array, Mask

PIECE = 1 << 12
"""Samples whose cosines and sines are held at once; as many as a processor keeps near."""
WORST_CONDITION = 1e8
"""Condition of the normal equations from which on lines are not separated."""
WHOLE = 1e-6
"""Part of an encoder's step by which an angle may miss a whole number of them."""
TREND = 3
"""Terms of the parabola that a slow change of the signal takes."""


@dataclass(frozen=True)
class Orders:
    r"""Lines of several signals over one window: :math:`x = \mathrm{Re}\, c\, e^{i\psi}`, :math:`c = A e^{i\varphi}`.

    Parameters
    ----------
    groups : tuple of Group
        What was fitted, g of them.
    amplitude : (s, g) complex array
        c, in the unit of the signal.
    u : (s, g) array
        Standard uncertainty of either part of c; NaN where nothing tells the noise.
    dof : (s, g) array
        Its degrees of freedom.
    band : (s, g) array
        Magnitude that pure noise exceeds in 5 % of lines (`band.FALSE_ALARM`).
    residual : (s, n) array
        What is left of the signals.
    """

    groups: tuple[Group, ...]
    amplitude: np.ndarray[tuple[int, int], np.dtype[np.complex128]]
    u: Array
    dof: Array
    band: Array
    residual: Array

    @property
    def magnitude(self) -> Array:
        """A."""
        return np.abs(self.amplitude)

    @property
    def beyond(self) -> Mask:
        """Where the magnitude exceeds its band."""
        return np.asarray(self.magnitude > self.band, dtype=np.bool_)

    @cached_property
    def interval(self) -> tuple[Array, Array]:
        """Both ends of a 95 % interval of the magnitude; from zero where it is within the band."""
        size = self.magnitude
        known = np.isfinite(self.u)
        reach = special.stdtrit(np.where(known, self.dof, 1.0), (1.0 + CONFIDENCE) / 2.0) * self.u
        low = np.where(self.beyond, np.maximum(size - reach, 0.0), np.where(known, 0.0, np.nan))
        return low, size + reach


def fit_orders(
    signals: Array,
    sun: Array,
    ring: Array,
    groups: Sequence[Group],
    rate_hz: float,
    steps: Mapping[str, float] = MappingProxyType({}),
) -> Orders:
    r"""Lines of both shafts in signals over one window, all at once.

    Parameters
    ----------
    signals : (s, n) array
        Finite values on equidistant samples.
    sun, ring : (n,) array
        Angles of the shafts [rad].
    groups : sequence of Group
        Resolved lines (`lines.resolve`).
    rate_hz : float
        Sample rate [Hz].
    steps : mapping of str to float
        One count of the encoder of ``sun`` and ``ring`` [rad]; saves time where angles are whole steps.

    Raises
    ------
    FitError
        The lines cannot be separated in these samples, such as where a shaft stands still in most of them.

    Notes
    -----
    Least squares on a parabola in time, and cosine and sine of each phase at the samples as they are. Lines of one
    shaft do not average out over whole turns of the other unless their ratio allows it; fitted together they need
    not. No resampling takes part. An angle read in steps of :math:`\Delta` takes :math:`(m\Delta)^2/24` off the
    amplitude at order m, at 5120 counts and order 90 half a thousandth. The torque of a sample is a mean over it,
    which takes :math:`(\pi f/f_s)^2/6` off.

    The noise of a line is that of the residual next to its frequency (`band.noise_around`), multiplied by what the
    other lines cost it. The normal equations are summed over pieces of `PIECE` samples, so memory grows with the
    signals only.
    """
    n = signals.shape[1]
    if not groups:
        nothing = np.empty((len(signals), 0))
        return Orders((), nothing.astype(np.complex128), nothing, nothing, nothing, signals - signals.mean(1)[:, None])
    centred = signals - signals.mean(axis=1)[:, None]
    columns = TREND + 2 * len(groups)
    shafts = _Shaft(sun, steps.get("sun")), _Shaft(ring, steps.get("ring"))
    normal, projected = np.zeros((columns, columns)), np.zeros((columns, len(signals)))
    for piece in _pieces(n):
        design = _design(*shafts, groups, piece)
        normal += design @ design.T
        projected += design @ centred[:, piece].T
    condition = float(np.linalg.cond(normal))
    if not condition < WORST_CONDITION:
        raise FitError(
            "lines of both shafts",
            f"{len(groups)} lines that are one in these samples (condition {condition:.1e})",
            f"lines that differ over the window (condition below {WORST_CONDITION:.0e})",
            "Choose a window in which both shafts turn steadily.",
        )
    inverse = np.linalg.inv(normal)
    found = inverse @ projected
    amplitude = found[TREND::2].T + 1j * found[TREND + 1 :: 2].T
    residual = centred
    _subtract(residual, found[:TREND], amplitude, shafts, groups)
    # what the other lines cost a line: one where it is at right angles to them
    cost = np.diag(inverse)[TREND:].reshape(-1, 2).mean(axis=1) * (n / 2.0)
    power, dof, band = _noise(residual, groups, rate_hz, cost)
    return Orders(tuple(groups), amplitude, np.sqrt(power / 2.0), dof, band, residual)


def _subtract(
    signals: Array,
    trend: Array,
    amplitude: npt.NDArray[np.complex128],
    shafts: tuple[_Shaft, _Shaft],
    groups: Sequence[Group],
) -> None:
    """Take a parabola and lines out of signals: what repeats with a shaft is made for one turn, and looked up."""
    left = list(range(len(groups)))
    waves: list[tuple[Array, npt.NDArray[np.intp]]] = []
    for shaft, other in zip(shafts, ("order_ring", "order_sun"), strict=True):
        own = [at for at in left if not getattr(groups[at].lines[0], other)]
        if shaft.place is not None and own:
            orders = [groups[at].lines[0].order_sun + groups[at].lines[0].order_ring for at in own]
            waves.append(((amplitude[:, own] @ np.stack([shaft.turn[order] for order in orders])).real, shaft.place))
            left = [at for at in left if at not in own]
    parts = np.stack([amplitude[:, left].real, amplitude[:, left].imag], axis=-1).reshape(len(signals), -1)
    weights, rest = np.hstack([trend.T, parts]), [groups[at] for at in left]
    for piece in _pieces(signals.shape[1]):
        signals[:, piece] -= weights @ _design(*shafts, rest, piece)
        for wave, place in waves:
            signals[:, piece] -= wave.take(place[piece], axis=1)


def _pieces(n: int) -> list[slice]:
    return [slice(start, min(start + PIECE, n)) for start in range(0, n, PIECE)]


def _design(sun: _Shaft, ring: _Shaft, groups: Sequence[Group], piece: slice) -> Array:
    """Parabola, and cosine and negative sine of each line, over a piece of the window."""
    n = len(sun.angle)
    time = 2.0 * np.arange(piece.start, piece.stop) / (n - 1) - 1.0
    design = np.empty((TREND + 2 * len(groups), len(time)))
    design[0], design[1], design[2] = 1.0, time, time**2 - 1.0 / 3.0
    of_sun, of_ring = sun.powers(piece), ring.powers(piece)
    for place, group in enumerate(groups):
        line = group.lines[0]
        parts = (powers(order) for powers, order in ((of_sun, line.order_sun), (of_ring, line.order_ring)) if order)
        turning = reduce(np.multiply, parts)
        design[TREND + 2 * place] = turning.real
        np.negative(turning.imag, out=design[TREND + 1 + 2 * place])
    return design


class _Shaft:
    r"""Powers of :math:`e^{i\theta}` at the angles of a shaft; where those are steps of its encoder, made for one turn.

    Parameters
    ----------
    angle : (n,) array
        Angles [rad].
    step : float or None
        One count of the encoder [rad]; None where it is not known.
    """

    def __init__(self, angle: Array, step: float | None) -> None:
        self.angle = angle
        self.place: npt.NDArray[np.intp] | None = None
        turn = 0 if step is None else round(REVOLUTION / step)
        if step is None or not turn < len(angle):
            return
        count = np.rint((angle - angle[0]) / step)
        if np.abs(angle - angle[0] - count * step).max() < WHOLE * step:
            self.place = np.mod(count, turn).astype(np.intp)
            self.turn = _Powers(angle[0] + REVOLUTION / turn * np.arange(turn))

    def powers(self, piece: slice) -> Callable[[int], npt.NDArray[np.complex128]]:
        """Powers over a piece of the window, by their orders."""
        if self.place is None:
            return _Powers(self.angle[piece]).__getitem__
        place = self.place[piece]
        return lambda order: self.turn[order].take(place)


class _Powers(dict[int, "npt.NDArray[np.complex128]"]):
    r"""Whole powers of :math:`e^{i\theta}` (n,), each made of two smaller ones when it is first asked for."""

    def __init__(self, angle: Array) -> None:
        """Take the angle of a shaft [rad] (n,)."""
        self[1] = np.exp(1j * angle)

    def __missing__(self, order: int) -> npt.NDArray[np.complex128]:
        """Make the power of an order other than zero."""
        self[order] = self[-order].conj() if order < 0 else self[order // 2] * self[order - order // 2]
        return self[order]


def _noise(residual: Array, groups: Sequence[Group], rate_hz: float, cost: Array) -> tuple[Array, Array, Array]:
    """Power of noise in each line, its degrees of freedom, and the band."""
    bins_per_hz = residual.shape[1] / rate_hz
    places = np.array([group.frequency * bins_per_hz for group in groups])
    spectrum = periodogram(residual)
    around = noise_around(spectrum, emptied(spectrum.shape[1], places), places)
    power = around.power * cost
    return power, around.dof, LineNoise(power, around.dof).band(FALSE_ALARM)

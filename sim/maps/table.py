"""A torque map from a table of field computations: judged first, then made smooth and exactly conservative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.maps.torque_map import TorqueMap
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.bench import GearParameters
    from pmg.sim.signals import Array

    Complex = npt.NDArray[np.complex128]

_SPACING = 1e-6
"""Largest deviation from even steps, relative to a period: rounding of angles printed to some decimals."""

_FEWEST = 5
"""Steps a period that resolve the second harmonic."""

_NEGLIGIBLE = 1e-9
"""Terms this far below the largest one are rounding and are dropped."""


@dataclass(frozen=True)
class FemTable:
    """Torques on a rectangular grid of angles, one magnet period of each rotor, carrier at rest.

    Parameters
    ----------
    angle_sun, angle_ring : (n,), (m,) array
        Angles [rad] in even steps, both ends of the period included.
    torque_sun, torque_ring : (n, m) array
        Torques of the field on the rotors [N m], positive in the positive direction of rotation.
    origin : str
        Name for messages and reports, such as the file it was read from.
    """

    angle_sun: Array
    angle_ring: Array
    torque_sun: Array
    torque_ring: Array
    origin: str = "FEM table"


@dataclass(frozen=True)
class Tolerances:
    """Uncertainty of a table.

    Parameters
    ----------
    edge : float
        Difference between the two ends of a period, relative to the largest torque of that rotor.
    rotational : float
        Root mean square of the torque that no energy explains, relative to that of the whole torque.
    """

    edge: float = 0.01
    rotational: float = 0.01


@dataclass(frozen=True)
class TableQuality:
    """Quality of a table and of the map made of it; relative numbers refer to the root mean square of the torques.

    Parameters
    ----------
    edge : float
        Largest difference between the ends of a period [N m].
    asymmetry : float
        Part of the mean torque that is not odd about the stable zero crossing, relative.
    curl : float
        Root mean square of dT_s/dth_r - dT_r/dth_s, relative to that of the two slopes together.
    rotational : float
        Root mean square of the torque that no energy explains, relative.
    residual_rms, residual_max : float
        Table less map, both rotors [N m].
    terms : int
        Terms kept.
    """

    edge: float
    asymmetry: float
    curl: float
    rotational: float
    residual_rms: float
    residual_max: float
    terms: int


def _refuse_unusable(table: FemTable, periods: tuple[float, float]) -> None:
    shape = (len(table.angle_sun), len(table.angle_ring))
    for name, torque in (("sun torque", table.torque_sun), ("ring torque", table.torque_ring)):
        if torque.shape != shape:
            came, expected = f"an array of {torque.shape}", f"{shape}, one torque a pair of angles"
            raise BenchError(f"{table.origin}: {name}", came, expected, "Give a rectangular table.")
        if not np.isfinite(torque).all():
            i, j = (int(k) for k in np.argwhere(~np.isfinite(torque))[0])
            raise BenchError(f"{table.origin}: {name} at {_place(table, i, j)}", "no number", "one", "Fill the hole.")
        if not torque.any():
            raise BenchError(f"{table.origin}: {name}", "zero everywhere", "a coupling", "Check the columns.")
    for name, angle, period in zip(SIDES, (table.angle_sun, table.angle_ring), periods, strict=True):
        where = f"{table.origin}: {name} angle"
        if len(angle) < _FEWEST + 1:
            raise BenchError(where, f"{len(angle)} values", f"{_FEWEST + 1} or more", "Compute a finer table.")
        even = np.linspace(angle[0], angle[0] + period, len(angle))
        off = np.abs(angle - even)
        if abs(off[-1]) > _SPACING * period:
            span = np.degrees(angle[-1] - angle[0])
            expected = f"{np.degrees(period):.6g} degrees, one magnet period with both its ends"
            raise BenchError(where, f"a span of {span:.6g} degrees", expected, "Cut or complete the table.")
        if off.max() > _SPACING * period:
            i = int(np.argmax(off))
            came, expected = f"{np.degrees(angle[i]):.6g} degrees in row {i}", f"{np.degrees(even[i]):.6g}, even steps"
            raise BenchError(where, came, expected, "Recompute or resample with even steps.")


def _place(table: FemTable, i: int, j: int) -> str:
    return f"sun {np.degrees(table.angle_sun[i]):.4g}, ring {np.degrees(table.angle_ring[j]):.4g} degrees"


def _refuse_open_period(table: FemTable, tolerance: float) -> float:
    largest = 0.0
    for name, torque in (("sun torque", table.torque_sun), ("ring torque", table.torque_ring)):
        peak = float(np.abs(torque).max())
        for axis in (0, 1):
            gap = np.abs(np.take(torque, -1, axis) - np.take(torque, 0, axis))
            k, worst = int(np.argmax(gap)), float(gap.max())
            if worst > tolerance * peak:
                place = _place(table, -1, k) if axis == 0 else _place(table, k, -1)
                raise BenchError(
                    f"{table.origin}: {name} at {place}",
                    f"differs by {worst:.4g} N m from the other end of the period",
                    f"the same value within {tolerance * peak:.4g} N m",
                    "Check the period and the pole pairs, or refine the mesh.",
                )
            largest = max(largest, worst)
    return largest


def _amplitudes(torque: Array, table: FemTable, waves: tuple[Array, Array]) -> Complex:
    """Complex amplitudes of a torque at the waves [1/rad] of both angles, the two ends of a period averaged."""
    closed = torque.copy()
    closed[0] = 0.5 * (torque[0] + torque[-1])
    closed[:, 0] = 0.5 * (closed[:, 0] + closed[:, -1])
    along_sun = np.exp(-1j * np.multiply.outer(waves[0], table.angle_sun[:-1]))
    along_ring = np.exp(-1j * np.multiply.outer(table.angle_ring[:-1], waves[1]))
    return np.asarray(along_sun @ closed[:-1, :-1] @ along_ring / closed[:-1, :-1].size, dtype=np.complex128)


def _on_table(amplitudes: Complex, table: FemTable, waves: tuple[Array, Array]) -> Array:
    along_sun = np.exp(1j * np.multiply.outer(table.angle_sun, waves[0]))
    along_ring = np.exp(1j * np.multiply.outer(waves[1], table.angle_ring))
    return np.asarray((along_sun @ amplitudes @ along_ring).real)


def _rms(*parts: Array | Complex) -> float:
    return float(np.sqrt(sum(np.sum(np.abs(part) ** 2) for part in parts)))


def _refuse_rotational(
    table: FemTable, rest: tuple[Complex, Complex], whole: float, waves: tuple[Array, Array], tolerance: float
) -> float:
    share = _rms(*rest) / whole
    if share > tolerance:
        size = np.hypot(_on_table(rest[0], table, waves), _on_table(rest[1], table, waves))
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(size)), size.shape))
        raise BenchError(
            f"{table.origin} at {_place(table, i, j)}",
            f"{size[i, j]:.4g} N m that no energy explains, {100.0 * share:.3g} % of the torques over the whole table",
            f"{100.0 * tolerance:.3g} % or less, as the work over any closed path must vanish",
            "Check that both torques come from the same field, with the same sign, scale and axial length.",
        )
    return share


def fit_map(
    table: FemTable,
    gear: GearParameters,
    orders: tuple[int, int] | None = None,
    tolerances: Tolerances | None = None,
) -> tuple[TorqueMap, TableQuality]:
    r"""The conservative map nearest to a table, and how near it is.

    Parameters
    ----------
    table : FemTable
        One magnet period of each rotor.
    gear : GearParameters
        Pole pairs of the stage; they set the two periods.
    orders : tuple of int
        Highest harmonics of the sun's and the ring's period; by default all that the steps resolve. Fewer smooth a
        noisy table, and what they leave out counts as residual.
    tolerances : Tolerances
        What to accept.

    Returns
    -------
    TorqueMap, TableQuality
        The interpolant, and the checks as numbers.

    Raises
    ------
    BenchError
        When the table has holes or uneven steps, is not periodic, or is not the slope of an energy; with the place.

    Notes
    -----
    With waves :math:`m = k p_s` and :math:`n = l p_r` both torques are sums of
    :math:`\hat T_{kl}\,e^{i(m\theta_s + n\theta_r)}`. The energy that fits both in the least-squares sense is
    :math:`\hat W_{kl} = i\,(m\hat T_s + n\hat T_r)/(m^2 + n^2)`, wave by wave, since the waves are orthogonal on even
    steps. What remains is the rotational part: the curl divided by its wave number, plus the mean torques, which would
    give work in every period. It is tested as a torque because the curl itself weights the noise of short waves.
    A torque of reversed sign on both rotors looks like a shift by half a period and cannot be found out here.
    """
    limits = tolerances or Tolerances()
    p_s, p_r = round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)
    _refuse_unusable(table, (REVOLUTION / p_s, REVOLUTION / p_r))
    edge = _refuse_open_period(table, limits.edge)
    resolved = ((len(table.angle_sun) - 2) // 2, (len(table.angle_ring) - 2) // 2)
    top = resolved if orders is None else orders
    if not (1 <= top[0] <= resolved[0] and 1 <= top[1] <= resolved[1]):
        raise BenchError(
            f"{table.origin}: orders", str(top), f"1 to {resolved}", "Ask for fewer, or compute more steps."
        )
    k, l = np.arange(-top[0], top[0] + 1), np.arange(-top[1], top[1] + 1)  # noqa: E741  (the paper's index)
    waves = (np.asarray(p_s * k, dtype=np.float64), np.asarray(p_r * l, dtype=np.float64))
    m, n = waves[0][:, None], waves[1][None, :]
    on_sun, on_ring = (_amplitudes(torque, table, waves) for torque in (table.torque_sun, table.torque_ring))
    square = np.where((m == 0.0) & (n == 0.0), 1.0, m**2 + n**2)
    energy = 1j * (m * on_sun + n * on_ring) / square
    rest = (on_sun + 1j * m * energy, on_ring + 1j * n * energy)
    aligned, crossed = abs(energy[top[0] + 1, top[1] + 1]), abs(energy[top[0] + 1, top[1] - 1])
    if crossed > aligned:
        came = f"the energy follows {p_s} th_s - {p_r} th_r"
        expected = f"{p_s} th_s + {p_r} th_r, both angles counted in one direction"
        raise BenchError(f"{table.origin}: ring angle", came, expected, "Reverse the ring angle and the ring torque.")
    rotational = _refuse_rotational(table, rest, _rms(on_sun, on_ring), waves, limits.rotational)
    fitted = _map_of(energy, (p_s, p_r), (k, l), table.origin)
    torques = fitted.torques(table.angle_sun[:, None], table.angle_ring[None, :])
    residual = np.stack([table.torque_sun - torques.sun, table.torque_ring - torques.ring])
    quality = TableQuality(
        edge=edge,
        asymmetry=_asymmetry(fitted),
        curl=_rms(n * on_sun - m * on_ring) / _rms(n * on_sun, m * on_ring),
        rotational=rotational,
        residual_rms=_rms(residual) / float(np.sqrt(residual.size)),
        residual_max=float(np.abs(residual).max()),
        terms=len(fitted.cosine),
    )
    return fitted, quality


def _map_of(
    energy: Complex, pairs: tuple[int, int], index: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]], origin: str
) -> TorqueMap:
    k, l = (part.ravel() for part in np.meshgrid(*index, indexing="ij"))  # noqa: E741
    w = energy.ravel()
    size = np.abs(w) * np.maximum(np.abs(pairs[0] * k), np.abs(pairs[1] * l))
    kept = ((k > 0) | ((k == 0) & (l > 0))) & (size > _NEGLIGIBLE * size.max())
    w = w[kept]
    return TorqueMap(*pairs, pairs[0] * k[kept], pairs[1] * l[kept], 2.0 * w.real, -2.0 * w.imag, origin)


def _asymmetry(fitted: TorqueMap) -> float:
    """Even part of the mean torque about its stable zero crossing, relative to the whole."""
    centre = float(fitted.load_angle(np.zeros(1))[0])
    highest = int(np.abs(fitted.orders_sun).max()) // fitted.pole_pairs_sun
    away = np.linspace(0.0, REVOLUTION, 4 * highest + 4, endpoint=False, dtype=np.float64)
    ahead, behind = fitted.mean_torque(centre + away)[0], fitted.mean_torque(centre - away)[0]
    return _rms(0.5 * (ahead + behind)) / _rms(ahead)

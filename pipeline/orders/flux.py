"""Flux density in the iron poles from the voltage of their coils."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.sim import sources
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Number

COIL_KINDS = ("radial", "tangential")

SOURCE = sources.THESIS.at("equations 3.1 to 3.3, table 3.6")


def linkage_area(bench: BenchParameters, coil: str) -> float:
    """Turns times area of a coil [m2].

    Parameters
    ----------
    bench : BenchParameters
        Turns and areas.
    coil : str
        ``radial_...`` or ``tangential_...``.

    Raises
    ------
    BenchError
        For a coil of another kind.
    """
    kind = coil_kind(coil)
    areas = dict(zip(COIL_KINDS, (bench.coils.area_radial, bench.coils.area_tangential), strict=True))
    if kind not in areas:
        raise BenchError(
            f"coil '{coil}'", f"kind '{kind}'", " or ".join(COIL_KINDS), "Name the channel by its kind and number."
        )
    return float(bench.coils.turns * areas[kind])


def coil_kind(name: str) -> str:
    """Kind of a coil by its name, ``radial`` of ``radial_1``."""
    return name.partition("_")[0]


def flux_of_lines(voltage: Number, rate: Number, area: float) -> Number:
    r"""Complex amplitudes of the flux density of lines [T] from those of the voltage [V].

    Parameters
    ----------
    voltage : (...) complex array
        Amplitudes c in :math:`\mathrm{Re}\, c\,e^{i\psi}`.
    rate : (...) array
        Rate of the phase, :math:`\dot\psi` [rad/s], with its sign.
    area : float
        Turns times area [m2].

    Notes
    -----
    :math:`V = -NA\,\dot B`, hence :math:`\hat B = i\hat V / (NA\,\dot\psi)` line by line. An offset of the amplifier
    is no line and does not take part, so nothing drifts; nor is the field that stands still in the pole seen. The
    area is that of the design; no uncertainty is stated for it.

    References
    ----------
    `SOURCE`.
    """
    return 1j * voltage / (area * rate)

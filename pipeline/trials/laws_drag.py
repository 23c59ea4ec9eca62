r"""Laws of mechanical drag: bearings under load and with thin films, air, a bearing between the shafts, rubbing.

Each is a function of dimensionless covariates, 1 at most a few times over the bench; `x` is the leading one.

References
----------
Palmgren, A. (1959). Ball and Roller Bearing Engineering, 3rd ed.: load-dependent moment :math:`z (P_0/C_0)^y P_1`,
y of 0.33 for roller and up to 0.55 for ball bearings.
SKF (2018). Rolling Bearings, catalogue 17000: rolling moment with :math:`(\nu n)^{0.6}` and a power of the load of
0.31 to 0.54, sliding moment of deep groove ball bearings with :math:`F^{5/3}`.
Hess, D. P., Soom, A. (1990). Friction at a lubricated line contact operating at oscillating sliding velocities.
Journal of Tribology 112, 147-152: mixed friction that falls with :math:`1/(1+x^2)`.
Makkar, C., Dixon, W. E., Sawyer, W. G., Hu, G. (2005). A new continuously differentiable friction model for control
systems design. Proc. IEEE/ASME AIM, 600-605: the fall is that of a hyperbolic tangent.
Schlichting, H. Boundary-Layer Theory: rotating disc, torque with :math:`\omega^{1.5}` laminar, with
:math:`\omega^{1.8}` turbulent.
Boness, R. J. (1989). Churning losses of discs and gears running partially submerged in oil. Proc. ASME 5th Int. Power
Transmission and Gearing Conf., 355-359: coefficients with 1/Re, then with :math:`Re^{1/3}`.
Wendt, F. (1933). Turbulente Strömungen zwischen zwei rotierenden konaxialen Zylindern. Ingenieur-Archiv 4, 577-595:
torque with :math:`\omega^{1.5}` to :math:`\omega^{1.7}` beyond the first vortices.
Eyring, H. (1936). Viscosity, plasticity, and diffusion as examples of absolute reaction rates. Journal of Chemical
Physics 4, 283-291: shear stress with the inverse hyperbolic sine of the rate.
Dieterich, J. H. (1979). Modeling of rock friction. Journal of Geophysical Research 84, 2161-2168: dry friction that
changes with the logarithm of the rate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.laws import Families, Law, softplus

if TYPE_CHECKING:
    from pmg.sim.signals import Array

SLOWEST = 0.02
"""Speed over the highest one up to which creeping friction does not change."""


def _load_power(x: Array, v: Array, power: float) -> Array:
    """A power of the load."""
    return x**power


def _load_radial(x: Array, v: Array, dead_load: float) -> Array:
    """Friction of a radial load that has a part across the torque's, less what that part makes alone."""
    return np.asarray(np.hypot(dead_load, x) - dead_load)


def _load_palmgren(x: Array, v: Array, dead_load: float, y: float) -> Array:
    """Palmgren's moment of that radial load."""
    return np.asarray(np.hypot(dead_load, x) ** (1.0 + y) - dead_load ** (1.0 + y))


def _load_sliding_rolling(x: Array, v: Array, sliding: float, rolling_power: float) -> Array:
    """Sliding with a power 5/3 of the load, and rolling that grows with speed."""
    return np.asarray(sliding * x ** (5.0 / 3.0) + (1.0 - sliding) * x**rolling_power * v**0.6)


def _load_clearance(x: Array, v: Array, gap: float, seat: float) -> Array:
    """Friction that sets in when the load has taken up a clearance."""
    return softplus(x, gap, seat) - softplus(np.zeros_like(x), gap, seat)


def _thin_lorentz(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + x * x))


def _thin_rational(x: Array) -> Array:
    return np.asarray((1.0 + 0.5 * x) ** -3)


def _thin_tanh(x: Array) -> Array:
    return np.asarray(1.0 - np.tanh(x))


def _thin_sech(x: Array) -> Array:
    return np.asarray(1.0 / np.cosh(np.minimum(x, 300.0)))


def _thin_tail(x: Array) -> Array:
    """A fall with a long tail."""
    return np.asarray((1.0 + x) ** -1.5)


def _air_power(x: Array, power: float, laminar: float) -> Array:
    return np.asarray((x**power + laminar * x) / (1.0 + laminar))


def _air_disc(x: Array, turbulent: float) -> Array:
    """A disc of whose radius the inner part is laminar."""
    return np.asarray((1.0 - turbulent) * x**1.5 + turbulent * x**1.8)


def _air_churning(x: Array, corner: float) -> Array:
    """Boness: linear below a speed, with the power 7/3 beyond."""

    def joined(at: Array | float) -> Array:
        return np.asarray(at * (1.0 + (at / corner) ** 4) ** (1.0 / 3.0))

    return joined(x) / joined(1.0)


def _air_transition(x: Array, at: float, width: float, laminar: float) -> Array:
    """Laminar up to a speed, turbulent from there; just below it, so many parts of the turbulent torque."""
    turbulent = 0.5 * (1.0 + np.tanh((x - at) / width))
    return np.asarray((1.0 - turbulent) * laminar * at**0.3 * x**1.5 + turbulent * x**1.8)


def _air_vortices(x: Array, at: float) -> Array:
    """The gap between two cylinders: linear up to the first vortices, with the power 1.6 beyond."""
    return np.asarray(x * (1.0 + (x / at) ** 8) ** 0.075 * at**0.6)


def _between_logarithm(x: Array, load: Array, knee: float) -> Array:
    return np.asarray(np.log1p(x / knee) / np.log1p(1.0 / knee))


def _between_power(x: Array, load: Array, power: float) -> Array:
    return np.asarray(x**power)


def _between_stribeck(x: Array, load: Array, power: float, extra: float, fall: float) -> Array:
    """A power, and more drag at small differences."""
    return np.asarray(x**power + extra / (1.0 + (x / fall) ** 2))


def _between_eyring(x: Array, load: Array, knee: float) -> Array:
    return np.asarray(np.arcsinh(x / knee) / np.arcsinh(1.0 / knee))


def _between_loaded(x: Array, load: Array, power: float, per_load: float) -> Array:
    """A power, and a part with the load of the engaged gear."""
    return np.asarray(x**power + per_load * load)


def _rub_falling(x: Array, load: Array, fall: float) -> Array:
    return np.asarray(1.0 - fall * x**0.7)


def _rub_creeping(x: Array, load: Array, creep: float) -> Array:
    """With the logarithm of the speed."""
    return np.asarray(1.0 + creep * np.log1p(x / SLOWEST) / np.log1p(1.0 / SLOWEST))


def _rub_settling(x: Array, load: Array, steady: float, fall: float) -> Array:
    """An exponential fall to a steady part."""
    return np.asarray(steady + (1.0 - steady) * np.exp(-x / fall))


def _rub_loaded(x: Array, load: Array, per_load: float) -> Array:
    """A small part goes with the load."""
    return np.asarray(1.0 - per_load + per_load * load)


LOAD_FRICTION = Families(
    {
        "power": Law(_load_power, {"power": (0.9, 1.3)}),
        "radial": Law(_load_radial, {"dead_load": (0.1, 0.5)}),
        "palmgren": Law(_load_palmgren, {"dead_load": (0.0, 0.3), "y": (0.33, 0.55)}),
    },
    {
        "sliding_rolling": Law(_load_sliding_rolling, {"sliding": (0.3, 0.8), "rolling_power": (0.31, 0.54)}),
        "clearance": Law(_load_clearance, {"gap": (0.2, 0.5), "seat": (0.05, 0.15)}),
    },
)
"""Of load over a reference load and of speed over the highest one; nothing without load."""
MIXED_LUBRICATION = Families(
    {"lorentz": Law(_thin_lorentz), "rational": Law(_thin_rational), "tanh": Law(_thin_tanh)},
    {"sech": Law(_thin_sech), "tail": Law(_thin_tail)},
)
"""Of speed over a reference speed; 1 at rest, falling."""
WINDAGE = Families(
    {
        "power": Law(_air_power, {"power": (1.7, 2.3), "laminar": (0.05, 0.3)}),
        "disc": Law(_air_disc, {"turbulent": (0.2, 0.9)}),
        "churning": Law(_air_churning, {"corner": (0.3, 0.8)}),
    },
    {
        "transition": Law(_air_transition, {"at": (0.3, 0.7), "width": (0.03, 0.1), "laminar": (0.5, 0.8)}),
        "vortices": Law(_air_vortices, {"at": (0.2, 0.6)}),
    },
)
"""Of speed over the highest one; nothing at rest, rising to about 1."""
RELATIVE_BEARING = Families(
    {
        "logarithm": Law(_between_logarithm, {"knee": (0.1, 0.4)}),
        "power": Law(_between_power, {"power": (0.4, 0.8)}),
        "stribeck": Law(_between_stribeck, {"power": (0.4, 0.8), "extra": (0.3, 1.0), "fall": (0.05, 0.3)}),
    },
    {
        "eyring": Law(_between_eyring, {"knee": (0.05, 0.3)}),
        "loaded": Law(_between_loaded, {"power": (0.4, 0.8), "per_load": (0.3, 1.0)}),
    },
)
"""Of the speed difference and of the load, each over a reference one."""
RUBBING = Families(
    {
        "falling": Law(_rub_falling, {"fall": (-0.1, 0.25)}),
        "creeping": Law(_rub_creeping, {"creep": (-0.25, 0.25)}),
        "settling": Law(_rub_settling, {"steady": (0.6, 0.9), "fall": (0.05, 0.3)}),
    },
    {"loaded": Law(_rub_loaded, {"per_load": (0.03, 0.12)})},
)
"""Of speed over the highest one and of load over a reference one; about 1."""

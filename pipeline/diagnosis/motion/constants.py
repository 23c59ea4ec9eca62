"""Constants of the bench in motion: their data sheet, and how far each may be off it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.shafts import SIDES, PerShaft, per_shaft

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy.typing as npt

    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

SPEED_UNIT = 100.0
"""Speed [rad/s] in whose units loss curves are written."""

DRAG_POWERS = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Powers of speed in the drag of a rotor, in neutral and engaged: a loss curve of the campaign's own."""

ENGAGED_POWERS = (0.0, 1.0, 2.0)
"""Powers of speed in the drag that a rotor has besides when engaged."""

FORM_SPEEDS = (1.5, 4.0, 10.0, 25.0, 60.0, 150.0)
"""Speeds [rad/s] between which the drag may be off its curve."""

FORM = (4e-3, 4e-3, 3e-3, 1e-3, 1e-3, 1e-3)
"""Standard deviation by which it may be off there [N m]: real loss curves are not of the fitted form, least of all
where a film of lubricant breaks."""

PASSAGES, PASSAGE_FORM = (0.1, 0.6, 1.2), 0.03
"""Speeds [rad/s] over which friction may pass through standstill too, and how much of it may [N m]."""

SLIP_PASSAGE, SLIP_FORM = 1.0, 1e-3
"""Rate of the pole angle [rad/s] about which its damping may be off its law, and by how much [N m]."""

MAP_WAVES, MAP_FORM = (2, 3), 5e-4
"""Harmonics by which the torque over the pole angle may be off a sine, and by how much [N m]."""

RIPPLE = {1: 6e-4, 2: 4e-4}
"""Standard deviation of each wave of a turn that every reading has, by its order [N m]."""

ECCENTRICITY = 1e-4
"""Standard deviation of each wave of a turn in the angle that an encoder shows [rad]."""

POLE_ORDERS = (10, 18, 26, 90)
"""Periods a turn that the design gives cogging: poles of a rotor, iron poles, and their least common multiple."""

COGGING_ORDERS = (*range(5, 27), 90)
"""Periods a turn that cogging may have: a magnet or an iron pole that differs from the others adds any up to the poles
of the larger rotor."""

SKEW = 5e-4
"""Standard uncertainty of the time between a torque and an angle of the same sample [s]: half a sample at 1 kHz."""

GIVE_FORM, GIVE_NOISE = 1e-4, 5e-7
"""Standard deviation by which a coupling may give more or less than its stiffness says [rad/(N m)]: hubs; and
what the noise of a torque in its own second derivative adds, times the inertia behind it [kg m2 rad/(N m)]."""

LOSS = 2.5e-7
"""Standard deviation of a coupling's damping over the square of its stiffness [rad s/(N m)]: one of 4000 N m/rad that
settles within a millisecond has so much. The 42 N m s/rad of table 6.5 of the thesis would be ten times as much and
settle in ten, which would pass for a late torque: it is not taken for known, and a coupling so damped is no constant
but the mechanism of a softer one that is damped."""

ENGAGED_DRY = 2e-3
"""Standard deviation of the dry friction of a rotor that engaging brings [N m]: nothing touches in a magnetic gear."""

FREE = np.inf


@dataclass(frozen=True)
class SheetConstant:
    """A constant of the baseline.

    Parameters
    ----------
    name, unit : str
        Its name in files; SI unit.
    expected, spread : float
        Value of the data sheet and its standard uncertainty; infinite where the campaign alone decides.
    """

    name: str
    unit: str
    expected: float
    spread: float


@dataclass(frozen=True)
class SheetSum:
    """A sum of constants that should be zero where a loss curve falls: its rise, less that which is expected.

    Parameters
    ----------
    side : str
        Of the rotor.
    weights : (k,) array
        Of the constants.
    spread : float
        Its standard uncertainty [N m].
    fall : float
        By how much a loss curve falls, fitted without it [N m].
    between : tuple of float
        From which speed to which [rad/s].
    """

    side: str
    weights: Array
    spread: float
    fall: float
    between: tuple[float, float]

    @property
    def name(self) -> str:
        """What is wrong where it is not zero, as names of constants begin."""
        return f"falling_{self.side}"


@dataclass(frozen=True)
class DataSheet:
    """The constants of the baseline by name, in order, and the poles of the gear.

    Parameters
    ----------
    constants : tuple of SheetConstant
        Those of the bench, then the pole angle at the start of each engaged run.
    poles : PerShaft of int
        Pole pairs of the rotors.
    sums : tuple of SheetSum
        What is known of sums of them.
    """

    constants: tuple[SheetConstant, ...]
    poles: PerShaft[int]
    sums: tuple[SheetSum, ...] = ()

    def __len__(self) -> int:
        """Count of constants."""
        return len(self.constants)

    def at(self, name: str) -> int:
        """Place of a constant."""
        return self._places[name]

    def with_known(self, known: Mapping[str, tuple[float, float]]) -> DataSheet:
        """The sheet with other values and standard uncertainties of some constants, as another campaign found them."""
        constants = tuple(
            replace(each, expected=known[each.name][0], spread=known[each.name][1]) if each.name in known else each
            for each in self.constants
        )
        return replace(self, constants=constants)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: place for place, name in enumerate(self.names)}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in order."""
        return tuple(constant.name for constant in self.constants)

    @cached_property
    def expected(self) -> Array:
        """Values of the data sheet (k,)."""
        return np.array([constant.expected for constant in self.constants])

    @cached_property
    def spread(self) -> Array:
        """Standard uncertainties (k,); infinite where free."""
        return np.array([constant.spread for constant in self.constants])

    @cached_property
    def known(self) -> npt.NDArray[np.intp]:
        """Places of the constants of which it says something (s,)."""
        return np.flatnonzero(np.isfinite(self.spread))

    @cached_property
    def rows(self) -> Array:
        """What it says as whitened rows (s, k): change of each per change of a constant; those of sums come last."""
        found = np.zeros((len(self.known), len(self)))
        found[np.arange(len(self.known)), self.known] = 1.0 / self.spread[self.known]
        return np.vstack([found, *(each.weights / each.spread for each in self.sums)])

    def columns_of(self, names: tuple[str, ...], rows: int) -> Array:
        """Columns (m, k) of constants that are off: they move what the sheet says of them, the last of `rows` rows."""
        found = np.zeros((rows, len(names)))
        known = slice(rows - len(self.rows), rows - len(self.sums))
        found[known] = -self.rows[: len(self.known), [self.at(name) for name in names]]
        return found

    def columns_of_sums(self, rows: int) -> dict[str, Array]:
        """Columns (m, j) of sums that are off, by name, in the same way."""
        whole = np.eye(rows, len(self.sums), len(self.sums) - rows)
        names = np.array([each.name for each in self.sums])
        return {str(name): whole[:, names == name] for name in dict.fromkeys(names)}

    def off(self, values: Array) -> Array:
        """What it says less values (k,), in its standard uncertainties (s,)."""
        of_sums = [-each.weights @ values / each.spread for each in self.sums]
        return np.concatenate([(self.expected - values)[self.known] / self.spread[self.known], of_sums])


def drag_names(side: str) -> tuple[str, ...]:
    """Names of the coefficients of a rotor's drag, and of those it has besides when engaged."""
    return (*_powers("drag", side, DRAG_POWERS), *_powers("engaged_drag", side, ENGAGED_POWERS))


def dry_name(side: str) -> str:
    """Name of the dry friction that a rotor has besides when engaged."""
    return drag_names(side)[len(DRAG_POWERS)]


def map_name(wave: int) -> str:
    """Name of a harmonic of the torque over the pole angle."""
    return f"map_off_{wave}"


def form_names(side: str) -> tuple[str, ...]:
    """Names of what a rotor's drag is off its curve at each of `FORM_SPEEDS`."""
    return tuple(f"drag_{side}_off_at_{speed:g}" for speed in FORM_SPEEDS)


def passage_names(side: str) -> tuple[str, ...]:
    """Names of the friction of a rotor that passes through standstill over each of `PASSAGES`."""
    return tuple(f"drag_{side}_passing_over_{speed:g}" for speed in PASSAGES)


def _powers(name: str, side: str, powers: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{name}_{side}_{power:g}" for power in powers)


def ripple_names(side: str, order: int) -> tuple[str, str]:
    """Names of the cosine and the sine of a wave of a turn in the reading of a shaft."""
    return f"ripple_{side}_{order}_cosine", f"ripple_{side}_{order}_sine"


def eccentricity_names(side: str) -> tuple[str, str]:
    """Names of the cosine and the sine of the wave of a turn in the angle of an encoder."""
    return f"eccentricity_{side}_cosine", f"eccentricity_{side}_sine"


def coupling_loss_name(side: str) -> str:
    """Name of what a coupling gives less per rate of its torque, d/k2 for a damping d and a stiffness k."""
    return f"coupling_loss_{side}"


def start_name(file: str) -> str:
    """Name of the pole angle at the start of a run."""
    return f"pole_angle_{file}"


def sheet_of(bench: BenchParameters, gear: int, engaged: tuple[str, ...]) -> DataSheet:
    """The constants of a bench, and those of the engaged runs by file.

    Notes
    -----
    Standard uncertainties: 5 % of a rotor's inertia, 20 % of a coupling's stiffness and what `GIVE_FORM` says of it,
    `LOSS` of its damping, 3 % of the pull-out torque; 2 mN m of the zero of a transducer and of dry friction that
    engaging brings. Loss curves and the damping of the pole angle are the campaign's own.
    """
    stage = bench.gear(gear)
    peak = float(stage.pull_out_torque_sun) / stage.pole_pairs.sun

    def constants() -> Iterator[SheetConstant]:
        for side in SIDES:
            inertia = float(getattr(bench.shafts, f"inertia_{side}")) + float(getattr(bench.rotors, f"inertia_{side}"))
            compliance = 1.0 / float(bench.shafts.joint_stiffness)
            yield SheetConstant(f"inertia_{side}", "kg m2", inertia, 0.05 * inertia)
            give = float(np.linalg.norm([0.2 * compliance, GIVE_FORM, GIVE_NOISE / inertia]))
            yield SheetConstant(f"compliance_{side}", "rad/(N m)", compliance, give)
            yield SheetConstant(coupling_loss_name(side), "rad s/(N m)", 0.0, LOSS)
            yield SheetConstant(f"zero_{side}", "N m", 0.0, 2e-3)
            yield SheetConstant(f"skew_{side}", "s", 0.0, SKEW)
        yield SheetConstant("pull_out", "N m", peak, 0.03 * peak)
        yield SheetConstant("slip_damping", "N m s/rad", 0.0, FREE)
        yield from (SheetConstant(f"slip_damping_off_{side}", "N m", 0.0, SLIP_FORM) for side in SIDES)
        yield from (SheetConstant(map_name(wave), "N m", 0.0, MAP_FORM) for wave in MAP_WAVES)
        for side in SIDES:
            for name in drag_names(side):
                yield SheetConstant(name, "N m", 0.0, ENGAGED_DRY if name == dry_name(side) else FREE)
            for name, off in zip(form_names(side), FORM, strict=True):
                yield SheetConstant(name, "N m", 0.0, off)
            yield from (SheetConstant(name, "N m", 0.0, PASSAGE_FORM) for name in passage_names(side))
        for side in SIDES:
            for order, ripple in RIPPLE.items():
                yield from (SheetConstant(name, "N m", 0.0, ripple) for name in ripple_names(side, order))
            yield from (SheetConstant(name, "rad", 0.0, ECCENTRICITY) for name in eccentricity_names(side))
        yield from (SheetConstant(start_name(file), "rad", 0.0, FREE) for file in engaged)

    return DataSheet(tuple(constants()), per_shaft(lambda side: stage.pole_pairs[side]))

"""Covariates of a grid for its residuals, as structure and as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.structure import REST, ResidualStructure, families, past_power, place, preceding
from pmg.sim.shafts import other_side
from pmg.sim.signals import HOUR, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Mask

MEMORY = 1800.0
"""Time constant of the run history that tables and figures show [s]; the test looks at several."""


FIFTHS = (0.2, 0.4, 0.6, 0.8)
"""Quantiles of a covariate up to which its readings are low, between which they are in the middle, past which high."""

WHOLE = 100.0
"""Values from here on are written without decimals."""


@dataclass(frozen=True)
class Covariate:
    """One thing that a residual may follow.

    Parameters
    ----------
    id : str
        Name in files.
    words : str
        Name for people.
    unit : str
        Unit of its values where they are shown; empty for a sign.
    configurations : tuple of str
        Where it is looked at.
    ordered : bool
        Whether it needs the order of the test.
    signs : tuple of str
        What -1, 0 and 1 stand for, where it is a sign.
    """

    id: str
    words: str
    unit: str
    configurations: tuple[str, ...]
    ordered: bool = False
    signs: tuple[str, ...] = ()


BOTH = ("neutral", "engaged")
TURNING = ("backward", "at rest", "forward")
APPROACH = ("falling", "unchanged", "rising")

COVARIATES = (
    Covariate("own_speed", "own speed", "rpm", BOTH),
    Covariate("other_speed", "other speed", "rpm", ("neutral",)),
    Covariate("speed_difference", "speed difference", "rpm", ("neutral",)),
    Covariate("pole_slip", "pole slip", "rpm", ("neutral",)),
    Covariate("both_speeds", "own × other speed", "rpm", ("neutral",)),
    Covariate("load", "load", "N m", ("engaged",)),
    Covariate("load_speed", "load × own speed", "W", ("engaged",)),
    Covariate("power_flow", "direction of the power flow", "", ("engaged",), signs=("reversed", "", "forward")),
    Covariate("time", "time", "h", (*BOTH, "zero"), ordered=True),
    Covariate("time_drag", "drag that changes with time", "h", BOTH, ordered=True),
    Covariate("run_history", "run history", "W", BOTH, ordered=True),
    Covariate("previous_point", "previous point", "rpm", BOTH, ordered=True),
    Covariate("sign_own", "direction of rotation", "", BOTH, signs=TURNING),
    Covariate("sign_other", "direction of the other shaft", "", ("neutral",), signs=TURNING),
    Covariate("sign_both", "same or opposite directions", "", ("neutral",), signs=("opposite", "one at rest", "same")),
    Covariate("approach", "rising or falling own speed", "", BOTH, ordered=True, signs=APPROACH),
    Covariate("approach_other", "rising or falling other speed", "", ("neutral",), ordered=True, signs=APPROACH),
)
"""Everything that is looked at, in the order in which it is reported."""

BY_ID = {covariate.id: covariate for covariate in COVARIATES}

_SIGNS = ("sign_own", "sign_other", "sign_both", "approach", "approach_other")

_FAMILIES: dict[tuple[str, ...], str] = {
    **{(name,): name for name in _SIGNS},
    ("pole_slip_speed",): "pole_slip",
    ("speed_difference",): "speed_difference",
    ("load",): "load",
    ("power_flow", "load"): "power_flow",
    ("order",): "time",
    ("run_history",): "run_history",
    ("previous_point",): "previous_point",
}
"""Covariates of the families, where the names do not depend on the shaft."""


@dataclass(frozen=True)
class Look:
    """A covariate on the readings of one shaft, with the structure that stands for it.

    Parameters
    ----------
    covariate : Covariate
        What it is.
    family : ResidualStructure
        Its columns over the m readings.
    rows : (m,) array of bool
        Readings that are looked at.
    value : (m,) array
        The covariate at each reading, in its unit; NaN where it is not looked at.
    """

    covariate: Covariate
    family: ResidualStructure
    rows: Mask
    value: Array

    def shape(self, drag: Array) -> tuple[tuple[str, float], ...]:
        """Mean drag at low, middle and high values of the covariate, or at each of its signs."""
        known = np.isfinite(self.value) & np.isfinite(drag)
        value, part = self.value[known], drag[known]
        if self.covariate.signs:
            signs = zip((-1.0, 0.0, 1.0), self.covariate.signs, strict=True)
            return tuple((name, float(part[value == x].mean())) for x, name in signs if (value == x).any())
        low, near, far, high = np.quantile(value, FIFTHS)
        thirds = (value <= low, (value >= near) & (value <= far), value >= high)
        return tuple((self._where(float(value[rows].mean())), float(part[rows].mean())) for rows in thirds)

    def _where(self, value: float) -> str:
        return f"{value:.0f} {self.covariate.unit}" if abs(value) >= WHOLE else f"{value:.3g} {self.covariate.unit}"


def _id(family: ResidualStructure, shaft: str) -> str:
    """Covariate of a family; empty for one that another covers."""
    own, other = f"speed_{shaft}", f"speed_{other_side(shaft)}"
    names = _FAMILIES | {
        (own,): "own_speed",
        (other,): "other_speed",
        (own, other): "both_speeds",
        ("load", own): "load_speed",
        ("order", own): "time_drag",
    }
    return names.get(family.covariates, "")


def looks(readings: Readings, bench: BenchParameters, model: LossModel) -> tuple[Look, ...]:
    """Every covariate that these readings can be held against.

    Parameters
    ----------
    readings : Readings
        The m readings of a fit.
    bench : BenchParameters
        Pole pairs.
    model : LossModel
        Bearing curves: warming scales a drag.

    Notes
    -----
    The families of the mismatch test (`pmg.pipeline.fit.structure`) and, in addition, directions of rotation and
    of approach: a drag of another size in the other direction, constant and growing with the own speed, and a drag
    that differs after a rise and after a fall of speed.
    """
    found = []
    for family in (*families(readings, bench, model), *_directions(readings)):
        shaft = family.signal.removeprefix("torque_")
        name = _id(family, shaft)
        if name and family.columns.any():
            looked = (readings.sun == (shaft == "sun")) & (
                (readings.configuration == family.configuration) | (family.configuration == "all")
            )
            shown = np.where(looked, _values(name, shaft, readings, bench, model), np.nan)
            found.append(Look(BY_ID[name], family, looked, shown))
    return tuple(sorted(found, key=lambda look: COVARIATES.index(look.covariate)))


def _directions(readings: Readings) -> Iterator[ResidualStructure]:
    """Families of the signs of rotation and of the approach to the speed."""
    at = readings.grid.points
    own, other = _sign(readings.speed_own), _sign(readings.speed_other)
    whole = np.abs(readings.speed_own) / max(float(np.abs(readings.speed_own).max(initial=0.0)), 1e-12)
    neutral = readings.configuration == "neutral"
    for shaft, mine in readings.of_shaft.items():
        signal = f"torque_{shaft}"
        kinds = np.unique(readings.configuration[mine])
        offset = np.where(own == 0.0, 1.0, own)
        everywhere = str(kinds[0]) if len(kinds) == 1 else "all"
        checked = bool((mine & (readings.configuration == "zero")).any())
        yield _signs(readings, signal, everywhere, "sign_own", mine, np.c_[offset, own * whole], kept=checked)
        rows = mine & neutral
        yield _signs(readings, signal, "neutral", "sign_other", rows, np.c_[other, other * whole])
        yield _signs(readings, signal, "neutral", "sign_both", rows, np.c_[own * other, own * other * whole])
        if not at.ordered:
            continue
        rises = at.speed.map(lambda speed: _sign(_change(at, speed))[readings.row])
        for configuration in BOTH:
            rows = mine & (readings.configuration == configuration)
            yield _signs(readings, signal, configuration, "approach", rows, rises[shaft][:, None])
        yield _signs(readings, signal, "neutral", "approach_other", mine & neutral, rises[other_side(shaft)][:, None])


def _signs(
    readings: Readings, signal: str, configuration: str, name: str, rows: Mask, columns: Array, *, kept: bool = False
) -> ResidualStructure:
    """A family of signs; without columns where not both signs occur and it is not to be kept."""
    first = columns[rows, 0]
    both = bool((first > 0.0).any() and (first < 0.0).any())
    shown = columns[rows] if kept or both else columns[rows][:, :0]
    return ResidualStructure(signal, configuration, (name,), place(readings, rows, shown))


def _sign(values: Array) -> Array:
    """Sign of speeds [rad/s], 0 at rest."""
    return np.where(np.abs(values) > REST, np.sign(values), 0.0)


def _change(at: OperatingPoints, speed: Array) -> Array:
    """Rise of a speed's magnitude since the point before [rad/s]; 0 for the first."""
    return np.nan_to_num(np.abs(speed) - preceding(at, np.abs(speed)))


def _values(name: str, shaft: str, readings: Readings, bench: BenchParameters, model: LossModel) -> Array:
    """A covariate at every reading, in the unit that is shown."""
    at = readings.grid.points
    row, own, other = readings.row, readings.speed_own, readings.speed_other
    if name == "pole_slip":
        slip = bench.pole_slip(at.gear, at.speed_sun, at.speed_ring)
        return SPEED_SUN.display(readings.direction * slip[row])
    if name in ("time", "time_drag"):
        return np.asarray((at.started_at[row] - at.started_at.min()) / HOUR)
    if name == "run_history":
        return past_power(readings, model, shaft, MEMORY)
    if name == "previous_point":
        return SPEED_SUN.display(preceding(at, np.abs(at.speed_sun))[row])
    if name.startswith("approach"):
        side = shaft if name == "approach" else other_side(shaft)
        return _sign(_change(at, at.speed[side]))[row]
    load = np.abs(at.torque_ring[row])
    plain: dict[str, Array] = {
        "own_speed": SPEED_SUN.display(np.abs(own)),
        "other_speed": SPEED_SUN.display(np.abs(other)),
        "speed_difference": SPEED_SUN.display(readings.direction * (own - other)),
        "both_speeds": SPEED_SUN.display(np.sqrt(np.abs(own * other))),
        "load": load,
        "load_speed": load * np.abs(own),
        "power_flow": np.where(at.drive[row] == "ring", -1.0, 1.0),
        "sign_own": _sign(own),
        "sign_other": _sign(other),
        "sign_both": _sign(own) * _sign(other),
    }
    return plain[name]


def untested(readings: Readings, found: tuple[Look, ...], absorbed: tuple[Look, ...], shaft: str) -> dict[str, str]:
    """Covariates that cannot be tested on one shaft, each with the reason; of `absorbed` the fit leaves nothing."""
    signal = f"torque_{shaft}"
    mine = readings.sun == (shaft == "sun")
    kinds = set(readings.configuration[mine])
    reasons = {}
    for covariate in COVARIATES:
        of_it = [look for look in found if look.covariate is covariate and look.family.signal == signal]
        if any(look not in absorbed for look in of_it):
            continue
        if of_it:
            reasons[covariate.id] = "the fit takes all of it"
        elif covariate.ordered and not readings.grid.points.ordered:
            reasons[covariate.id] = "not recorded: the order of the test is not known"
        elif not kinds & set(covariate.configurations):
            where = " or ".join(covariate.configurations)
            reasons[covariate.id] = f"no {where} reading of this shaft in this fit"
        else:
            reasons[covariate.id] = "constant on this grid"
    return reasons

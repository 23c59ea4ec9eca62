"""Operating points and grids: what the bench and the simulator both make, so comparing is subtraction."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import GridError
from pmg.sim.shafts import PerShaft

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask


class Configuration(StrEnum):
    """Where the carrier stands, or that the bench is at rest."""

    NEUTRAL = "neutral"
    ENGAGED = "engaged"
    ZERO = "zero"


@dataclass(frozen=True)
class OperatingPoints:
    """Steady points of the bench, one row each.

    Signs are those of the recordings: positive rotation is the sun's forward direction for both shafts, so the
    ring's speed is negative when engaged and driven forward. A torque is what the motor applies to the gearbox.

    Parameters
    ----------
    name : (n,) array of str
        Test point, unique in the campaign.
    configuration : (n,) array of str
        `Configuration` of each point.
    gear : (n,) array of int
        1 or 2.
    drive : (n,) array of str
        Side that drives when engaged: ``sun``, or ``ring`` for reversed power flow.
    speed_sun, speed_ring : (n,) array
        Speeds [rad/s].
    torque_ring : (n,) array
        Torque that the ring motor applies [N m]; the load when engaged.
    load_set : (n,) array
        Ring torque asked for [N m], signed as recorded; 0 in neutral.
    started_at : (n,) array
        Start of the point [s since 1970, UTC]; NaN where the order is not known.
    rest_sun, rest_ring : (n,) array of bool
        Shaft held at rest by its motor: its torque is a static reaction, not a drag.
    """

    name: npt.NDArray[np.str_]
    configuration: npt.NDArray[np.str_]
    gear: npt.NDArray[np.int64]
    drive: npt.NDArray[np.str_]
    speed_sun: Array
    speed_ring: Array
    torque_ring: Array
    load_set: Array
    started_at: Array
    rest_sun: Mask
    rest_ring: Mask

    def __post_init__(self) -> None:
        lengths = {f.name: len(getattr(self, f.name)) for f in fields(self)}
        if len(set(lengths.values())) > 1:
            raise GridError("OperatingPoints", f"columns of lengths {lengths}", "one length", "Give every column.")

    def __len__(self) -> int:
        return len(self.name)

    def __getitem__(self, rows: Mask | npt.NDArray[np.int64]) -> OperatingPoints:
        """The chosen rows."""
        return replace(self, **{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def speed(self) -> PerShaft[Array]:
        """Speeds of the shafts [rad/s], (n,) each."""
        return PerShaft(self.speed_sun, self.speed_ring)

    @property
    def rest(self) -> PerShaft[Mask]:
        """Where each shaft is held at rest by its motor, (n,) each."""
        return PerShaft(self.rest_sun, self.rest_ring)

    @cached_property
    def where(self) -> dict[Configuration, Mask]:
        """Rows of each configuration, compared once: every mechanism asks for them at every fit."""
        masks = {each: np.asarray(self.configuration == each) for each in Configuration}
        for mask in masks.values():
            mask.setflags(write=False)
        return masks

    @property
    def engaged(self) -> Mask:
        """Rows with the gear engaged."""
        return self.where[Configuration.ENGAGED]

    @property
    def neutral(self) -> Mask:
        """Rows with the carrier between the stages."""
        return self.where[Configuration.NEUTRAL]

    @property
    def zero(self) -> Mask:
        """Rows with both shafts free and at rest: the transducers' zero."""
        return self.where[Configuration.ZERO]

    @property
    def ordered(self) -> bool:
        """Whether the order in which the points were run is known."""
        return bool(np.isfinite(self.started_at).all())


@dataclass(frozen=True)
class Grid:
    """Torques at steady points, measured or simulated.

    Parameters
    ----------
    origin : str
        ``measured``, ``simulated`` or ``published``.
    campaign : str
        Name of the campaign.
    points : OperatingPoints
        The n points.
    torque_sun, torque_ring : (n,) array
        Torques that the motors apply to the gearbox [N m].
    within_sun, within_ring : (n,) array
        Standard uncertainty of the mean from what varies within the window [N m].
    u_sun, u_ring : (n,) array
        Standard uncertainty of the point, independent from point to point [N m]: within-window part and the
        wander between points together, once the noise floor has been estimated.
    common_sun, common_ring : (n,) array
        Standard uncertainty that all points share (sensitivity of the transducer) [N m]; it does not average out.
    accepted : (n,) array of bool
        Whether the window met every check.
    reason : (n,) array of str
        Why not, where it did not.
    rounding : float
        Step to which the torques are rounded [N m]; 0 where they are not.
    """

    origin: str
    campaign: str
    points: OperatingPoints
    torque_sun: Array
    torque_ring: Array
    within_sun: Array
    within_ring: Array
    u_sun: Array
    u_ring: Array
    common_sun: Array
    common_ring: Array
    accepted: Mask
    reason: npt.NDArray[np.str_]
    rounding: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.points)
        for name in ROW_FIELDS:
            if len(getattr(self, name)) != n:
                raise GridError(f"Grid.{name}", f"{len(getattr(self, name))} rows", f"{n} rows", "Give every row.")

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: Mask | npt.NDArray[np.int64]) -> Grid:
        """The chosen rows."""
        chosen = {name: getattr(self, name)[rows] for name in ROW_FIELDS}
        return replace(self, points=self.points[rows], **chosen)

    @property
    def torque(self) -> PerShaft[Array]:
        """Torques that the motors apply [N m], (n,) each."""
        return PerShaft(self.torque_sun, self.torque_ring)

    @property
    def within(self) -> PerShaft[Array]:
        """Standard uncertainty from what varies within the window [N m], (n,) each."""
        return PerShaft(self.within_sun, self.within_ring)

    @property
    def u(self) -> PerShaft[Array]:
        """Standard uncertainty that is independent from point to point [N m], (n,) each."""
        return PerShaft(self.u_sun, self.u_ring)

    @property
    def common(self) -> PerShaft[Array]:
        """Standard uncertainty that all points share [N m], (n,) each."""
        return PerShaft(self.common_sun, self.common_ring)


ROW_FIELDS = (
    "torque_sun",
    "torque_ring",
    "within_sun",
    "within_ring",
    "u_sun",
    "u_ring",
    "common_sun",
    "common_ring",
    "accepted",
    "reason",
)
"""Columns of a `Grid` in addition to those of its points."""

"""Sun and ring: a value for each of the two shafts, and the members of the gear."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SIDES = ("sun", "ring")
"""Names of the shafts, in the order in which they stand everywhere."""

T_co = TypeVar("T_co", covariant=True)
U = TypeVar("U")


class Member(StrEnum):
    """A member of the magnetic gear."""

    SUN = "sun"
    RING = "ring"
    CARRIER = "carrier"


@dataclass(frozen=True)
class PerShaft(Generic[T_co]):
    """A value for each shaft, named by `SIDES`; it iterates over sun and ring in that order."""

    sun: T_co
    ring: T_co

    def __iter__(self) -> Iterator[T_co]:
        """The two values, the sun's first."""
        return iter((self.sun, self.ring))

    def __getitem__(self, side: str) -> T_co:
        """The value of the shaft of that name.

        Raises
        ------
        KeyError
            For a name that is no shaft's.
        """
        if side not in SIDES:
            raise KeyError(side)
        return self.sun if side == SIDES[0] else self.ring

    def items(self) -> Iterator[tuple[str, T_co]]:
        """Name and value of each shaft."""
        return zip(SIDES, self, strict=True)

    def map(self, function: Callable[[T_co], U]) -> PerShaft[U]:
        """The function of each value."""
        return PerShaft(function(self.sun), function(self.ring))


def per_shaft(function: Callable[[str], U]) -> PerShaft[U]:
    """The function of the name of each shaft."""
    return PerShaft(*map(function, SIDES))


def on_side(side: str, value: U, elsewhere: U) -> PerShaft[U]:
    """A value on the shaft of that name, and another one on the opposite shaft."""
    return per_shaft(lambda name: value if name == side else elsewhere)


def other_side(side: str) -> str:
    """Name of the opposite shaft."""
    return SIDES[1 - SIDES.index(side)]

"""Effects that a campaign may conceal: what each does to the machine, and by which law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.trials.effect import PlacedForm
from pmg.pipeline.trials.laws import Families, Law

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.trials.motion.machine import SyntheticMachine
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class MotionForm:
    """What an effect does.

    Parameters
    ----------
    identifier : str
        Id of the vocabulary; ``outside_...`` for what no library knows.
    components : mapping of str to str
        Places it may sit at, by shaft, each with the component of the bench.
    unit : str
        Unit of its size.
    first : float
        A size of the usual order, from which scaling starts.
    most : float
        Largest size that a bench could have.
    act : callable
        Changes the machine; nothing at size 0.
    laws : Families
        Laws that it may follow.
    ranges : mapping of str to (low, high)
        Knobs that are drawn whatever the law.
    signed : bool
        Whether it may go either way.
    seen : bool
        Whether it shows in the balances of the rotors, so that its size can be told in sigmas.
    """

    identifier: str
    components: Mapping[str, str]
    unit: str
    first: float
    most: float
    act: Callable[[SyntheticMachine, MotionEffect], None]
    laws: Families
    ranges: Mapping[str, tuple[float, float]]
    signed: bool = False
    seen: bool = True


class MotionEffect(PlacedForm[MotionForm]):
    """An effect on the machine in motion."""

    @property
    def signed(self) -> float:
        """Its size with its sign."""
        return self.size * self.number("sign")


def named_laws(**ranges: Mapping[str, tuple[float, float]]) -> Families:
    """Laws that are told apart by name where the effect acts, each with the ranges of its constants."""
    return Families({name: Law(_no_shape, given) for name, given in ranges.items()})


def _no_shape(x: Array) -> Array:
    return x

"""Effects that a campaign may conceal: what each does to the machine, and by which law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from pmg.pipeline.trials.laws import Families, Law

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.trials.motion.machine import Machine
    from pmg.sim.signals import Array

Knobs: TypeAlias = "Mapping[str, float | str]"


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
    act: Callable[[Machine, MotionEffect], None]
    laws: Families
    ranges: Mapping[str, tuple[float, float]]
    signed: bool = False
    seen: bool = True


@dataclass(frozen=True)
class MotionEffect:
    """A form at a place, with its size and shape."""

    form: MotionForm
    shaft: str
    size: float
    knobs: Knobs

    @property
    def component(self) -> str:
        """Where it sits on the bench."""
        return self.form.components[self.shaft]

    @property
    def law(self) -> str:
        """Name of its law."""
        return str(self.knobs["law"])

    @property
    def signed(self) -> float:
        """Its size with its sign."""
        return self.size * self.number("sign")

    def number(self, name: str) -> float:
        """A knob that is a number."""
        return float(self.knobs[name])

    def shape(self, *arguments: Array) -> Array:
        """The law that was drawn, with its constants."""
        law = self.form.laws.every[self.law]
        return law.shape(*arguments, **{name: self.number(name) for name in law.ranges})


def named_laws(**ranges: Mapping[str, tuple[float, float]]) -> Families:
    """Laws that are told apart by name where the effect acts, each with the ranges of its constants."""
    return Families({name: Law(_no_shape, given) for name, given in ranges.items()})


def _no_shape(x: Array) -> Array:
    return x

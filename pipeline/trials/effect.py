"""Effects, and the readings of a bench with effects before any noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

import numpy as np

from pmg.pipeline.trials.design import ratio_of
from pmg.pipeline.trials.laws import Families

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pmg.pipeline.trials.design import CampaignDesign
    from pmg.pipeline.trials.world import World
    from pmg.sim.signals import Array

    Pair: TypeAlias = tuple[Array, Array]  # sun and ring [N m]

Knobs: TypeAlias = "Mapping[str, float | str]"

NO_LAWS = Families()
"""Of an effect whose functions are all that it is."""


@dataclass(frozen=True)
class BenchRun:
    """A design run on a world."""

    design: CampaignDesign
    world: World

    @cached_property
    def drags(self) -> Pair:
        """Drag of both rotors without any effect [N m]."""
        return self.world.drags(self.design)

    @cached_property
    def load(self) -> Array:
        """Torque that the ring motor holds when engaged [N m]."""
        return self.world.load(self.design)

    @cached_property
    def carried(self) -> Pair:
        """Magnitude of the torque that each shaft carries when engaged, without any effect [N m]."""
        return np.abs(self.load) / ratio_of(self.design.at), np.abs(self.load)

    @property
    def speeds(self) -> Pair:
        """Speeds of sun and ring [rad/s]."""
        return self.design.at.speed_sun, self.design.at.speed_ring

    def part(self, engaged: float) -> Array:
        """1 in neutral, the given part when engaged, 0 at rest."""
        at = self.design.at
        return np.where(at.engaged, engaged, np.where(at.neutral, 1.0, 0.0))


@dataclass(frozen=True)
class EffectForm:
    """Law of an effect.

    Parameters
    ----------
    identifier : str
        Id of the vocabulary; ``outside_...`` for what no library knows.
    components : mapping of str to str
        The shafts it may sit on, each with the component of the bench.
    unit : str
        Unit of its size.
    first : float
        A size of the usual order, from which scaling starts.
    knobs : callable
        Draws its shape, in addition to the law.
    most : float
        Largest size that a bench could have.
    drag : callable, optional
        Drag that it adds to both rotors [N m], with the sign of the torque that the motor applies.
    reading : callable, optional
        What it adds to the readings of both transducers [N m], given the torques that are there.
    laws : Families
        Laws that it may follow; none where it is what its functions say.
    """

    identifier: str
    components: Mapping[str, str]
    unit: str
    first: float
    knobs: Callable[[BenchRun, np.random.Generator], dict[str, float | str]]
    most: float = float("inf")
    drag: Callable[[BenchRun, Effect], Pair] | None = None
    reading: Callable[[BenchRun, Effect, Pair], Pair] | None = None
    laws: Families = NO_LAWS


class _AnyForm(Protocol):
    """What every form of an effect tells: id and unit, the places it may sit at, and its laws."""

    @property
    def identifier(self) -> str:
        """Id of the vocabulary; ``outside_...`` for what no library knows."""

    @property
    def unit(self) -> str:
        """Unit of its size."""

    @property
    def components(self) -> Mapping[str, str]:
        """Places by shaft, each with the component of the bench."""

    @property
    def laws(self) -> Families:
        """Laws that it may follow."""


F = TypeVar("F", bound=_AnyForm)


@dataclass(frozen=True)
class PlacedForm(Generic[F]):
    """A form on a shaft, with its size and shape."""

    form: F
    shaft: str
    size: float
    knobs: Knobs

    @property
    def component(self) -> str:
        """Where it sits on the bench."""
        return self.form.components[self.shaft]

    @property
    def law(self) -> str:
        """Name of its law; ``None`` where it has none to choose from."""
        return str(self.knobs.get("law"))

    @property
    def family(self) -> str:
        """Whether its law is a usual or a reserved one."""
        return self.form.laws.family(self.law)

    def number(self, name: str) -> float:
        """A knob that is a number."""
        return float(self.knobs[name])

    @property
    def truth(self) -> dict[str, Any]:
        """What it is, ready for JSON."""
        return {
            "id": self.form.identifier,
            "in_library": not self.form.identifier.startswith("outside_"),
            "shaft": self.shaft,
            "component": self.component,
            "size": self.size,
            "unit": self.form.unit,
            "knobs": dict(self.knobs),
            "laws": self.family,
        }

    def shape(self, *arguments: Array) -> Array:
        """The law that was drawn, with its constants."""
        law = self.form.laws.every[self.law]
        return law.shape(*arguments, **{name: self.number(name) for name in law.ranges})


class Effect(PlacedForm[EffectForm]):
    """An effect on a campaign of steady points."""


def no_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Nothing to draw in addition to the law."""
    return {}


def torques(scene: BenchRun, effects: Iterable[Effect]) -> tuple[Pair, Pair]:
    """Torques that both motors apply, and what the transducers show without noise [N m].

    Notes
    -----
    Engaged, the ring motor holds its load; ring rotor and gear pass on what friction leaves of it, and the sun motor
    balances that and the drag of its own rotor. So the loss is the drag's power, whatever the direction of the flow.
    """
    listed = list(effects)
    sun, ring = scene.drags
    for effect in listed:
        if effect.form.drag is not None:
            more_sun, more_ring = effect.form.drag(scene, effect)
            sun, ring = sun + more_sun, ring + more_ring
    at = scene.design.at
    balance = sun + (scene.load - ring) / ratio_of(at)
    applied = np.where(at.engaged, balance, sun), np.where(at.engaged, scene.load, ring)
    shown = applied
    for effect in listed:
        if effect.form.reading is not None:
            more_sun, more_ring = effect.form.reading(scene, effect, applied)
            shown = shown[0] + more_sun, shown[1] + more_ring
    return applied, shown


def on_shaft(shaft: str, sun: Array, ring: Array) -> Pair:
    """Torque on the shaft named, or on both."""
    return (sun if shaft in ("sun", "both") else 0.0 * sun, ring if shaft in ("ring", "both") else 0.0 * ring)

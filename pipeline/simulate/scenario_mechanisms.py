"""Mechanisms that a scenario switches on, in a table of its file or by ``--with``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.files.strict_tables import RefusalError, refuse
from pmg.sim.errors import BenchError, near_miss
from pmg.sim.mechanisms import BASELINE, CANDIDATES, OTHERS, Mechanism

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Parameter

REFINED = "refined"
"""Key that asks for a mechanism in more detail."""


@dataclass(frozen=True)
class Switched:
    """A mechanism of the catalogue with the numbers of a scenario.

    Parameters
    ----------
    kind : type of Mechanism
        From the catalogue.
    values : tuple of (name, value)
        All its parameters, in their own units.
    """

    kind: type[Mechanism]
    values: tuple[tuple[str, float], ...]

    def mechanism(self, bench: BenchParameters, model: LossModel) -> Mechanism:
        """The mechanism on the numbers of a bench and a baseline."""
        return replace(self.kind.of(bench, model), **dict(self.values))

    @property
    def description(self) -> str:
        """Id and what is not at its null, for people."""
        nulls = {p.name: p for p in self.kind.parameters()}
        numbers = ", ".join(
            f"{name} = {value:.4g} {nulls[name].unit}".removesuffix(" 1")
            for name, value in self.values
            if value != nulls[name].null or name in self.kind.shape
        )
        return f"{self.kind.identifier} ({numbers})"


def _key_of_parameter(parameter: Parameter) -> str:
    """Key of a parameter in a scenario: its name, and its unit where it has one."""
    if parameter.unit == "1":
        return parameter.name
    unit = parameter.unit.replace("N m", "Nm").replace("/", "_per_").replace(" ", "_")
    return f"{parameter.name}_{unit}"


def _sizes_of(kind: type[Mechanism]) -> tuple[str, ...]:
    """Parameters that vanish at the null, of all shafts."""
    return tuple(dict.fromkeys(name for names in kind.by_shaft.values() for name in names))


def switch_on(table: object) -> tuple[Switched, ...]:
    """The mechanisms of a table of tables, by id.

    Raises
    ------
    RefusalError
        An unknown id or key, a value of the wrong kind or out of its bounds.

    Notes
    -----
    A shape that is not given has its typical value. So has every size where none is given; where one is, the others
    are absent.
    """
    if not isinstance(table, dict):
        refuse(repr(table), "tables such as [mechanism.windage]", "Name the mechanism in the table's head.")
    return tuple(_one(str(name), given) for name, given in table.items())


def _one(name: str, given: object) -> Switched:
    known = {kind.identifier: kind for kind in CANDIDATES}
    if name in {kind.identifier for kind in BASELINE}:
        refuse("a mechanism of the baseline", "one of the others", "Set the constants under [losses].", name)
    for other in OTHERS:
        if name == other.identifier:
            refuse("a mechanism without a mean torque", "one that acts on mean torques", other.instead, name)
    if name not in known:
        refuse("unknown mechanism", "one of the catalogue", near_miss(name, known), name)
    if not isinstance(given, dict):
        refuse(repr(given), "a table", f"Write [mechanism.{name}] above its keys.", name)
    kind, refined = known[name], given.get(REFINED, False)
    if not isinstance(refined, bool) or (refined and kind.refined is None):
        came = "a mechanism without more detail" if isinstance(refined, bool) else repr(refined)
        refuse(came, "true or false, where there is more detail", "Take it out.", name, REFINED)
    if refined and kind.refined is not None:
        kind = kind.refined
    keys = {_key_of_parameter(parameter): parameter for parameter in kind.parameters()}
    known_keys = [*keys, *([REFINED] if known[name].refined else [])]
    chosen: dict[str, float] = {}
    for key, value in given.items():
        if key == REFINED:
            continue
        if key not in keys:
            bare = [whole for whole, parameter in keys.items() if parameter.name == key]
            do = f"Did you mean '{bare[0]}'?" if bare else near_miss(str(key), known_keys)
            refuse("unknown key", "a known one, its unit included", do, name, str(key))
        chosen[keys[key].name] = _checked(value, keys[key], name, str(key))
    sizes = _sizes_of(kind)
    absent = any(size in chosen for size in sizes)
    values = tuple(
        (p.name, chosen.get(p.name, p.null if absent and p.name in sizes else p.typical)) for p in kind.parameters()
    )
    return Switched(kind, values)


def _checked(value: object, parameter: Parameter, *key: str) -> float:
    """A finite number inside the bounds of a parameter."""
    (low, high), unit = parameter.bounds, "" if parameter.unit == "1" else f" {parameter.unit}"
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        refuse(repr(value), f"a number from {low:g} to {high:g}{unit}", "Correct the value.", *key)
    if not low <= value <= high:
        refuse(f"{value:g}{unit}", f"{low:g} to {high:g}{unit}", "Choose a value in that range.", *key)
    return float(value)


def switch_on_by_words(texts: Iterable[str]) -> tuple[Switched, ...]:
    """The mechanisms of ``--with`` options, such as ``windage:k_sun_Nm_s2_per_rad2=1e-6,k_ring_...=2e-6``.

    Raises
    ------
    BenchError
        As `switch_on`, or where an option is no ``id:key=value,key=value``.
    """
    found: dict[str, Switched] = {}
    for text in texts:
        where = f"--with {text!r}"
        name, _, rest = text.partition(":")
        table: dict[str, object] = {}
        for pair in filter(None, (part.strip() for part in rest.split(","))):
            key, equals, word = (part.strip() for part in pair.partition("="))
            if not equals or not key:
                raise BenchError(where, repr(pair), "key=value", "Write such as windage:k_sun_Nm_s2_per_rad2=1e-6.")
            try:
                table[key] = {"true": True, "false": False}[word] if word in ("true", "false") else float(word)
            except ValueError:
                raise BenchError(f"{where}: {key}", repr(word), "a number", "Correct the value.") from None
        try:
            (made,) = switch_on({name.strip(): table})
        except RefusalError as refusal:
            key = ".".join(map(str, refusal.key))
            raise BenchError(f"{where}: {key}", refusal.came, refusal.expected, refusal.do) from None
        if made.kind.identifier in found:
            raise BenchError(where, f"{made.kind.identifier} twice", "each once", "Give its keys in one option.")
        found[made.kind.identifier] = made
    return tuple(found.values())

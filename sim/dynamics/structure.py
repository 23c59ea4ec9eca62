"""Equations of a drivetrain: their structure, and the numbers that fill it."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.dynamics.drivetrain import Drivetrain


def walk(thing: Any, leaf: Callable[[float], Any], note: Callable[[str], None]) -> Any:  # noqa: ANN401
    """A copy of constants, mechanisms or maps with every float replaced; what is no float is noted as structure.

    Floats in tuples, such as the powers of a loss curve, belong to the structure, and whole numbers and flags do.
    """
    if type(thing) is float or isinstance(thing, np.floating):
        note("number")
        return leaf(float(thing))
    if isinstance(thing, np.ndarray) and thing.dtype.kind == "f":
        note(f"{thing.size} numbers")
        found = np.empty(thing.size, dtype=object)
        found[:] = [leaf(float(value)) for value in thing.flat]
        return found.reshape(thing.shape)
    if isinstance(thing, tuple) and hasattr(thing, "_fields"):
        note(type(thing).__qualname__)
        return type(thing)(*(walk(part, leaf, note) for part in thing))
    if is_dataclass(thing) and not isinstance(thing, type):
        note(f"{type(thing).__module__}.{type(thing).__qualname__}")
        copy = object.__new__(type(thing))
        for entry in fields(thing):
            object.__setattr__(copy, entry.name, walk(getattr(thing, entry.name), leaf, note))
        return copy
    if isinstance(thing, np.ndarray):
        note(repr(thing.tolist()))
        return thing
    note(repr(thing))
    return thing


def parts(drivetrain: Drivetrain) -> tuple[Any, ...]:
    """Parts of the equations of a drivetrain."""
    return drivetrain.constants, drivetrain.losses, drivetrain.coupling


def survey(drivetrain: Drivetrain) -> tuple[tuple[float, ...], str]:
    """Parameters of a drivetrain, and its structure: drivetrains of equal structure have the same formulas."""
    values: list[float] = []
    notes: list[str] = []
    constants, losses, coupling = parts(drivetrain)
    for thing in (constants, *losses, coupling):
        walk(thing, values.append, notes.append)
    return tuple(values), "\n".join(notes)

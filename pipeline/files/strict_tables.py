"""Tables of a TOML file as pydantic models: known keys, units in the keys, no silent conversion."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import NoReturn

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict

from pmg.sim.errors import near_miss


class RefusalError(ValueError):
    """A value that is refused, in the parts of a `PmgError`; `key` leads from the check to what is wrong."""

    def __init__(self, came: str, expected: str, do: str, key: tuple[str, ...]) -> None:
        self.came, self.expected, self.do, self.key = came, expected, do, key
        super().__init__(came, expected, do)


def refuse(came: str, expected: str, do: str, *key: str) -> NoReturn:
    """Refuse a value; `key` leads from where the check stands to what is wrong."""
    raise RefusalError(came, expected, do, key)


def within(low: float, high: float, unit: str) -> AfterValidator:
    """A check that a number lies in a range, both ends included."""

    def check(value: float) -> float:
        if not low <= value <= high:
            unit_and = f" {unit}".rstrip()
            refuse(f"{value:g}{unit_and}", f"{low:g} to {high:g}{unit_and}", "Choose a value in that range.")
        return value

    return AfterValidator(check)


def key_of(name: str) -> str:
    """Key of a field in the file: its unit is spelled as it should be."""
    return re.sub("_nm$", "_Nm", re.sub("_hz$", "_Hz", name))


def one_of(*members: StrEnum) -> BeforeValidator:
    """A check that a word of the file names one of these members."""
    words = {member.value: member for member in members}

    def check(value: object) -> StrEnum:
        if not isinstance(value, str) or value not in words:
            refuse(repr(value), " or ".join(f'"{word}"' for word in words), near_miss(str(value), words))
        return words[value]

    return BeforeValidator(check)


class Strict(BaseModel):
    """A table of the file: known keys, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=key_of)

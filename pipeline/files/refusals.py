"""What pydantic says against a table, in the four parts of a message."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, get_args

from pydantic import AliasChoices, BaseModel

from pmg.pipeline.files.strict_tables import RefusalError, key_of
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pydantic import ValidationError

KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotation marks",
    "bool_type": "true or false",
    "list_type": "a list in square brackets",
    "dict_type": "a table",
    "model_type": "a table",
    "too_short": "at least one entry",
    "string_too_short": "a name",
}
"""What was expected, by the kind of fault that pydantic names."""


def first_fault(error: ValidationError) -> Mapping[str, Any]:
    """The fault that is told: an unknown key before all others, as it may be the cause of those."""
    return min(error.errors(include_url=False), key=lambda found: found["type"] != "extra_forbidden")


def keys_of(found: Mapping[str, Any]) -> list[str]:
    """The words that lead to a fault."""
    refusal = found.get("ctx", {}).get("error")
    return [*map(str, found["loc"]), *(refusal.key if isinstance(refusal, RefusalError) else ())]


def refusal(where: str, found: Mapping[str, Any], whole: type[BaseModel], key: str, unit: str = "") -> BenchError:
    """A fault as an error.

    Parameters
    ----------
    where : str
        File and place in it.
    found : mapping
        The fault, as pydantic tells it.
    whole : type of BaseModel
        What the whole file is checked by.
    key : str
        Last word of the place, as it stands in the file.
    unit : str
        Of keys that exist for several units, the one that holds here.
    """
    told: Mapping[str, Any] = found.get("ctx", {})
    refused, kind = told.get("error"), found["type"]
    if isinstance(refused, RefusalError):
        return BenchError(where, refused.came, refused.expected, refused.do)
    if kind == "extra_forbidden":
        known = known_keys(whole, found["loc"][:-1], unit)
        return BenchError(where, "unknown key", "a known one", near_miss(key, known))
    if kind == "missing":
        return BenchError(where, "missing", "this key", f"Add {key}.")
    came = repr(found["input"])
    if kind == "greater_than_equal":
        return BenchError(where, came, f"{told['ge']:g} or more", "Correct the value.")
    if kind in ("enum", "literal_error"):
        words = re.findall(r"'([^']*)'", str(told["expected"]))
        return BenchError(where, came, str(told["expected"]), near_miss(str(found["input"]), words))
    return BenchError(where, came, KINDS.get(kind, found["msg"].lower()), "Correct the value.")


def known_keys(whole: type[BaseModel], place: Sequence[str | int], unit: str = "") -> list[str]:
    """Keys that a table of the file may hold; of those that exist for several units, the ones of that unit."""
    model = whole
    for name in place:
        inner = table_of(model, str(name).lower())
        assert inner is not None  # pydantic forbids keys in tables alone
        model = inner
    found = []
    for name, entry in model.model_fields.items():
        alias = entry.validation_alias
        choices = [str(choice) for choice in alias.choices] if isinstance(alias, AliasChoices) else [key_of(name)]
        found += [choice for choice in choices if len(choices) == 1 or choice.endswith(f"_{unit}")]
    return found


def table_of(model: type[BaseModel], name: str) -> type[BaseModel] | None:
    """What the table of that name is checked by; None where it is checked otherwise."""
    annotation = model.model_fields[name].annotation
    kinds = (annotation, *get_args(annotation))
    return next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)

"""Keys of a TOML file and the models they are checked by: how a place is spelled, and which keys a table may hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic import AliasChoices, BaseModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pydantic.fields import FieldInfo

    from pmg.pipeline.files.toml import Key


def key_in_file(data: Mapping[str, Any], key: Key) -> Key:
    """A key without the words below a plain value: a model may take that value for a table."""
    entry: Any = data
    for depth, word in enumerate(key):
        if not isinstance(entry, dict | list):
            return key[:depth]
        entries = dict(enumerate(entry)) if isinstance(entry, list) else entry
        if word not in entries:
            return key
        entry = entries[word]
    return key


def _keys(field: FieldInfo) -> list[str]:
    """Keys under which a field may stand in the file."""
    alias = field.validation_alias
    return [str(choice) for choice in alias.choices] if isinstance(alias, AliasChoices) else [str(alias)]


def spelled_keys(model: type[BaseModel], place: Key, unit: str) -> Iterator[tuple[str | int, type[BaseModel] | None]]:
    """Each word of a place as the file spells it, and what the table there is checked by, where it is one."""
    here: type[BaseModel] | None = model
    free = False  # whether the keys of the table are free, each with a table of its own
    for word in place:
        named = here is not None and isinstance(word, str) and not free
        fields = here.model_fields.values() if here is not None and named else ()
        field = next((field for field in fields if word in _keys(field)), None)
        if field is None:  # an entry of a list, or of a table whose keys are free
            free = False
            yield word, here
            continue
        here, free = table_of(field.annotation), get_origin(field.annotation) is dict
        yield next((key for key in _keys(field) if key.endswith(f"_{unit}")), word), here


def known_keys(model: type[BaseModel], place: Key, unit: str = "") -> list[str]:
    """Keys that a table of the file may hold; of those that exist for several units, the ones of that unit."""
    *_, (_, table) = [("", model), *spelled_keys(model, place, unit)]
    fields = [] if table is None else [_keys(field) for field in table.model_fields.values()]
    return [key for keys in fields for key in keys if len(keys) == 1 or key.endswith(f"_{unit}")]


def table_of(kind: Any) -> type[BaseModel] | None:  # noqa: ANN401 - any annotation
    """The model within an annotation, such as that of ``list[Row] | None``; None where there is none."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return kind
    return next((found for part in get_args(kind) if (found := table_of(part)) is not None), None)


def left_out(data: Any, key: Key) -> bool:  # noqa: ANN401 - a table or list of the file
    """Whether a key could be taken out of what a file says, so that the rest can be checked."""
    for word in key[:-1]:
        data = data.get(word) if isinstance(data, dict) else None
    if not key or not isinstance(data, dict) or key[-1] not in data:
        return False
    del data[key[-1]]
    return True

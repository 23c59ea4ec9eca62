"""A campaign file to begin with: every table and key, commented out, with its meaning and a value it may have."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.table_keys import table_of
from pmg.pipeline.grid.crosschecks.catalogue import CROSS_CHECKS
from pmg.pipeline.settings.campaign_file import CHECKS, Campaign
from pmg.pipeline.settings.settings import limit_written
from pmg.pipeline.windows.limits import MEANINGS, Steadiness
from pmg.pipeline.wording.plurals import uncapitalised

if TYPE_CHECKING:
    from collections.abc import Iterator

HEAD = """\
# A campaign file of pmg. Take the sign # away from what you set; all else keeps its default.
# pmg run --config THIS_FILE; an option given wins. 'pmg config show --config THIS_FILE --origin' tells what holds.
# Units are written with the value: "1500 rpm", "10 mN m", "0.5 Hz", "1 %". Paths are relative to this file.
"""

COLUMN = 44
"""Column at which a meaning begins, where the value leaves it free."""


def template() -> str:
    """The text of the file."""
    return HEAD + "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    for table, entry in Campaign.model_fields.items():
        model = table_of(entry.annotation)
        about = entry.description or ("" if model is None else (model.__doc__ or "").splitlines()[0])
        yield f"\n[{table}]{' ' * max(1, COLUMN - len(table) - 2)}# {uncapitalised(about).rstrip('.')}"
        if table == CHECKS:
            for check in CROSS_CHECKS:
                line = f'# {check.name} = "{check.action}"'
                yield f"{line:<{COLUMN}}# against {check.held_against}"
            continue
        if model is None:
            for limit in fields(Steadiness):
                line = f"# {limit.name} = {limit_written(limit.name)}"
                yield f"{line:<{COLUMN}}# {MEANINGS[limit.name]}"
            continue
        for name, part in model.model_fields.items():
            extra: dict[str, Any] = part.json_schema_extra if isinstance(part.json_schema_extra, dict) else {}
            line = f"# {name} = {extra['example']}"
            option = f" ({extra['option']})" if extra["option"] else ""
            yield (
                f"{line:<{COLUMN}}# {part.description}{option}"
                if len(line) < COLUMN
                else f"{line}  # {part.description}"
            )

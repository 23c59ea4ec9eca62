"""The settings in force, each with its unit and where it comes from."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.grid.crosschecks.catalogue import CROSS_CHECKS
from pmg.pipeline.settings.campaign_file import CHECKS, Campaign
from pmg.pipeline.settings.chosen import KEYS
from pmg.pipeline.settings.tolerance import SIGNALS
from pmg.pipeline.windows.limits import DIMENSIONS, Steadiness, limit_text
from pmg.pipeline.windows.limits_file import TABLE, chosen_limits, limits_file
from pmg.pipeline.wording.option_words import AUTO
from pmg.pipeline.wording.quantities import RATIO

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.files.table_file import TableFile
    from pmg.pipeline.settings.chosen import Chosen

DEFAULT = "default"
THESIS = "default for published grids"
NOT_SET = "not set"


@dataclass(frozen=True)
class Setting:
    """One setting.

    Parameters
    ----------
    key : str
        Full key, such as ``analysis.k_corr``.
    value : text, number, truth or None
        In SI; None where nothing is set.
    unit : str
        SI unit; empty for what has none.
    written : str
        As it may be written in a campaign file.
    origin : str
        ``default``, file and line, or the option.
    """

    key: str
    value: Any
    unit: str
    written: str
    origin: str


def settings(chosen: Chosen) -> tuple[Setting, ...]:
    """Everything that can be set, as it is in force, in the order of the campaign file."""
    usual = _usual(chosen)
    names = {key: name for name, key in KEYS.items()}
    found: list[Setting] = []
    for table in Campaign.model_fields:
        if table == TABLE:
            found += _windows(chosen)
            continue
        if table == CHECKS:
            found += _checks(chosen)
            continue
        for key, name in ((k, n) for k, n in names.items() if k.startswith(f"{table}.")):
            value = chosen.values.get(name, usual.get(name, (None, DEFAULT))[0])
            origin = chosen.origins.get(name) or usual.get(name, (None, DEFAULT))[1]
            plain = str(value) if isinstance(value, Path) else value
            found.append(Setting(key, plain, "", _written(plain), origin))
    return (*found, *_tolerances(chosen))


def _usual(chosen: Chosen) -> dict[str, tuple[Any, str]]:
    """Default where nothing is set, and its reason."""
    options = chosen.options()
    origin = DEFAULT if chosen.path("grids") is None else THESIS

    def terms(powers: tuple[float, ...], auto: bool) -> str:
        return AUTO if auto else ",".join(map(_power, powers))

    return {
        "terms_sun": (terms(options.powers_sun, options.auto_sun), origin),
        "terms_ring": (terms(options.powers_ring, options.auto_ring), origin),
        "k_corr": (options.correction, origin),
        "include_rest": (options.include_rest, origin),
        "robust": (options.robust, DEFAULT),
        "damping": (str(options.damping), origin),
        "note": ("", DEFAULT),
    }


def _power(power: float) -> str:
    """An exponent as its option takes it: a fraction where it is one, such as 1/2."""
    near = Fraction(power).limit_denominator(6)
    return str(near) if float(near) == power else f"{power:g}"


def _windows(chosen: Chosen) -> Iterator[Setting]:
    given = chosen.limits
    values = asdict(chosen_limits(given))
    file: TableFile[Any] | None = chosen.file.file if chosen.file is not None else None
    file = limits_file(given) if isinstance(given, Path) else file
    lines: dict[str | int, str] = {}
    if file is not None:
        places = file.lines.items()
        lines = {words[1]: f"{file.path}:{n}" for words, n in places if len(words) > 1 and words[0] == TABLE}
    for limit in fields(Steadiness):
        name = limit.name
        origin = lines.get(name) or lines.get(f"{name}_rpm") or DEFAULT
        unit = DIMENSIONS[name].unit if name in DIMENSIONS else ""
        yield Setting(f"{TABLE}.{name}", values[name], "" if unit == "1" else unit, limit_written(name, values), origin)


def _checks(chosen: Chosen) -> Iterator[Setting]:
    given = chosen.options().checks
    for check in CROSS_CHECKS:
        key = f"{CHECKS}.{check.name}"
        action = given.get(check.name, check.action)
        origin = chosen.file.origin(key) if chosen.file is not None and chosen.file.has(key) else DEFAULT
        yield Setting(key, str(action), "", _written(action), origin)


def limit_written(name: str, values: dict[str, Any] | None = None) -> str:
    """A limit as it may be written in a campaign file; the default one where no values are given."""
    text = limit_text(name, values)
    return f'"{text}"' if name in DIMENSIONS else text


def _tolerances(chosen: Chosen) -> Iterator[Setting]:
    if chosen.file is None:
        return
    for name, (absolute, relative) in chosen.tolerance.items():
        word, dimension = next((w, SIGNALS[w][1]) for w in SIGNALS if SIGNALS[w][0] == name)
        plain = f"{100.0 * absolute:.10g} %" if dimension is RATIO else f"{absolute:.10g} {dimension.unit}"
        parts = [plain] if absolute else []
        parts += [f"{100.0 * relative:.10g} %"] if relative else []
        words = [w for w in SIGNALS if SIGNALS[w][0] == name and chosen.file.has(f"compare.tolerance.{w}")]
        key = f"compare.tolerance.{words[0] if words else word}"
        value = {"absolute": absolute, "relative": relative}
        yield Setting(key, value, dimension.unit, f'"{" or ".join(parts)}"', chosen.file.origin(key))


def _written(value: object) -> str:
    """A value as TOML; what is not set as such."""
    if value is None:
        return NOT_SET
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    return json.dumps(str(value), ensure_ascii=False)

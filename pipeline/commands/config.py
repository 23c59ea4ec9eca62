"""The stages behind ``pmg config``: what holds and where it is from, whether a file is sound, a file to begin with."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.settings.chosen import KEYS, choose
from pmg.pipeline.settings.settings import settings
from pmg.pipeline.settings.template import template
from pmg.pipeline.wording.plurals import counted

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.settings.chosen import Chosen

MUST_EXIST = ("recordings", "grids", "limits", "map", "model")
"""Choices that name something which is read."""


def run_show(chosen: Chosen, origin: bool) -> Outcome:
    """Every setting in force.

    Parameters
    ----------
    chosen : Chosen
        File and options.
    origin : bool
        Whether people are shown where each comes from; JSON always is.
    """
    found = settings(chosen)
    width = max(len(setting.key) + len(setting.written) for setting in found) + 4
    lines: list[str] = []
    for setting in found:
        line = f"{setting.key} = {setting.written}"
        lines.append(f"{line:<{min(width, 70)}}  {setting.origin}" if origin else line)
    return Outcome({"settings": [asdict(setting) for setting in found]}, tuple(lines))


def run_check(path: Path) -> Outcome:
    """Whether a campaign file is sound, and whether what it names is there.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    PmgError
        It is not.
    """
    chosen = choose(path)
    _ = chosen.options()
    absent = [name for name in MUST_EXIST if (place := chosen.path(name)) is not None and not place.exists()]
    findings = [Remark("warning", f"{chosen.origins[n]}: {KEYS[n]}", f"{chosen.path(n)} is not there") for n in absent]
    if "limits" not in absent:
        _ = settings(chosen)
    assert chosen.file is not None  # it was read
    tolerances = {name: list(parts) for name, parts in chosen.tolerance.items()}
    count = len(chosen.file.values) + chosen.file.count("windows") + len(chosen.tolerance)
    return Outcome(
        {"file": str(path), "settings": count, "tolerance": tolerances, "absent": absent},
        (f"{path}: {counted(count, 'setting')}, sound",),
        tuple(findings),
    )


def run_template() -> Outcome:
    """A campaign file to begin with."""
    text = template()
    return Outcome({"text": text}, (text.rstrip("\n"),))

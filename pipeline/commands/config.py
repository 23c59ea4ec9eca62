"""The stages behind ``pmg config``: what holds and where it is from, whether a file is sound, a file to begin with."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.importers.supply import read_supply
from pmg.pipeline.model.read_motion_model import read_any_model
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.pipeline.settings.chosen import KEYS, choose
from pmg.pipeline.settings.settings import settings
from pmg.pipeline.settings.template import template
from pmg.pipeline.store.sources import find_recordings
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.limits_file import chosen_limits
from pmg.pipeline.wording.plurals import counted
from pmg.sim.bench import load_bench
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
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
    """Whether a campaign file is sound, and whether what it names is there; all its faults at once.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    PmgError
        The file cannot be read, or is no TOML.
    """
    faults: list[PmgError] = []
    chosen = choose(path, faults)
    absent = [name for name in MUST_EXIST if (place := chosen.path(name)) is not None and not place.exists()]
    findings = [Remark("warning", f"{chosen.origins[n]}: {KEYS[n]}", f"{chosen.path(n)} is not there") for n in absent]
    there = replace(chosen, values={name: value for name, value in chosen.values.items() if name not in absent})
    faults += _choice_faults(there)
    if faults:
        findings += [Remark("error", fault.where, fault.advice) for fault in faults[1:]]
        return Outcome({}, (), tuple(findings), refusal=faults[0])
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


def _choice_faults(chosen: Chosen) -> Iterator[PmgError]:
    """Faults of the choices of a call, each found without decoding a recording.

    Parameters
    ----------
    chosen : Chosen
        File and options.
    """
    for check in _checks(chosen):
        try:
            check()
        except PmgError as fault:
            yield fault


def check_choices(chosen: Chosen) -> None:
    """Check the choices of a call.

    Raises
    ------
    PmgError
        The first that cannot be used.
    """
    for fault in _choice_faults(chosen):
        raise fault


def _checks(chosen: Chosen) -> Iterator[Callable[[], object]]:
    """The checks that these choices call for."""
    yield lambda: chosen.options().fixed_correction
    yield lambda: chosen_limits(chosen.limits)
    if (recordings := chosen.path("recordings")) is not None:
        yield lambda: find_recordings(recordings)
    if (chart := chosen.path("map")) is not None:
        yield lambda: read_supply(chart)
    if (model := chosen.path("model")) is not None:
        yield lambda: read_any_model(model, bench_in_force(chosen.path("store"), chosen.text("machine")))
    if (store := chosen.path("store")) is not None:
        yield lambda: Store(store)
    yield lambda: bench_in_force(store, chosen.text("machine"))
    if (grids := chosen.path("grids")) is not None:
        yield lambda: read_published(grids, load_bench())

"""The outcome of a fault: named, harmless, or one of the four that must not be."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from pmg.sim.shafts import SIDES
from tests.grid.checked_campaign import NEUTRAL

from .case import BOTH, Case, Desk, Ended, copied, finite, follow, write_changed

COVERAGE = 2.0
"""Standard uncertainties within which a mean is the same as that of the sound recording."""
SAME = ("configuration", "gear", "drive", "accepted")
NEAR = {"speed_sun_rpm": 1.0, "speed_ring_rpm": 1.0, "load_set_Nm": 1e-6, "started_at_s": 1.0}
"""Columns of a grid besides the torques: those that are the same, and those that are near by so much."""


class Outcome(StrEnum):
    """What becomes of a fault; the last four must not be."""

    NAMED = "named"
    HARMLESS = "harmless"
    SILENT = "silent-wrong"
    CRASH = "crash"
    HANG = "hang"
    DAMAGE = "damage"


BAD = (Outcome.SILENT, Outcome.CRASH, Outcome.HANG, Outcome.DAMAGE)


@dataclass(frozen=True)
class Result:
    """Outcome of a case, and what it cost.

    Parameters
    ----------
    case : Case
        The fault.
    outcome : Outcome
        What became of it.
    why : str
        In a few words.
    seconds, cpu : float
        Time and processor time of the slowest command [s].
    peak, size : int
        Largest peak memory, and length of the spoilt recording [bytes].
    """

    case: Case
    outcome: Outcome
    why: str
    seconds: float
    cpu: float
    peak: int
    size: int


@dataclass(frozen=True)
class Sound:
    """A campaign without a fault: its recordings, what is said of it, and its grid."""

    recordings: Path
    said: frozenset[str]
    grid: Mapping[str, Mapping[str, str]]


def said(ended: Sequence[Ended]) -> list[str]:
    """Findings at warning or error level, and errors, one line each."""
    found = []
    for each in ended:
        try:
            answer = json.loads(each.out)
        except ValueError:
            found += [line for line in each.err.splitlines() if re.match(r"(pmg|error|warning)\b.*: ", line)]
            continue
        remarks = [one for one in answer["findings"] if one["severity"] != "info"]
        found += [f"{one['severity']}: {one['where']}: {one['message']}" for one in remarks]
        if answer["error"]:
            found.append(f"error: {answer['error']['where']}: {answer['error']['came']}")
    return found


def read_grid(store: Path) -> dict[str, dict[str, str]]:
    """Rows of the grid that an analysis wrote, by their starts; none where there is no grid."""
    path = store / "analysis" / "grid.csv"
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as text:
        found: dict[str, dict[str, str]] = {}
        for row in csv.DictReader(text):
            start = f"{finite(row['started_at_s']):.0f}"
            found[start + "'" * sum(key.rstrip("'") == start for key in found)] = row
        return found


def differences(grid: Mapping[str, Mapping[str, str]], sound: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Points that are not as in the sound campaign: gone, new, with another place, or with another mean."""
    found = [f"{sound[start]['point']} is gone" for start in sound.keys() - grid.keys()]
    found += [f"{grid[start]['point']} is new" for start in grid.keys() - sound.keys()]
    for start in sorted(grid.keys() & sound.keys()):
        row, right, point = grid[start], sound[start], sound[start]["point"]
        other = [name for name in SAME if row[name] != right[name]]
        other += [name for name, far in NEAR.items() if not _near(row[name], right[name], far)]
        found += [f"{point}: {name} {row[name]} for {right[name]}" for name in other]
        if row["accepted"] != "True":
            continue
        for side in SIDES:
            off = finite(row[f"torque_{side}_Nm"]) - finite(right[f"torque_{side}_Nm"])
            u = math.hypot(finite(row[f"u_{side}_Nm"]), finite(row[f"common_{side}_Nm"]))
            if not abs(off) <= COVERAGE * u:
                found.append(f"{point}: {side} {1e3 * off:+.3g} mN m, u {1e3 * u:.2g}")
    return found


def _near(a: str, b: str, far: float) -> bool:
    x, y = finite(a), finite(b)
    return (math.isnan(x) and math.isnan(y)) or abs(x - y) <= far


def sound_campaign_of(recordings: Path, pmg: str, place: Path) -> Sound:
    """What is said of a campaign without a fault, and its grid."""
    desk = copied(recordings, place)
    ended = [follow(call, pmg, desk) for call in BOTH]
    return Sound(recordings, frozenset(said(ended)), read_grid(desk.store))


def tried(case: Case, sound: Sound, runs: Mapping[str, object], pmg: str, place: Path) -> Result:
    """Plant a fault, give the commands, and judge what became of it."""
    desk = copied(sound.recordings, place)
    try:
        if case.first:
            for call in BOTH:
                follow(call, pmg, desk)
        if case.plant is not None:
            changed = dict(runs)
            case.plant(changed)  # type: ignore[arg-type]
            write_changed(desk.recordings, changed, runs)  # type: ignore[arg-type]
        if case.spoil is not None:
            case.spoil(desk)
        before = _hashes(desk.store) if case.first == "kept" else {}
        ended = [follow(call, pmg, desk) for call in case.calls]
        outcome, why = _judged(case, desk, ended, sound, before, pmg)
        recording = desk.recordings / NEUTRAL
        size = recording.stat().st_size if recording.is_file() else 0
        seconds, cpu, peak = (max(getattr(each, name) for each in ended) for name in ("seconds", "cpu", "peak"))
        return Result(case, outcome, why, seconds, cpu, peak, size)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _judged(
    case: Case, desk: Desk, ended: Sequence[Ended], sound: Sound, before: Mapping[str, str], pmg: str
) -> tuple[Outcome, str]:
    for each in ended:
        words = " ".join(each.words)
        if each.code is None:
            return Outcome.HANG, f"{words}: no end within {each.seconds:.0f} s"
        if each.code not in (0, 2, 3) or "Traceback" in each.err:
            last = each.err.strip().splitlines()[-3:]
            return Outcome.CRASH, f"{words}: exit {each.code}: {' / '.join(last)[:200]}"
    if case.acts is not None and (acted := case.acts(desk, ended)):
        return Outcome.SILENT, acted
    if case.first == "kept" and (harm := _harm(desk, before, sound, pmg)):
        return Outcome.DAMAGE, harm
    new = [line for line in said(ended) if line not in sound.said]
    naming = [line for line in new if re.search(case.says, line)]
    if naming:
        return Outcome.NAMED, naming[0]
    if any(each.code == 2 and not call.err for each, call in zip(ended, case.calls, strict=True)):
        return Outcome.CRASH, f"exit 2 without a sentence: {new or ended[-1].err[-200:]}"
    compared = case.acts is None and any({"analyse", "store"} <= set(call.words) for call in case.calls)
    off = differences(read_grid(desk.store), sound.grid) if compared else []
    if off:
        return Outcome.SILENT, "; ".join(off)[:200] + (f" (said: {new[0]})" if new else "")
    return Outcome.HARMLESS, "the same within its u"


def _harm(desk: Desk, before: Mapping[str, str], sound: Sound, pmg: str) -> str:
    """What of the store that was written before has changed into something that no sound command would write."""
    after = _hashes(desk.store)
    again = [follow(call, pmg, desk) for call in BOTH]
    mended = _hashes(desk.store)
    spoilt = [name for name, digest in before.items() if after.get(name) not in (digest, mended.get(name))]
    if spoilt:
        return f"changed: {', '.join(sorted(spoilt)[:3])}"
    if any(each.code not in (0, 3) for each in again):
        return f"does not go on afterwards: {again[-1].err[-200:]}"
    off = differences(read_grid(desk.store), sound.grid)
    return f"afterwards {off[0]}" if off else ""


def _hashes(store: Path) -> dict[str, str]:
    """Hashes of what a store holds, but for the records of when it was written and by whom."""
    return {
        str(path.relative_to(store)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(store.rglob("*"))
        if path.is_file() and not path.name.startswith((".pmg-", "ro-crate", "audit"))
    }

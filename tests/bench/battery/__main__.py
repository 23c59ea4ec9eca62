"""`./pmgw bench battery`: faults of five kinds through the command line, and what becomes of each.

Each fault is planted in a sound campaign, the commands are given as a user would, and the outcome is told from their
exit codes, findings and grids: named, harmless (the same within its uncertainty), or wrong without a word, a crash, a
hang, or damage to what was written before. With `--pmg` the commands are those of another installation. With
`--campaigns` or `--sound` nothing is planted: what is said of campaigns without a fault is counted.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.grid.checked_campaign import NEUTRAL, Runs, sound_campaign
from tests.recording.writer import write

from . import bombs, campaigns, containers, extremes, places, signals, stored, texts
from .case import Case
from .outcome import BAD, Outcome, Result, Sound, sound_campaign_of, tried
from .sound import false_alarms

KINDS = (signals, campaigns, containers, places, texts, stored, extremes, bombs)
CASES = tuple(case for kind in KINDS for case in kind.CASES)
SMALL = ("02.mcap", NEUTRAL)
"""Recordings of the small campaign."""


def main() -> int:
    """Run the cases, write both tables; the exit code says whether any outcome is one that must not be."""
    parser = argparse.ArgumentParser(prog="pmgw bench battery", description=__doc__)
    parser.add_argument("--pmg", default=str(Path(sys.executable).parent / "pmg"), help="command that is tried")
    parser.add_argument("--out", type=Path, help="folder of battery.md and battery.json")
    parser.add_argument("--only", default="", help="regular expression on kind and name of a fault")
    parser.add_argument("--at-once", type=int, default=2, help="faults tried at the same time")
    parser.add_argument("--campaigns", type=int, default=0, help="sound campaigns of the trial, through recordings")
    parser.add_argument("--strata", default="clean", help="kinds of campaigns, as of pmg prove")
    parser.add_argument("--seed", type=int, default=20261122, help="of the campaigns")
    parser.add_argument("--sound", type=Path, nargs="*", default=[], help="folders of more sound recordings")
    given = parser.parse_args()
    if given.campaigns or given.sound:
        false_alarms(given.sound, given.campaigns, given.strata, given.seed)
        return 0
    cases = [case for case in CASES if re.search(given.only, f"{case.kind}: {case.what}")]
    place = Path(tempfile.mkdtemp(prefix="battery-"))
    place.chmod(0o755)
    try:
        results = run(cases, str(Path(given.pmg).absolute()), place, given.at_once)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    text = as_markdown(results)
    sys.stdout.write(text)
    if given.out is not None:
        given.out.mkdir(parents=True, exist_ok=True)
        (given.out / "battery.md").write_text(text, encoding="utf-8")
        (given.out / "battery.json").write_text(json.dumps([row(r) for r in results], indent=1), encoding="utf-8")
    return 1 if any(result.outcome in BAD for result in results) else 0


def run(cases: Sequence[Case], pmg: str, place: Path, at_once: int) -> list[Result]:
    """Outcomes of the cases, in their order."""
    runs = sound_campaign()
    sounds: dict[tuple[bool, bytes | None], Sound] = {}
    for whole in dict.fromkeys((case.small, case.whole) for case in cases):
        folder = _written(runs, place / f"sound{len(sounds)}", *whole)
        sounds[whole] = sound_campaign_of(folder, pmg, place / f"of-sound{len(sounds)}")

    def one(entry: tuple[int, Case]) -> Result:
        number, case = entry
        sound = sounds[case.small, case.whole]
        mine = {name: bench for name, bench in runs.items() if not case.small or name in SMALL}
        result = tried(case, sound, mine, pmg, place / f"{number:03d}")
        sys.stderr.write(f"{number + 1}/{len(cases)} {case.kind}: {case.what}: {result.outcome} ({result.why})\n")
        return result

    with ThreadPoolExecutor(at_once) as pool:
        return list(pool.map(one, enumerate(cases)))


def _written(runs: Runs, folder: Path, small: bool, whole: bytes | None) -> Path:
    folder.mkdir()
    for name, bench in runs.items():
        if not small or name in SMALL:
            write(folder / name, bench)
    if whole is not None:
        (folder / NEUTRAL).write_bytes(whole)
    return folder


def row(result: Result) -> dict[str, object]:
    """A result for JSON."""
    said: dict[str, object] = {
        "kind": result.case.kind,
        "fault": result.case.what,
        "outcome": result.outcome,
        "why": result.why,
    }
    said |= {"seconds": round(result.seconds, 2), "cpu_seconds": round(result.cpu, 2)}
    return said | {"peak_bytes": result.peak, "file_bytes": result.size}


def as_markdown(results: Sequence[Result]) -> str:
    """Counts by kind and outcome, and the outcome of each fault."""
    kinds = list(dict.fromkeys(result.case.kind for result in results))
    lines = [f"| kind | faults | {' | '.join(Outcome)} |", "|---" * (len(Outcome) + 2) + "|"]
    for kind in (*kinds, "all"):
        mine = Counter(r.outcome for r in results if kind in (r.case.kind, "all"))
        lines.append(f"| {kind} | {mine.total()} | " + " | ".join(str(mine[outcome]) for outcome in Outcome) + " |")
    lines += ["", "| kind | fault | outcome | why |", "|---|---|---|---|"]
    for result in results:
        why = "".join(sign if sign.isprintable() and sign != "|" else " " for sign in result.why)
        lines.append(f"| {result.case.kind} | {result.case.what} | {result.outcome} | {why[:160]} |")
    bombs = [result for result in results if result.case.kind == "bomb"]
    if bombs:
        lines += ["", "| bomb | file [kB] | peak [MB] | times the file | processor time [s] |", "|---|---|---|---|---|"]
    for bomb in bombs:
        cost = f"{bomb.size / 1e3:.0f} | {bomb.peak / 1e6:.0f} | {bomb.peak / max(bomb.size, 1):.0f} | {bomb.cpu:.1f}"
        lines.append(f"| {bomb.case.what} | {cost} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    raise SystemExit(main())

"""`./pmgw bench rivals`: PySINDy, a Gaussian process and the best BIC of the catalogue on the campaigns of `pmg prove`.

Every contestant gets the measured grid about pmg's own baseline: readings, noise, speeds, loads, run times; with
`--track motion` the balances of the rotors about the fitted constants of the bench, and a ladder of best BIC, PySINDy's
sparse regression of them, and a latent force by itself answer. Which campaigns, and how they are scored, is what
`pmg prove` does; the thresholds of the calibrated settings come from further clean campaigns of another seed. A run
that is interrupted is resumed by the same call.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.trials.laws import CHOICES, USUAL
from pmg.pipeline.trials.score.case_list import CAMPAIGNS, SEED, TRACKS, MotionLot, draw_lots, draw_motion_lots
from pmg.pipeline.trials.score.stage import _code_digest
from pmg.sim.errors import BenchError, PmgError
from tests.bench.bout import Answer, Reply
from tests.bench.contestants import contestants
from tests.bench.motion_bout import enter_in_motion
from tests.bench.motion_contestants import contestants_in_motion
from tests.bench.peers import installed
from tests.bench.rivalscore import proof_row, rows_of, table
from tests.bench.steady_bout import enter

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.score.case_list import AnyLot
    from tests.bench.bout import AnyBout, Contestant

SCHEMA = "pmg.rivals/1"
CALIBRATION = 40
"""Clean campaigns that calibrate, unless set otherwise."""
PACKAGES = ("pysindy", "sklearn")
SOURCES = (
    "bout.py",
    "contestants.py",
    "motion_bout.py",
    "motion_contestants.py",
    "sparse.py",
    "steady_bout.py",
)
"""Beside pmg itself, what an answer depends on."""


@dataclass(frozen=True)
class Entry:
    """A campaign on the list: to be judged, or to calibrate."""

    lot: AnyLot[Any]
    part: str

    @property
    def file(self) -> str:
        """Name of the file that keeps its answers."""
        return f"{self.part}-{self.lot.number:04d}.json"


Rivals = Sequence["Contestant[Any]"]
"""Who answers."""


@dataclass(frozen=True)
class Track:
    """A kind of trial.

    Parameters
    ----------
    draw : callable
        The campaigns of such a trial.
    enter : callable
        A campaign as its contestants see it; None where no baseline can be fitted.
    """

    draw: Callable[..., tuple[AnyLot[Any], ...]]
    enter: Callable[[Any], AnyBout | None]


OF_TRACK = {"steady": Track(draw_lots, enter), "motion": Track(draw_motion_lots, enter_in_motion)}
"""What each of `TRACKS` is drawn and entered by."""


def track_of(lot: AnyLot[Any]) -> Track:
    """The kind of trial that a campaign is of."""
    return OF_TRACK["motion" if isinstance(lot, MotionLot) else "steady"]


def chosen(
    campaigns: int, seed: int, clean: int | None, concealed: int | None, laws: str = USUAL, track: str = TRACKS[0]
) -> tuple[AnyLot[Any], ...]:
    """The campaigns of that trial, or the first so many of either sort."""
    left = {True: campaigns if clean is None else clean, False: campaigns if concealed is None else concealed}
    found = []
    for lot in OF_TRACK[track].draw(campaigns, seed, laws=laws):
        sort = lot.stratum.kind == "clean"
        if left[sort] > 0:
            left[sort] -= 1
            found.append(lot)
    return tuple(found)


def state() -> str:
    """SHA-256 over all that the answers depend on; answers of another state are made anew."""
    digest = hashlib.sha256(_code_digest().encode())
    for name in SOURCES:
        digest.update((Path(__file__).parent / name).read_bytes())
    return digest.hexdigest()


def encode(answer: Answer | None) -> dict[str, Any] | None:
    """An answer as JSON."""
    return None if answer is None else asdict(answer)


def decode(document: dict[str, Any] | None) -> Answer | None:
    """An answer from JSON."""
    if document is None:
        return None
    settings = {name: _reply(reply) for name, reply in document["settings"].items()}
    graded = tuple((float(level), _reply(reply)) for level, reply in document["graded"])
    return Answer(document["level"], settings, graded, document["seconds"], document["remarks"])


def _reply(document: dict[str, Any]) -> Reply:
    said = document["said"]
    return Reply(document["alarm"], None if said is None else (said[0], said[1]), document["held_out"])


def answers_of(entry: Entry, asked: Rivals, out: Path, stamp: dict[str, Any]) -> dict[str, Any]:
    """Answers to one campaign by the contestants' names, from the file that keeps them or made now."""
    path, wanted = out / "cases" / entry.file, {"schema": SCHEMA, **stamp}
    if path.exists():
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            there = None
        known = isinstance(there, dict) and all(there.get(name) == value for name, value in wanted.items())
        if known and all(contestant.name in there["answers"] for contestant in asked):
            return {name: decode(answer) for name, answer in there["answers"].items()}
    bout = track_of(entry.lot).enter(entry.lot)
    withheld = entry.part == "trial" and entry.lot.stratum.kind != "clean"
    made = {c.name: None if bout is None else c(bout, withheld=withheld) for c in asked}
    document = {**wanted, "answers": {name: encode(answer) for name, answer in made.items()}}
    write_atomic(path, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    return made


def run(
    lots: tuple[AnyLot[Any], ...],
    calibration: tuple[AnyLot[Any], ...],
    asked: Rivals,
    out: Path,
    ours: dict[str, Any] | None = None,
) -> str:
    """All answers, `rivals.json` and `rivals.md` in the folder, and the table.

    Parameters
    ----------
    lots : tuple of AnyLot
        Campaigns that are judged.
    calibration : tuple of AnyLot
        Clean campaigns that only calibrate.
    asked : sequence of Contestant
        Who answers.
    out : Path
        Folder; answers that it holds are not made again.
    ours : dict, optional
        A `pmg.proof/1` document of the same trial, for pmg's own line.
    """
    stamp = {"seed": lots[0].seed, "state": state()}
    entries = [Entry(lot, "calibration") for lot in calibration] + [Entry(lot, "trial") for lot in lots]
    found: dict[str, list[dict[str, Any]]] = {"calibration": [], "trial": []}
    began = time.perf_counter()
    for done, entry in enumerate(entries, 1):
        found[entry.part].append(answers_of(entry, asked, out, stamp))
        spent = time.perf_counter() - began
        sys.stderr.write(f"{done} of {len(entries)} campaigns, {spent:.0f} s: {entry.file}\n")
    truths = [lot.draw().truth for lot in lots]
    rows = [] if ours is None else [proof_row(ours, [lot.number for lot in lots])]
    for contestant in asked:
        own = {part: [answers[contestant.name] for answers in kept] for part, kept in found.items()}
        rows += rows_of(contestant.name, truths, own["trial"], own["calibration"])
    clean = sum(lot.stratum.kind == "clean" for lot in lots)
    judged = f"{clean} clean and {len(lots) - clean} concealed campaigns"
    text = f"{judged}, calibrated on {len(calibration)} further clean ones; intervals at 95 %.\n\n{table(rows)}"
    document = {
        "schema": SCHEMA,
        **stamp,
        "cases": [lot.number for lot in lots],
        "calibration": len(calibration),
        "rows": [row.document for row in rows],
    }
    write_atomic(out / "rivals.json", (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    write_atomic(out / "rivals.md", text.encode())
    return text


def read_proof(path: Path, lots: tuple[AnyLot[Any], ...]) -> dict[str, Any]:
    """The scores of pmg on the same campaigns.

    Raises
    ------
    BenchError
        They are not readable, or of another trial.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        document = None
    where, hint = str(path), "Name the scores.json that pmg prove wrote for this seed and at least these campaigns."
    if not isinstance(document, dict) or document.get("schema") != "pmg.proof/1":
        raise BenchError(where, "no readable scores", "a document pmg.proof/1", hint)
    strata = {int(case["case"]): case["stratum"] for case in document["cases"]}
    other = [lot.number for lot in lots if strata.get(lot.number) != lot.stratum.name]
    if document.get("seed") != lots[0].seed or document.get("laws") != lots[0].laws or other:
        came = f"seed {document.get('seed')}, laws {document.get('laws')}, {len(other)} campaigns lacking or others"
        raise BenchError(where, came, f"seed {lots[0].seed}, laws {lots[0].laws} and the same campaigns", hint)
    return document


def main() -> None:
    """Run what the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(prog="./pmgw bench rivals")
    parser.add_argument("--campaigns", type=int, default=CAMPAIGNS, help="of the trial, as for pmg prove")
    parser.add_argument("--seed", type=int, default=SEED, help="of the trial, as for pmg prove")
    parser.add_argument("--laws", choices=CHOICES, default=USUAL, help="of the trial, as for pmg prove")
    parser.add_argument("--track", choices=TRACKS, default=TRACKS[0], help="of the trial, as for pmg prove")
    parser.add_argument("--clean", type=int, help="only the first so many clean ones of them")
    parser.add_argument("--concealed", type=int, help="only the first so many others")
    parser.add_argument("--calibration", type=int, default=CALIBRATION, help="further clean campaigns that calibrate")
    parser.add_argument("--ours", type=Path, help="scores.json of pmg prove on the same trial, for pmg's own line")
    parser.add_argument("--out", type=Path, required=True, help="folder of the answers and the table")
    asked = parser.parse_args()
    try:
        lots = chosen(asked.campaigns, asked.seed, asked.clean, asked.concealed, asked.laws, asked.track)
        if not lots or asked.calibration < 0:
            raise BenchError("--campaigns", str(asked.campaigns), "1 or more", "Give a number of campaigns.")
        ours = None if asked.ours is None else read_proof(asked.ours, lots)
        for package in PACKAGES:
            if not installed(package):
                sys.stderr.write(f"{package} is not installed, and not asked; see tests/bench/peers.txt\n")
        calibration = OF_TRACK[asked.track].draw(asked.calibration, asked.seed + 1, ("clean",))
        who: Rivals = contestants() if asked.track == TRACKS[0] else contestants_in_motion()
        sys.stdout.write(run(lots, calibration, who, asked.out, ours))
    except PmgError as error:
        sys.stderr.write(f"{error}\n")
        raise SystemExit(1) from None


if __name__ == "__main__":
    main()

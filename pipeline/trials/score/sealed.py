"""Truths under seal: their hashes are published before any diagnosis is made, and checked when they are opened."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.trials.nature import seal_truth
from pmg.pipeline.trials.score.case_list import TRACKS
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.trials.score.case_list import AnyLot

SCHEMA = "pmg.sealed/1"
FILE = "sealed.json"


def _drawn(lot: AnyLot[Any]) -> tuple[str, AnyLot[Any]]:
    """What a campaign conceals, as the text that is sealed, and its lot with the effects already sized."""
    case, sized = lot.draw_sized()
    return seal_truth(case.truth)[0], sized


def draw_truths(
    lots: tuple[AnyLot[Any], ...], workers: int = 1, progress: Progress | None = None
) -> tuple[dict[int, str], tuple[AnyLot[Any], ...]]:
    """What each campaign conceals, by its number, and the lots with their effects already sized.

    `progress` receives how many are drawn, of how many, and which.
    """
    found: dict[int, tuple[str, AnyLot[Any]]] = {}
    for lot, drawn in map_over(_drawn, lots, workers):
        found[lot.number] = drawn
        if progress is not None:
            progress(len(found), len(lots), f"campaign {lot.number} drawn")
    return {number: found[number][0] for number in sorted(found)}, tuple(found[lot.number][1] for lot in lots)


def seal(
    texts: Mapping[int, str],
    folder: Path,
    *,
    seed: int,
    kinds: tuple[str, ...],
    route: str,
    laws: str,
    track: str = TRACKS[0],
) -> dict[int, str]:
    """Publish the hash of every truth; a seal that is there already must be the same.

    Returns
    -------
    dict of int to str
        SHA-256 of each truth by the number of its campaign.

    Raises
    ------
    StoreError
        The folder holds the seal of another trial.
    """
    hashes = {number: hashlib.sha256(text.encode("utf-8")).hexdigest() for number, text in texts.items()}
    document = {
        "schema": SCHEMA,
        "seed": seed,
        "campaigns": len(texts),
        "strata": list(kinds),
        "route": route,
        "laws": laws,
        **({} if track == TRACKS[0] else {"track": track}),
        "sha256": list(hashes.values()),
    }
    path = folder / FILE
    if path.exists():
        there = _read_seal(path)
        for name, value in document.items():
            if there.get(name) != value:
                text = "other truths" if name == "sha256" else f"{name} {there.get(name)}"
                wanted = "the truths of this call" if name == "sha256" else f"{name} {value}"
                raise StoreError(
                    str(path),
                    f"sealed for {text}",
                    f"a seal for {wanted}, or none",
                    "Name another folder with --out, or the trial that this one holds.",
                )
    else:
        write_atomic(path, (json.dumps(document, indent=1) + "\n").encode())
    return hashes


def _read_seal(path: Path) -> dict[str, Any]:
    """The published hashes and what they are of."""
    try:
        document = read_json(path)
    except ValueError:
        document = None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise StoreError(str(path), "not a readable seal", f"a document {SCHEMA}", "Name another folder with --out.")
    return document


def open_truth(text: str, sealed: str, where: str) -> dict[str, Any]:
    """The truth, if it is the one that was sealed.

    Raises
    ------
    StoreError
        Its hash is another.
    """
    found = hashlib.sha256(text.encode("utf-8")).hexdigest()
    if found != sealed:
        raise StoreError(
            where,
            f"a truth with SHA-256 {found[:12]}...",
            f"the one sealed beforehand, {sealed[:12]}...",
            "It was changed after sealing; begin the trial anew in another folder.",
        )
    truth: dict[str, Any] = json.loads(text)
    return truth


def open_truths(texts: Mapping[int, str], folder: Path) -> dict[int, dict[str, Any]]:
    """Every truth checked against the seal and laid next to it, in ``truths``; call it when all diagnoses are made.

    A truth that already lies there is the one that is checked.
    """
    published = _read_seal(folder / FILE)["sha256"]
    found = {}
    for number, drawn in texts.items():
        path = folder / "truths" / f"{number:04d}.json"
        text = path.read_text(encoding="utf-8") if path.exists() else drawn
        found[number] = open_truth(text, published[number], str(path))
        if not path.exists():
            write_atomic(path, text.encode())
    return found

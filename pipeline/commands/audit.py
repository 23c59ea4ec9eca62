"""The stage behind ``pmg runs audit``: the trail of a store, its chain verified, its files held against it."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.catalogue.listing import aligned_cells
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.atomic import PREFIX
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.audit_trail import BEGAN, FILE, NUMBER, OWN, STATE, AuditTrail, Break, read_trail
from pmg.pipeline.store.store import SOURCES, Store
from pmg.pipeline.wording.plurals import counted, listed
from pmg.pipeline.wording.safe_text import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

HEADS = ("entry", "time [UTC]", "user", "host", "pmg", "exit", "read", "written", "call")
RIGHT = (True, False, False, False, False, True, True, True, False)


@dataclass(frozen=True)
class _HeldFiles:
    """Files that the trail says were written, as they are now: as recorded, changed since, or gone."""

    same: tuple[str, ...]
    changed: tuple[str, ...]
    gone: tuple[str, ...]


def run_audit(store: Path, head: str | None = None) -> Outcome:
    """Show the audit trail of a store, verify its chain, and hold the files that it names against it.

    Parameters
    ----------
    store : Path
        The store.
    head : str, optional
        Hash of an entry as it was noted elsewhere; it must be in the chain.

    Returns
    -------
    Outcome
        Failed where the chain is broken; partial where there is no trail, or lines of it are lost; a mismatch where a
        file has changed since it was written.
    """
    Store(store).require()
    try:
        trail = read_trail(store)
    except FileNotFoundError:
        trail = AuditTrail((), (), ())
    breaks = list(trail.breaks)
    if head is not None and head.lower() not in {entry[OWN] for entry in trail.entries}:
        came = f"no entry with the hash {head}"
        breaks.append(
            Break(len(trail.entries) + 1, came, "the entry that was noted: the end was removed, or written anew")
        )
    held = _held_files(store, trail)
    without = _without_entry(store, held)
    place = str(store / FILE)
    remarks = [Remark("error", f"{place}: line {at.line}", f"{at.came}; expected {at.expected}") for at in breaks]
    remarks += [Remark("warning", f"{place}: line {at.line}", _lost(at)) for at in trail.lost]
    remarks += [Remark("warning", path, "changed since pmg wrote it, by its hash") for path in held.changed]
    remarks += [
        Remark("warning", f"{place}: line {entry.get(NUMBER)}", _unended(entry))
        for entry in trail.calls
        if entry.get(STATE) == BEGAN
    ]
    if not trail.entries:
        remarks.append(Remark("warning", place, "no entry: made before pmg kept a trail, or the trail was removed"))
    elif without:
        message = (
            f"{counted(len(without), 'recording')} in the store that no entry wrote ({listed(without)}): made before "
        )
        message += "there was a trail, by a command that was killed, or by other means"
        remarks.append(Remark("info", place, message))
    data = {
        "trail": place,
        "whole": not breaks and not trail.lost,
        "head": trail.head,
        "breaks": [asdict(each) for each in breaks],
        "lost": [asdict(each) for each in trail.lost],
        "files": asdict(held),
        "without_entry": without,
        "entries": list(trail.entries),
    }
    lost = bool(trail.lost) or not trail.entries
    lines = (*_table(trail), *_summary(trail, breaks, held))
    return Outcome(data, lines, tuple(remarks), partial=lost, mismatch=bool(held.changed), failed=bool(breaks))


def _lost(at: Break) -> str:
    return f"{at.came}; expected {at.expected}. A kill or a full disk leaves such a line: what it said is lost"


def _unended(entry: Mapping[str, Any]) -> str:
    return (
        f"'{_call(entry)}' began at {entry.get(BEGAN)} and left no end; expected one. It was killed or its machine "
        "stopped, or it is still running; what it wrote is not in the trail. If it is no longer running, run it again"
    )


def _held_files(store: Path, trail: AuditTrail) -> _HeldFiles:
    """Files that were written, each by the last entry that wrote it."""
    written = {path: digest for entry in trail.entries for path, digest in _files(entry.get("written"))}
    states: dict[str, str] = {}
    for path, digest in sorted(written.items()):
        place = store / path
        try:
            states[path] = "gone" if not place.is_file() else "same" if sha256_of(place) == digest else "changed"
        except OSError:
            states[path] = "gone"
    return _HeldFiles(*(tuple(p for p, is_now in states.items() if is_now == s) for s in ("same", "changed", "gone")))


def _files(listed_files: object) -> Iterator[tuple[str, str]]:
    """Paths and hashes of an entry; what is not of that form is left out."""
    for each in listed_files if isinstance(listed_files, list) else ():
        if isinstance(each, dict) and isinstance(each.get("path"), str):
            yield each["path"], str(each.get("sha256"))


def _without_entry(store: Path, held: _HeldFiles) -> list[str]:
    """Manifests in the store that no entry wrote, by name."""
    known = {*held.same, *held.changed}
    found = sorted(path for path in (store / SOURCES).glob("*.json") if not path.name.startswith(PREFIX))
    return [path.stem for path in found if f"{SOURCES}/{path.name}" not in known]


def _table(trail: AuditTrail) -> list[str]:
    rows = [tuple(printable(text) for text in _row(entry)) for entry in trail.calls]
    return aligned_cells([HEADS, *rows], RIGHT) if rows else []


def _row(entry: Mapping[str, Any]) -> Iterator[str]:
    versions = entry.get("versions")
    yield str(entry.get(NUMBER))
    yield str(entry.get("began"))[:19].replace("T", " ")
    yield str(entry.get("user"))
    yield str(entry.get("host"))
    yield str(versions.get("pmg") if isinstance(versions, dict) else None)
    yield "none" if entry.get(STATE) == BEGAN else str(entry.get("exit_code"))
    yield str(sum(len(part) for name in ("read", "recordings") if isinstance(part := entry.get(name), list)))
    yield str(len(tuple(_files(entry.get("written")))))
    yield _call(entry)


def _call(entry: Mapping[str, Any]) -> str:
    """The call as typed; from Python the function, and the script."""
    words = entry.get("arguments")
    typed = shlex.join(map(str, words if isinstance(words, list) else ()))
    return f"Python {entry.get('command')}: {typed}" if entry.get("by") == "Python" else f"pmg {typed}".rstrip()


def _summary(trail: AuditTrail, breaks: list[Break], held: _HeldFiles) -> Iterator[str]:
    count = f"{len(trail.entries)} {'entry' if len(trail.entries) == 1 else 'entries'}"
    count = f"{counted(len(trail.calls), 'call')} in {count}"
    if breaks:
        yield f"{count}; the chain is broken at line {min(at.line for at in breaks)}: what stands there is no record"
    elif trail.entries:
        yield f"{count}; the chain is whole" + (
            f", but for {counted(len(trail.lost), 'lost line')}" if trail.lost else ""
        )
    yield (
        f"{counted(len(held.same), 'file')} as recorded, {len(held.changed)} changed since, "
        f"{len(held.gone)} no longer there"
    )
    if trail.head is not None:
        yield f"head: {trail.head}"
        yield "Note the head elsewhere: only that shows a trail that was written anew as a whole, or cut at its end."

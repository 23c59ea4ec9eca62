"""The audit trail as a file: what is done to it by hand, by a kill or by two commands at once is told, and where."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from tests.conftest import ROOT

from pmg.pipeline.store import audit_trail
from pmg.pipeline.store.audit_trail import FILE, append_entry, read_trail
from pmg.pipeline.store.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ENTRIES = 5
FACTS: dict[str, Any] = {
    "began": "2026-05-01T08:00:00+00:00",
    "user": "a",
    "arguments": ["ingest", "\udcff", "\u202e"],
    "settings": {"store": "s", "robust": True, "workers": 2},
    "written": [{"path": "x", "sha256": "0" * 64}],
    "exit_code": 0,
}


@pytest.fixture
def store(tmp_path: Path) -> Path:
    Store(tmp_path / "s").prepare()
    for number in range(ENTRIES):
        append_entry(tmp_path / "s", {**FACTS, "began": f"2026-05-01T08:0{number}:00+00:00"})
    return tmp_path / "s"


def lines(store: Path) -> list[bytes]:
    return (store / FILE).read_bytes().splitlines(keepends=True)


def broken_at(store: Path) -> list[int]:
    return sorted({each.line for each in read_trail(store).breaks})


def test_a_chain_as_it_was_written_is_whole_and_keeps_every_fact(store: Path) -> None:
    trail = read_trail(store)
    assert not trail.breaks
    assert not trail.lost
    assert [entry["entry"] for entry in trail.entries] == [1, 2, 3, 4, 5]
    assert [entry["previous"] for entry in trail.entries] == [None, *(entry["sha256"] for entry in trail.entries[:-1])]
    assert all(entry.items() >= {**FACTS, "began": entry["began"]}.items() for entry in trail.entries)
    assert trail.head == trail.entries[-1]["sha256"]


@pytest.mark.parametrize("line", range(1, ENTRIES + 1))
def test_every_field_that_is_changed_breaks_the_chain_at_its_line(store: Path, line: int) -> None:
    """The last line too, which no later one answers for; a break may show at the next line besides."""
    whole = lines(store)
    entry = json.loads(whole[line - 1])
    for field in entry:
        for changed in ({**entry, field: "another"}, {key: value for key, value in entry.items() if key != field}):
            text = json.dumps(changed, sort_keys=True, separators=(",", ":")).encode() + b"\n"
            (store / FILE).write_bytes(b"".join([*whole[: line - 1], text, *whole[line:]]))
            trail = read_trail(store)
            told = {each.line for each in (*trail.breaks, *trail.lost)}
            assert line in told, (field, changed)
            assert told <= {line, line + 1}


def with_own_hash_made_right(line: bytes) -> bytes:
    """A line changed by someone who knows how its own hash is made."""
    entry = {**json.loads(line), "user": "someone else"}
    entry["sha256"] = audit_trail._hash_of(entry)
    return audit_trail._canonical(entry) + b"\n"


TAMPERED: dict[str, tuple[Callable[[list[bytes]], list[bytes]], list[int]]] = {
    "the first removed": (lambda all_: all_[1:], [1, 2, 3, 4]),
    "one in the middle removed": (lambda all_: [*all_[:2], *all_[3:]], [3, 4]),
    "two swapped": (lambda all_: [all_[0], all_[2], all_[1], *all_[3:]], [2, 3, 4]),
    "one doubled": (lambda all_: [*all_[:2], *all_[1:]], [3, 4, 5, 6]),
    "an empty line added": (lambda all_: [*all_[:2], b"\n", *all_[2:]], [4, 5, 6]),
    "another spelling": (lambda all_: [*all_[:2], all_[2].replace(b'":', b'": '), *all_[3:]], [3]),
    "a key twice": (lambda all_: [*all_[:2], all_[2].replace(b'{"', b'{"user":"b","', 1), *all_[3:]], [3]),
    "its own hash made right": (lambda all_: [*all_[:2], with_own_hash_made_right(all_[2]), *all_[3:]], [4]),
    "one in the middle torn": (lambda all_: [*all_[:2], all_[2][:40] + b"\n", *all_[3:]], [4]),
}


@pytest.mark.parametrize("how", TAMPERED)
def test_tampering_with_lines_is_told_with_its_line(store: Path, how: str) -> None:
    tamper, expected = TAMPERED[how]
    (store / FILE).write_bytes(b"".join(tamper(lines(store))))
    assert broken_at(store) == expected


def test_a_torn_tail_is_told_and_later_entries_stand(store: Path) -> None:
    whole = lines(store)
    (store / FILE).write_bytes(b"".join(whole[:-1]) + whole[-1][:50])
    trail = read_trail(store)
    assert ([each.line for each in trail.lost], trail.breaks) == ([5], ())
    append_entry(store, FACTS)
    trail = read_trail(store)
    assert ([each.line for each in trail.lost], trail.breaks) == ([5], ())
    assert [entry["entry"] for entry in trail.entries] == [1, 2, 3, 4, 6]
    assert lines(store)[:4] == whole[:4]


def test_a_tail_that_lacks_only_its_line_feed_is_a_whole_entry(store: Path) -> None:
    whole = lines(store)
    (store / FILE).write_bytes(b"".join(whole).removesuffix(b"\n"))
    append_entry(store, FACTS)
    trail = read_trail(store)
    assert (len(trail.entries), trail.breaks, trail.lost) == (6, (), ())


@pytest.mark.parametrize("tail", [b"\xff\xfe\n", b"[" * 100_000, b"[]\n", b'{"sha256": 3}\n', b"1" * 5_000 + b"\n"])
def test_a_tail_that_is_no_entry_is_lost_and_nothing_else(store: Path, tail: bytes) -> None:
    (store / FILE).write_bytes((store / FILE).read_bytes() + tail)
    append_entry(store, FACTS)
    trail = read_trail(store)
    assert ([each.line for each in trail.lost], trail.breaks) == ([6], ())
    assert len(trail.entries) == 6


def test_commands_at_once_leave_all_their_entries_in_one_chain(store: Path) -> None:
    text = (
        "import sys; from pathlib import Path; from pmg.pipeline.store.audit_trail import append_entry\n"
        "for number in range(40): append_entry(Path(sys.argv[1]), {'user': sys.argv[2], 'n': number, 'x': 'y' * 9000})"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT / ".typing")}
    both = [subprocess.Popen([sys.executable, "-c", text, str(store), who], env=environment) for who in "pq"]
    assert [process.wait(timeout=60) for process in both] == [0, 0]
    trail = read_trail(store)
    assert (trail.breaks, trail.lost) == ((), ())
    for who in "pq":
        assert [entry["n"] for entry in trail.entries if entry["user"] == who] == list(range(40))


def test_a_trail_that_another_command_keeps_is_not_waited_for_without_end(
    store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_trail, "PATIENCE_S", 0.0)
    before = (store / FILE).read_bytes()
    with (store / FILE).open("rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(OSError, match="held by another process"):
            append_entry(store, FACTS)
    assert (store / FILE).read_bytes() == before
    append_entry(store, FACTS)


def test_a_disk_that_fills_up_leaves_the_trail_as_it_was(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, write = (store / FILE).read_bytes(), os.write
    room = [30]

    def little(descriptor: int, data: bytes) -> int:
        if not room[0]:
            raise OSError(28, "No space left on device")
        written = write(descriptor, data[: room[0]])
        room[0] -= written
        return written

    monkeypatch.setattr(os, "write", little)
    with pytest.raises(OSError, match="No space"):
        append_entry(store, FACTS)
    assert (store / FILE).read_bytes() == before


def test_no_store_no_trail(tmp_path: Path) -> None:
    append_entry(tmp_path / "nothing", FACTS)
    assert not (tmp_path / "nothing").exists()
    (tmp_path / "thesis.doc").write_text("years of work")
    append_entry(tmp_path, FACTS)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.doc"]

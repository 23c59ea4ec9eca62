"""Points that a recording lost with their steps are named, by what the campaign's other files ran."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.recording.damages import CHUNK, of_kind, recorded
from tests.recording.writer import Bench

from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.missing_points import missing_points
from pmg.pipeline.store.store import Store

FIRST, LATER, LATEST = (f"2025-04-23T{hour:02}:00:00Z" for hour in (8, 9, 10))
NAMES = ("A", "B", "C", "D")
EACH = 1000
"""Samples from one START to the next: 200 to settle, 700 of the window."""
TOPICS = tuple(f"/daq/{what}" for s in ("sun", "ring") for what in (f"torque_{s}/frequency", f"encoder_{s}/count"))


def session(started_at: str, names: tuple[str, ...] = NAMES, samples: int | None = None, **change: object) -> bytes:
    """A sequence of these points, whose loads tell them apart, over that many samples."""
    steps = [
        (place * EACH + at, name, phase, {"sun_speed_rpm": 600.0, "ring_torque_Nm": float(NAMES.index(name))})
        for place, name in enumerate(NAMES)
        if name in names
        for at, phase in ((0, "START"), (200, "MEASURE"), (900, "END"))
    ]
    run = {"started_at": started_at, "point": None}
    length = (samples or len(NAMES) * EACH) / 500.0
    return recorded(Bench(length, steps=steps, run=run, **change))  # type: ignore[arg-type]


def stored(folder: Path, **files: bytes) -> tuple[Store, Outcome]:
    recordings = folder / "r"
    recordings.mkdir()
    for name, data in files.items():
        (recordings / f"{name}.mcap").write_bytes(data)
    outcome = run_ingest(recordings, folder / "s", ALONE)
    return Store(folder / "s"), outcome


def test_points_beyond_a_cut_are_named_with_their_set_points(tmp_path: Path) -> None:
    """At ingest, at analyse, at compare and in the report."""
    store, outcome = stored(tmp_path, whole=session(FIRST), cut=session(LATER, ("A", "B"), 1800))
    lost = missing_points(store.manifests())
    assert [(point.file, point.point, point.like, point.instead) for point in lost] == [
        ("cut.mcap", "C", "whole.mcap", ""),
        ("cut.mcap", "D", "whole.mcap", ""),
    ]
    short = "window too short: 1.20 s of 1.40 s; samples 1800 to 1900 are missing"
    assert lost[0].why == f"the recording ends at sample 1800 ({short}), after B"
    assert lost[0].asked == "neutral, sun 600 rpm, load 2 N m"
    assert outcome.data["not_reached"] == 2
    assert outcome.partial
    assert "2 points not reached" in "".join(outcome.lines)
    analysed = run_analyse(store.path, AnalysisOptions(), grids=None, campaign=None)
    compared = run_compare(store.path, tmp_path / "report")
    for each in (outcome, analysed, compared):
        assert {"cut.mcap: C", "cut.mcap: D"} == {f.where for f in each.findings if "not reached" in f.message}
    assert "cut.mcap: D" in (tmp_path / "report" / "report.html").read_text()


def test_a_cut_between_points_is_told_by_what_the_container_lost(tmp_path: Path) -> None:
    """Every window there is stands, and ingest is partly done all the same."""
    longer = session(LATER, ("A", "B"), 2500)
    store, outcome = stored(tmp_path, whole=session(FIRST), cut=longer[: of_kind(longer, CHUNK)[-1][1] - 20])
    assert [point.point for point in missing_points(store.manifests())] == ["C", "D"]
    assert "container.truncated at" in missing_points(store.manifests())[0].why
    assert outcome.data["rejected"] == 0
    assert outcome.partial


def test_points_in_a_gap_are_named_beside_it(tmp_path: Path) -> None:
    gap = dict.fromkeys(TOPICS, (1900, 3000))
    store, _ = stored(tmp_path, whole=session(FIRST), gap=session(LATER, ("A", "B", "D"), drop=gap))
    (lost,) = missing_points(store.manifests())
    assert (lost.point, lost.why) == ("C", "lost after B, with samples that are missing")


def test_points_before_a_late_beginning_are_named_with_those_beyond_the_end(tmp_path: Path) -> None:
    late = session(LATER, ("B", "C"), 2800, drop=dict.fromkeys(TOPICS, (0, 1000)))
    store, _ = stored(tmp_path, whole=session(FIRST), late=late)
    lost = missing_points(store.manifests())
    assert [point.point for point in lost] == ["A", "D"]
    assert lost[0].why == "lost before its first point, with samples that are missing"


def test_points_that_were_run_again_are_told_with_the_file(tmp_path: Path) -> None:
    store, outcome = stored(
        tmp_path, whole=session(FIRST), cut=session(LATER, ("A", "B", "C"), 2800), rest=session(LATEST, ("D",))
    )
    (lost,) = missing_points(store.manifests())
    assert (lost.point, lost.instead) == ("D", "rest.mcap")
    assert {f.severity for f in outcome.findings if "not reached" in f.message} == {"info"}


@pytest.mark.parametrize(
    "other",
    [
        session(LATER, ("A", "B"), 2000),  # shorter, and whole
        session(FIRST, ("A", "B"), 1800),  # a copy of the same run, cut short
        session(LATER, ("A", "D"), 3800),  # another sequence
        session(LATER, ("A", "B", "D"), drop=dict.fromkeys(TOPICS, (1500, 1505))),  # another, with a drop-out in B
    ],
)
def test_nothing_is_missing_of_a_copy_or_of_another_sequence(tmp_path: Path, other: bytes) -> None:
    store, outcome = stored(tmp_path, whole=session(FIRST), other=other)
    assert missing_points(store.manifests()) == ()
    assert outcome.data["not_reached"] == 0


def test_a_point_that_a_whole_sequence_that_begins_alike_does_not_run_may_not_have_been_meant(tmp_path: Path) -> None:
    store, _ = stored(
        tmp_path,
        whole=session(FIRST),
        other=session("2025-04-23T07:00:00Z", ("A", "B", "C"), 3000),
        cut=session(LATER, ("A", "B"), 1800),
    )
    lost = missing_points(store.manifests())
    assert [(point.point, point.without) for point in lost] == [("C", ""), ("D", "other.mcap")]
    assert "whole.mcap, which begins as it does, runs it" in lost[0].finding().message
    assert "may not have been meant" not in lost[0].finding().message
    assert (
        lost[1]
        .finding()
        .message.endswith("other.mcap begins so too and does not run it, so that it may not have been meant")
    )


def test_ingest_tells_of_copies_of_a_run(tmp_path: Path) -> None:
    """As analyse does; the other bytes of a copy are what a byte-for-byte comparison misses."""
    store, outcome = stored(tmp_path, a=session(FIRST), b=session(FIRST, ("A", "B"), 2000))
    told = {f.where: f.message for f in outcome.findings if "the same run" in f.message}
    assert told == dict.fromkeys(("b.mcap: A", "b.mcap: B"), "the same run is in a.mcap; it counts once, as there")
    assert outcome.data["copies"] == 2
    assert "2 windows in two files: counted once" in outcome.lines
    assert all(window["accepted"] for m in store.manifests() for window in m.document()["windows"])


def test_a_call_tells_what_a_file_of_an_earlier_call_shares_with_it(tmp_path: Path) -> None:
    """Of two shards the first cannot know: the copy and the cut recording come in before the whole one."""
    (tmp_path / "r").mkdir()
    files = {"copy": session(FIRST, ("A", "B"), 2000), "cut": session(LATER, ("A", "B"), 1800), "whole": session(FIRST)}
    for name, data in files.items():
        (tmp_path / "r" / f"{name}.mcap").write_bytes(data)
    calls = [run_ingest(tmp_path / "r" / f"{name}.mcap", tmp_path / "s", ALONE).data for name in files]
    assert [(call["copies"], call["not_reached"]) for call in calls] == [(0, 0), (0, 0), (2, 2)]

"""reports/tutorial.md: its commands run in their order, print what is quoted, and its chapters are the report's."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.walk import blocks_of, missing
from tests.walk import walk as walk_through

TUTORIAL = ROOT / "reports" / "tutorial.md"
BLOCKS = blocks_of("tutorial.md")


@dataclass(frozen=True)
class Walk:
    """What each block printed, on either stream, and where."""

    printed: tuple[str, ...]
    code: int
    folder: Path


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    clone = tmp_path_factory.mktemp("clone")
    return Walk(*walk_through(BLOCKS, clone), clone / "reports" / "tutorial")


@pytest.mark.parametrize("number", range(len(BLOCKS)), ids=[block.name for block in BLOCKS])
def test_a_block_runs_and_prints_what_is_quoted(walk: Walk, number: int) -> None:
    assert number < len(walk.printed) - 1, f"ended with {walk.code}: {walk.printed[-1]}"
    lacks = missing(BLOCKS[number].quoted, walk.printed[number])
    assert lacks is None, f"not printed: {lacks}\n--- printed:\n{walk.printed[number]}"


def test_the_chapters_of_the_tutorial_are_those_of_the_report(walk: Walk) -> None:
    page = (walk.folder / "report" / "report.html").read_text(encoding="utf-8")
    headings = [re.sub(r"<[^>]*>|\s+", " ", h) for h in re.findall(r"<h2[^>]*>(.*?)</h2>", page, re.DOTALL)]
    titles = [html.unescape(re.sub(r"^ *\d+ ", "", heading)).strip() for heading in headings]
    table = TUTORIAL.read_text(encoding="utf-8").split("| chapter | question |\n|---|---|\n")[1].split("\n\n")[0]
    told = [row.split("|")[1].strip() for row in table.splitlines()]
    assert [title for title in titles if title in told] == told
    assert "Signals of a point" in titles


def test_every_file_that_the_tutorial_names_is_there(walk: Walk) -> None:
    report = walk.folder / "report"
    for name in ("report.xlsx", "summary.json", "model.toml", "diagnosis.json", "tables"):
        assert (report / name).exists()
    assert (walk.folder / "versus" / "report.html").is_file()


@pytest.mark.parametrize(
    ("quoted", "printed", "lacks"),
    [
        ("a ... c\nd", "x\na b c\ny\nd\n", None),
        ("d\na ... c", "a b c\nd\n", "a ... c"),
        ("a\n...\nb", "a\nx\nb", None),
        ("1.5 (N m)", "1x5 (N m)", "1.5 (N m)"),
        ("a", "", "a"),
    ],
)
def test_a_line_that_is_not_printed_is_missed(quoted: str, printed: str, lacks: str | None) -> None:
    assert missing(tuple(quoted.splitlines()), printed) == lacks

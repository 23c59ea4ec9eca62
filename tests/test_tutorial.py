"""reports/tutorial.md: its commands run in their order, print what is quoted, and its chapters are the report's."""

from __future__ import annotations

import html
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.conftest import ROOT

TUTORIAL = ROOT / "reports" / "tutorial.md"
BLOCK = re.compile(r"^```sh\n(?P<script>.*?)^```\n(?:```text\n(?P<quoted>.*?)^```\n)?", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """Commands, and the lines they are said to print; ``...`` stands for anything within a line."""

    script: str
    quoted: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.script.splitlines()[-1]


def blocks(text: str) -> tuple[Block, ...]:
    return tuple(Block(m["script"], tuple((m["quoted"] or "").splitlines())) for m in BLOCK.finditer(text))


def missing(quoted: tuple[str, ...], printed: str) -> str | None:
    """The first quoted line that does not come, in the order of the quotation; None where all do."""
    lines = iter(line.rstrip() for line in printed.splitlines())
    for line in quoted:
        wanted = re.compile(".*".join(map(re.escape, (part.strip() for part in line.split("...")))).strip())
        if line.strip() != "..." and not any(wanted.fullmatch(printed_line.strip()) for printed_line in lines):
            return line
    return None


BLOCKS = blocks(TUTORIAL.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Walk:
    """What each block printed, on either stream, and where."""

    printed: tuple[str, ...]
    code: int
    folder: Path


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """All blocks in one shell, which ends with the first command that fails; `pmgw` is this Python's pmg."""
    clone = tmp_path_factory.mktemp("clone")
    (clone / "raw").symlink_to(ROOT / "raw")
    (clone / "pmgw").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pmg.pipeline "$@"\n')
    (clone / "pmgw").chmod(0o755)
    ends = [f"{block.script}\necho '@@ end of block {i}'\n" for i, block in enumerate(BLOCKS)]
    done = subprocess.run(
        ["sh", "-e"],
        input="".join(ends),
        cwd=clone,
        env={**os.environ, "PYTHONPATH": f"{ROOT / '.typing'}{os.pathsep}{ROOT}", "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    printed = re.split(r"^@@ end of block \d+\n", done.stdout, flags=re.MULTILINE)
    return Walk(tuple(printed), done.returncode, clone / "reports" / "tutorial")


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

"""Pages that walk a reader through commands: the commands of a page run in their order, what they print against it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.conftest import ROOT

if TYPE_CHECKING:
    from pathlib import Path

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


def blocks_of(page: str) -> tuple[Block, ...]:
    """Blocks of a page in the folder of reports."""
    return blocks((ROOT / "reports" / page).read_text(encoding="utf-8"))


def missing(quoted: tuple[str, ...], printed: str) -> str | None:
    """The first quoted line that does not come, in the order of the quotation; None where all do."""
    lines = iter(line.rstrip() for line in printed.splitlines())
    for line in quoted:
        wanted = re.compile(".*".join(map(re.escape, (part.strip() for part in line.split("...")))).strip())
        if line.strip() != "..." and not any(wanted.fullmatch(printed_line.strip()) for printed_line in lines):
            return line
    return None


def walk(told: tuple[Block, ...], clone: Path) -> tuple[tuple[str, ...], int]:
    """What each block prints, on either stream, and the exit code: all in one shell, which ends with a failure.

    `raw` is that of this clone, `pmgw` is this Python's pmg.
    """
    (clone / "raw").symlink_to(ROOT / "raw")
    (clone / "pmgw").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pmg.pipeline "$@"\n')
    (clone / "pmgw").chmod(0o755)
    done = subprocess.run(
        ["sh", "-e"],
        input="".join(f"{block.script}\necho '@@ end of block {i}'\n" for i, block in enumerate(told)),
        cwd=clone,
        env={**os.environ, "PYTHONPATH": f"{ROOT / '.typing'}{os.pathsep}{ROOT}", "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return tuple(re.split(r"^@@ end of block \d+\n", done.stdout, flags=re.MULTILINE)), done.returncode


def assert_as_told(page: str, clone: Path) -> None:
    """Every block of a page prints what is quoted after it."""
    told = blocks_of(page)
    printed, _ = walk(told, clone)
    assert len(printed) == len(told) + 1, "".join(printed)
    for block, lines in zip(told, printed, strict=False):
        lacks = missing(block.quoted, lines)
        assert lacks is None, f"not printed: {lacks}\n--- printed:\n{lines}"

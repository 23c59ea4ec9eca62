"""`./pmgw bench processors CAMPAIGN...`: analysis and diagnosis under each type of core and number of threads."""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import linalg

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLE = ROOT / "raw" / "example"
TYPES = ("Haswell", "Zen", "SkylakeX")
"""Types of core whose kernels of linear algebra round differently; `OPENBLAS_CORETYPE` chooses one."""
THREADS = (1, 2)
LARGE = 300
"""Rows of a matrix whose product needs the kernels of the core: a processor without its instructions ends there."""
_ASKING = tuple(f"{scipy}openblas_get_corename{wide}" for scipy in ("scipy_", "") for wide in ("64_", ""))
"""Names under which an OpenBLAS tells the core that it works for."""


def cores_in_use() -> list[str]:
    """The core that each OpenBLAS of this process works for; empty where there is none."""
    linalg.svdvals(np.eye(2))
    product = np.ones((LARGE, LARGE)) @ np.ones((LARGE, LARGE))
    assert product[0, 0] == LARGE
    maps = Path("/proc/self/maps")
    lines = maps.read_text(encoding="utf-8").splitlines() if maps.is_file() else []
    found = []
    for path in sorted({line.split()[-1] for line in lines if "openblas" in line.lower()}):
        library = ctypes.CDLL(path)
        told = next((getattr(library, name) for name in _ASKING if hasattr(library, name)), None)
        if told is not None:
            told.restype = ctypes.c_char_p
            found.append(told().decode())
    return found


def _done(core: str, threads: int, words: list[str], at: Path) -> subprocess.CompletedProcess[str]:
    """A command of Python, ended, on a type of core."""
    path = f"{ROOT / '.typing'}{os.pathsep}{ROOT}"
    settings = {"PYTHONPATH": path, "OPENBLAS_CORETYPE": core, "OPENBLAS_NUM_THREADS": str(threads)}
    return subprocess.run(
        [sys.executable, *words], cwd=at, env=os.environ | settings, capture_output=True, text=True, check=False
    )


def on(core: str, threads: int, words: list[str], at: Path) -> str:
    """What a command of Python prints on a type of core; its exit code may tell a mismatch or a part left out."""
    done = _done(core, threads, words, at)
    assert done.returncode in (0, 3, 4), f"exit code {done.returncode}: {done.stderr}"
    return done.stdout


def taken(core: str) -> bool:
    """Whether a type of core can be had here.

    Asked for one that it cannot be, OpenBLAS takes another in silence, or works with instructions that the processor
    does not have, which ends the process by a signal.
    """
    done = _done(core, 1, ["-c", "from tests.bench.processors import cores_in_use; print(*cores_in_use())"], ROOT)
    if done.returncode < 0:
        return False
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split()) == {core}


def leaves(value: object, at: str = "") -> Iterator[tuple[str, object]]:
    """Every text, number and empty part of a JSON value, with its place."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if not parts:
        yield at, value
    for key, part in parts:
        yield from leaves(part, f"{at}.{key}")


def _distance(one: object, other: object) -> float:
    """Relative difference of two numbers; infinite for whatever else differs."""
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other) / max(abs(one), abs(other), sys.float_info.min)
    return 0.0 if one == other else float("inf")


def _compared(first: dict[str, object], other: dict[str, object]) -> str:
    """Cells of the table: fields that are equal and different, the largest difference and its place."""
    apart = {k: _distance(first.get(k), other.get(k)) for k in first.keys() | other.keys()}
    apart = {k: d for k, d in apart.items() if first.get(k) != other.get(k)}
    worst = max(apart, key=apart.__getitem__, default="")
    return f"{len(first) - len(apart)} | {len(apart)} | {apart.get(worst, 0.0):.1e} {worst}"


def main() -> int:
    """Print a table of equal and different fields; the exit code says whether any diagnosis differs."""
    parser = argparse.ArgumentParser(prog="pmgw bench processors", description=__doc__)
    parser.add_argument("campaigns", nargs="*", type=Path, default=[EXAMPLE], help="folders of recordings or of grids")
    given = parser.parse_args()
    types, out, same = [core for core in TYPES if taken(core)], sys.stdout.write, True
    columns = ["campaign", "core", "threads", "s", "file", "equal", "different", "largest difference"]
    out(f"types of core that can be had here: {', '.join(types) or 'none'}\n\n")
    out(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}\n")
    with tempfile.TemporaryDirectory() as scratch:
        for campaign in given.campaigns:
            store, grids = Path(scratch, campaign.name), campaign / "neutral_grid.csv"
            more = ["--grids", str(campaign.resolve())] if grids.is_file() else []
            if not more:
                on("", 1, ["-m", "pmg.pipeline", "ingest", str(campaign.resolve()), "--store", str(store)], ROOT)
            before: dict[str, dict[str, object]] = {}
            for core, threads in ((core, threads) for core in types for threads in THREADS):
                start, report = time.monotonic(), Path(scratch, "report")
                on(core, threads, ["-m", "pmg.pipeline", "analyse", "--store", str(store), *more], ROOT)
                words = ["-m", "pmg.pipeline", "compare", "--store", str(store), "--report", str(report)]
                on(core, threads, words, ROOT)
                took = time.monotonic() - start
                for file in (report / "diagnosis.json", report / "summary.json", store / "analysis" / "analysis.json"):
                    fields = dict(leaves(json.loads(file.read_bytes())))
                    row = _compared(before.setdefault(file.name, fields), fields)
                    same &= file.name != "diagnosis.json" or fields == before[file.name]
                    out(f"| {campaign.name} | {core} | {threads} | {took:.0f} | {file.name} | {row} |\n")
                    sys.stdout.flush()
    return 0 if same and types else 1


if __name__ == "__main__":
    sys.exit(main())

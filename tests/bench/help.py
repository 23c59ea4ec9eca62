"""`./pmgw bench help`: how long `--help` of every command takes, in a process of its own, and what it loads.

Wall time of a whole call, the smallest of a few, beside Python alone and Python with typer: the rest is pmg's. The
machine decides much of it, so nothing here is held against a limit; what `--help` may load is held by the tests.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import typer

from pmg.pipeline.cli.app import app
from tests.bench.kill import ROOT

HEAVY = ("matplotlib", "mcap", "numba", "numpy", "pandas", "plotly", "polars", "scipy", "sympy")
"""Libraries that `--help` has no use for. (pydantic is loaded by typer itself, for every command with options.)"""

PROBE = f"""
import contextlib, io, json, sys
import typer
from pmg.pipeline.cli.app import app
helped, codes = [], []
root = typer.main.get_command(app)
def walk(command, path=()):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            root.main([*path, "--help"], prog_name="pmg")
        except SystemExit as end:
            codes.append(int(end.code or 0))
    assert "Usage: " + " ".join(("pmg", *path)) in out.getvalue(), path
    helped.append(path)
    for name, inner in getattr(command, "commands", {{}}).items():
        walk(inner, (*path, name))
walk(root)
print(json.dumps({{"helped": helped, "codes": codes, "heavy": [n for n in {HEAVY!r} if n in sys.modules]}}))
"""
"""Program that asks every command for its help in one process, and says what has been loaded by then."""


def walk(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:  # noqa: ANN401 - typer's
    """Every command and group below this one, with its words."""
    yield path, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from walk(inner, (*path, name))


def seconds(words: list[str], times: int) -> float:
    """The smallest wall time of a few calls [s]."""
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        subprocess.run([sys.executable, *words], cwd=ROOT, check=True, capture_output=True)
        taken.append(time.perf_counter() - began)
    return min(taken)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="pmgw bench help", description=__doc__)
    parser.add_argument("--times", type=int, default=5, help="calls of each, of which the quickest counts")
    times = parser.parse_args().times
    print(f"{'python -c pass':32} {1e3 * seconds(['-c', 'pass'], times):6.0f} ms")
    print(f"{'python -c import typer':32} {1e3 * seconds(['-c', 'import typer'], times):6.0f} ms")
    for path, _ in walk(typer.main.get_command(app)):
        took = seconds(["-m", "pmg.pipeline", *path, "--help"], times)
        print(f"{' '.join(('pmg', *path, '--help')):32} {1e3 * took:6.0f} ms", flush=True)
    probed = subprocess.run([sys.executable, "-c", PROBE], cwd=ROOT, check=True, capture_output=True, text=True)
    loaded = json.loads(probed.stdout)["heavy"]
    print(f"loaded by all of them together, of {', '.join(HEAVY)}: {', '.join(loaded) or 'none'}")


if __name__ == "__main__":
    main()

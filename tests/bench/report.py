"""`./pmgw bench report`: what a report costs to write, part by part, beside matplotlib drawing the same figures alone.

The report is that of the example that ships, or of a store that has been analysed. Times are processor time of one
process; each part's is without that of the parts listed below it. With ``--run`` the example is first run from
recordings to page as `pmg run` does it, in as many processes as there are cores: time by the clock, stage by stage.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections import defaultdict
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from pmg.pipeline.commands import compare
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.report import draw, write
from pmg.pipeline.settings.chosen import choose
from tests.bench.case import timed
from tests.bench.kill import EXAMPLE
from tests.bench.speed import report

if TYPE_CHECKING:
    from collections.abc import Callable

PARTS: dict[str, str] = {
    "html": "page, without its drawings",
    "draw_all": "figures handed on",
    "of": "figures laid out, and drawn as SVG",
    "themed": "their SVG for the page",
    "dots": "figures as PNG",
    "workbook": "workbook",
    "summary": "summary",
    "write_atomic": "written to disk",
}


STAGES: dict[str, str] = {
    "ingest_chosen": "ingest",
    "run_analyse": "analysis",
    "compare_and_diagnose": "simulation and diagnosis",
    "campaign_page": "page built",
    "draw_all": "figures drawn",
    "html": "page written",
}
"""Stages of a run that are timed -> what they are."""


def run_split(folder: Path) -> None:
    """Print the time that each stage of a run takes by the clock, and the processor time of all processes."""
    spent: defaultdict[str, float] = defaultdict(float)

    def timed_stage(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def stage(*given: Any, **named: Any) -> Any:  # noqa: ANN401 - whatever the function takes
            began = time.perf_counter()
            try:
                return call(*given, **named)
            finally:
                spent[name] += time.perf_counter() - began

        return stage

    chosen = choose(None, recordings=EXAMPLE, store=folder / "run", report=folder / "run-report")
    before, began = sum(os.times()[:4]), time.perf_counter()
    with ExitStack() as patched:
        for name in STAGES:
            room = compare if hasattr(compare, name) and name != "draw_all" else write
            patched.enter_context(patch.object(room, name, timed_stage(name, getattr(room, name))))
        compare.run_all(chosen, None)
    wall = time.perf_counter() - began
    report("run of the example, without its imports", "wall [s]")
    for name, meaning in STAGES.items():
        report(f"  {meaning}", f"{spent[name]:.2f}")
    report("  else", f"{wall - sum(spent.values()):.2f}")
    report("  all of it", f"{wall:.2f}")
    report("  processor time of all processes [s]", f"{sum(os.times()[:4]) - before:.2f}")


class Clock:
    """Processor time by part [s]; what a part asks of another counts for the other alone."""

    def __init__(self) -> None:
        self.spent: defaultdict[str, float] = defaultdict(float)
        self._open: list[str] = []
        self._since = time.process_time()

    def _book(self) -> None:
        now = time.process_time()
        if self._open:
            self.spent[self._open[-1]] += now - self._since
        self._since = now

    def timed(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, its time booked under a name."""

        @wraps(call)
        def booked(*given: Any, **named: Any) -> Any:  # noqa: ANN401 - whatever the function takes
            self._book()
            self._open.append(name)
            try:
                return call(*given, **named)
            finally:
                self._book()
                self._open.pop()

        return booked


def told(store: Path | None, folder: Path) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """What a comparison hands to `write_report`: the report, and whatever goes with it."""
    if store is None:
        store = folder / "store"
        run_ingest(EXAMPLE, store, ALONE)
        run_analyse(store, AnalysisOptions(), grids=None, campaign=None)
    caught: list[tuple[tuple[Any, ...], dict[str, Any]]] = []

    def catch(*given: Any, **named: Any) -> tuple[Path, ...]:  # noqa: ANN401 - whatever the function takes
        caught.append((given, named))
        return write.write_report(*given, **named)

    with patch.object(compare, "write_report", catch):
        compare.run_compare(store, folder / "compared")
    return caught[0]


def main() -> None:
    """Print sizes, times and their split."""
    parser = argparse.ArgumentParser(prog="pmgw bench report", description=__doc__)
    parser.add_argument("--store", type=Path, help="an analysed store; the example that ships when not given")
    parser.add_argument("--repeats", type=int, default=3, help="the quickest of so many counts")
    parser.add_argument("--run", action="store_true", help="run the example too, from recordings to page")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if asked.run:
            run_split(Path(name))
        (page, _, *rest), named = told(asked.store, Path(name))
        report(f"{len(page.figures)} figures, {len(page.tables)} tables", "bytes")
        out = Path(name, "report")
        files = write.write_report(page, out, *rest, **named)
        for kind in (".html", ".png", ".svg", ".csv", ".xlsx", ".json"):
            report(f"  {kind[1:]}", f"{sum(path.stat().st_size for path in files if path.suffix == kind):,}")
        report("", "CPU [s]")
        best: tuple[float, dict[str, float]] | None = None
        for _ in range(asked.repeats):
            clock = Clock()
            with ExitStack() as patched:
                for part in ("html", "draw_all", "workbook", "summary", "write_atomic"):
                    patched.enter_context(patch.object(write, part, clock.timed(part, getattr(write, part))))
                for name, made in (("dots", "_dots"), ("of", "_drawing_of"), ("themed", "themed")):
                    patched.enter_context(patch.object(draw, made, clock.timed(name, getattr(draw, made))))
                whole = timed(lambda: write.write_report(page, out, *rest, **named)).cpu
            if best is None or whole < best[0]:
                best = whole, dict(clock.spent)
        assert best is not None
        report("the report written", f"{best[0]:.2f}")
        for part, meaning in PARTS.items():
            report(f"  {meaning}", f"{best[1].get(part, 0.0):.2f}")
        alone = timed(lambda: [draw.draw_png(figure) for figure in page.figures], asked.repeats).cpu
        report("matplotlib alone, the same figures as PNG", f"{alone:.2f}")
        report("the report over matplotlib alone", f"{best[0] / alone:.2f}")


if __name__ == "__main__":
    main()

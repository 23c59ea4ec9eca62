"""`./pmgw bench report`: what a report costs to write, part by part, beside matplotlib drawing the same figures alone.

The report is that of the example that ships, or of a store that has been analysed. Times are processor time of one
process; each part's is without that of the parts listed below it.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import defaultdict
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from matplotlib.backends.backend_pdf import PdfPages

from pmg.pipeline.commands import compare
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.report import draw, write
from tests.bench.case import timed
from tests.bench.kill import EXAMPLE
from tests.bench.speed import report

if TYPE_CHECKING:
    from collections.abc import Callable

PARTS: dict[str, str] = {
    "html": "page, without its drawings",
    "draw_all": "captions, and the end of the PDF",
    "of": "figures laid out, and drawn as SVG",
    "themed": "their SVG for the page",
    "dots": "figures as PNG",
    "pdf": "figures as PDF, but for its end",
    "workbook": "workbook",
    "summary": "summary",
    "write_aside": "written to disk",
}


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
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        (page, _, *rest), named = told(asked.store, Path(name))
        report(f"{len(page.figures)} figures, {len(page.tables)} tables", "bytes")
        out = Path(name, "report")
        files = write.write_report(page, out, *rest, **named)
        for kind in (".html", ".png", ".svg", ".csv", ".pdf", ".xlsx", ".json"):
            report(f"  {kind[1:]}", f"{sum(path.stat().st_size for path in files if path.suffix == kind):,}")
        report("", "CPU [s]")
        best: tuple[float, dict[str, float]] | None = None
        for _ in range(asked.repeats):
            clock = Clock()
            with ExitStack() as patched:
                for part in ("html", "draw_all", "workbook", "summary", "write_aside"):
                    patched.enter_context(patch.object(write, part, clock.timed(part, getattr(write, part))))
                for name, made in (("dots", "_dots"), ("of", "_drawing_of"), ("themed", "themed")):
                    patched.enter_context(patch.object(draw, made, clock.timed(name, getattr(draw, made))))
                patched.enter_context(patch.object(PdfPages, "savefig", clock.timed("pdf", PdfPages.savefig)))
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

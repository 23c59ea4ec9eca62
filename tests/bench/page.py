"""`./pmgw bench page REPORT...`: what a page asks of its reader, in a headless browser.

Screens of 1366 x 768, sheets of A4 in print, bytes, the time until the page stands and until its first figure can be
used (each the smallest of a few fresh browsers), what axe objects to in light and in dark, what the browser asked for
besides the page, and the length of each chapter.
"""

from __future__ import annotations

import argparse
import base64
import re
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.bench.kill import ROOT
from tests.bench.speed import report
from tests.report import chromium

SCREEN = (1366, 768)
"""Screen of a bench PC [pixels]."""
A4 = (8.27, 11.69)
"""Paper [in]."""
SHEET = re.compile(rb"/Type\s*/Page\b(?!s)")
LIVE = "document.querySelector('figure.drawn.alive') !== null"
CHAPTERS = """[...document.querySelectorAll('main > header, main > section')].map(part =>
  [part.querySelector('h1, h2').textContent.trim(), part.getBoundingClientRect().height / innerHeight])"""

CUT = """(document.querySelectorAll('tbody').forEach(body => [...body.rows].slice(8).forEach(row => row.remove())),
  document.querySelectorAll('.drawing > *').forEach(part => part.remove()), 1)"""
"""Rows beyond the eighth of each table, which are like the first, and lines of still drawings: axe takes minutes over
them."""


def sized(tab: chromium.Tab, *, dark: bool = False) -> None:
    """The window as large as the screen, in a colour scheme."""
    width, height = SCREEN
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    tab.call("Emulation.setEmulatedMedia", features=[scheme])


def paper(tab: chromium.Tab) -> bytes:
    """The page printed, as PDF."""
    width, height = A4
    printed = tab.call(
        "Page.printToPDF", preferCSSPageSize=True, printBackground=False, paperWidth=width, paperHeight=height
    )
    return base64.b64decode(printed["data"])


def shot(tab: chromium.Tab) -> bytes:
    """What the window shows, as PNG."""
    return base64.b64decode(tab.call("Page.captureScreenshot", format="png")["data"])


def opened(page: Path) -> tuple[float, float]:
    """Time from the address to the end of loading, and to the first figure that can be used, in a fresh browser [s]."""
    with tempfile.TemporaryDirectory() as profile, chromium.tab(Path(profile)) as tab:
        sized(tab)
        began = time.perf_counter()
        tab.open(page)
        loaded = time.perf_counter() - began
        tab.wait(LIVE, 60.0)
        return loaded, time.perf_counter() - began


def measured(page: Path, out: Path | None, *, axe: bool) -> dict[str, Any]:
    """Everything but the times; with a folder, the PDF and the first screen in both schemes are left there."""
    with tempfile.TemporaryDirectory() as profile, chromium.tab(Path(profile)) as tab:
        sized(tab)
        tab.open(page)
        tab.wait(LIVE, 60.0)
        found: dict[str, Any] = {
            "screens": tab.ask("document.documentElement.scrollHeight / innerHeight"),
            "sheet": tab.ask("document.getElementById('verdict').getBoundingClientRect().bottom + scrollY"),
            "chapters": tab.ask(CHAPTERS),
        }
        printed = paper(tab)
        found["sheets"] = len(SHEET.findall(printed))
        shots = {}
        for name, dark in (("light", False), ("dark", True)):
            sized(tab, dark=dark)
            time.sleep(0.5)  # the figures follow the colours
            shots[name] = shot(tab)
            if axe:
                tab.ask(CUT)
                found[f"axe, {name}"] = tab.objections()
        found["requests"] = len(tab.fetched() - {page.as_uri()})
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            (out / f"{page.parent.name}.pdf").write_bytes(printed)
            for name, picture in shots.items():
                (out / f"{page.parent.name}-{name}.png").write_bytes(picture)
    return found


def main() -> None:
    """Print the table of each page."""
    parser = argparse.ArgumentParser(prog="pmgw bench page", description=__doc__)
    parser.add_argument("reports", nargs="*", type=Path, help="folders of reports; that of the example when not given")
    parser.add_argument("--repeats", type=int, default=3, help="the quickest of so many loads")
    parser.add_argument("--axe", action="store_true", help="ask axe too, about eight rows of each table")
    parser.add_argument("--out", type=Path, help="leave the printed page and screenshots in this folder")
    asked = parser.parse_args()
    for folder in asked.reports or [ROOT / "reports" / "example"]:
        page = folder.resolve() / "report.html"
        found = measured(page, asked.out, axe=asked.axe)
        times = [opened(page) for _ in range(asked.repeats)]
        report(f"{folder}", "")
        report("  screens of 1366 x 768", f"{found['screens']:.1f}")
        report("  head with its sheet ends at [screens]", f"{found['sheet'] / SCREEN[1]:.2f}")
        report("  sheets of A4", f"{found['sheets']}")
        report("  bytes of the page", f"{page.stat().st_size:,}")
        report("  loaded [s]", f"{min(load for load, _ in times):.2f}")
        report("  first figure [s]", f"{min(first for _, first in times):.2f}")
        for name in ("axe, light", "axe, dark", "requests"):
            if name in found:
                said = found[name]
                report(f"  {name}", f"{said if isinstance(said, int) else len(said)}")
                for one in [] if isinstance(said, int) else said:
                    report(f"    {one}", "")
        for name, screens in found["chapters"]:
            report(f"    {' '.join(name.split())[:40]}", f"{screens:.1f}")


if __name__ == "__main__":
    main()

"""`./pmgw api`: the docstrings of every module as pages of HTML, by pdoc, in reports/api.

Formulas are set by MathJax, which the browser fetches; without a network they stand as TeX.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

from pdoc import render
from pdoc.doc import Module

from tests.conftest import ROOT

ROOMS = ("sim", "pipeline")
ENTRY = "pmg.pipeline.__main__"
OUT = ROOT / "reports" / "api"
UNREAD = "Error parsing type annotation"
"""Begin of the one warning that is left out: names that are imported for type checkers alone stay without a link."""


def modules() -> list[str]:
    """Names of all modules, those too that a package does not list in its ``__all__``."""
    found = set()
    for room in ROOMS:
        for path in (ROOT / room).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found.add(".".join(("pmg", *(part for part in parts if part != "__init__"))))
    return sorted(found - {ENTRY})


def build(out: Path, names: list[str]) -> tuple[str, ...]:
    """Write a page of each module, an index and what its search looks through; what pdoc warned of."""
    render.configure(docformat="numpy", math=True, show_source=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pages = {name: Module.from_name(name) for name in names}
        for name, module in pages.items():
            _write(out / Path(*name.split(".")).with_suffix(".html"), render.html_module(module, pages))
        _write(out / "index.html", render.html_index(pages))
        _write(out / "search.js", render.search_index(pages))
    told = (str(warning.message) for warning in caught)
    return tuple(message for message in told if not message.startswith(UNREAD))


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def main() -> None:
    """Build all pages; exit code 1 where pdoc warned."""
    parser = argparse.ArgumentParser(prog="pmgw api", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the pages")
    out = parser.parse_args().out
    names = modules()
    told = build(out, names)
    for message in told:
        print(f"pmgw api: {message}", file=sys.stderr)
    print(f"{len(names)} modules: {out / 'index.html'}")
    sys.exit(1 if told else 0)


if __name__ == "__main__":
    main()

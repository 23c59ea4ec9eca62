"""The figures as files of their own, and what a folder holds once a report has been written over another."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest

from pmg.pipeline.report.document import Figure, Report, Section, Text
from pmg.pipeline.report.draw import Drawings, draw_all, draw_png
from pmg.pipeline.report.theme import LIGHT
from pmg.pipeline.report.write import report_files, write_report

from . import example

if TYPE_CHECKING:
    from pathlib import Path

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = '</desc><script>alert("x")</script> & --> ]]> \udcff \x00'


@cache
def drawn() -> Drawings:
    return draw_all(example.report().figures)


def flow(caption: str = "A third of the supply is lost.") -> Figure:
    return Figure("flow", "Power flow", caption, (example.power_flow(),))


def without_figures(*items: Text | Figure) -> Report:
    return replace(example.report(), sections=(Section("one", "One", items),))


def test_the_same_figures_give_the_same_files_alone_and_together() -> None:
    first, second = flow(), Figure("chart", "Chart", "It rises.", (example.chart(),))
    made = draw_all((first, second))
    assert draw_all((first, second)) == made
    alone = draw_all((first,)).files
    assert alone == {name: made.files[name] for name in ("figures/flow.png", "figures/flow.svg")}
    assert draw_png(second) == made.files["figures/chart.png"]
    assert example.draw_svg(second) == made.inline["chart"]
    assert draw_all(()) == Drawings({}, {}, {})


@pytest.mark.parametrize("name", ["efficiency", "flow", "map"])
def test_an_svg_stands_alone(name: str) -> None:
    svg = drawn().files[f"figures/{name}.svg"].decode()
    root = ElementTree.fromstring(svg)
    figure = next(figure for figure in example.report().figures if figure.id == name)
    assert root.get("role") == "img"
    assert root.get("width")
    assert (root[0].tag, root[0].text) == (f"{SVG}title", figure.title)
    assert (root[1].tag, root[1].text) == (f"{SVG}desc", figure.caption)
    assert list(root.iter(f"{SVG}text"))
    assert "var(--" not in svg
    assert "DOCTYPE" not in svg
    assert "Date" not in svg
    assert LIGHT["paper"] in svg
    assert "'DejaVu Sans', Verdana, sans-serif" in svg
    names = [value for element in root.iter() for key, value in element.attrib.items() if key == "id"]
    assert len(names) == len(set(names))
    targets = [value for element in root.iter() for key, value in element.attrib.items() if key.endswith("href")]
    assert all(re.match("#|data:image/png;base64,", value) for value in targets)


def test_hostile_captions_stay_text() -> None:
    figure = replace(flow(HOSTILE), title=HOSTILE)
    made = draw_all((figure,))
    root = ElementTree.fromstring(made.files["figures/flow.svg"].decode())
    assert root[1].text == HOSTILE.replace("\udcff", "\\udcff").replace("\x00", "\\u0000")
    assert not list(root.iter(f"{SVG}script"))


def test_what_an_earlier_report_left_beside_its_page_is_removed(tmp_path: Path) -> None:
    write_report(without_figures(flow()), tmp_path)
    (tmp_path / "figures.pdf").write_bytes(b"of an earlier version")
    listing = tmp_path / "report-files.json"
    listing.write_text(json.dumps({"files": ["figures.pdf", *json.loads(listing.read_text())["files"]]}))
    (tmp_path / "figures/mine.svg").write_text("kept", encoding="utf-8")
    report = without_figures(Text("x"))
    written = write_report(report, tmp_path, summed_up=False)
    names = tuple(path.relative_to(tmp_path).as_posix() for path in written)
    assert names == report_files(report, summed_up=False) == ("report.html", "report.xlsx", "report-files.json")
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {*names, "figures/mine.svg"}
    assert json.loads((tmp_path / "report-files.json").read_text())["files"] == ["report.html", "report.xlsx"]


def test_a_summary_of_the_callers_own_is_neither_written_over_nor_removed(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("mine", encoding="utf-8")
    for _ in range(2):
        write_report(without_figures(Text("x")), tmp_path, summed_up=False)
    assert (tmp_path / "summary.json").read_text(encoding="utf-8") == "mine"

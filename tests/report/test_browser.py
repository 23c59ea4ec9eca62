"""The page in a browser that runs no scripts: still drawings, nothing fetched, nothing off the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from pmg.pipeline.report.write import write_report

from . import chromium, example

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = chromium.NEEDED

OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
BACKGROUND = "getComputedStyle(document.body).backgroundColor"
LETTERING = "getComputedStyle(document.querySelector('svg.drawing text')).fill"
LABELS_OUTSIDE = """
Array.from(document.querySelectorAll('svg.drawing')).filter(svg => svg.getClientRects().length).flatMap(svg => {
  const paper = svg.getBoundingClientRect();
  return Array.from(svg.querySelectorAll('text')).filter(text => {
    const box = text.getBoundingClientRect();
    return box.left < paper.left - 1 || box.right > paper.right + 1
        || box.top < paper.top - 1 || box.bottom > paper.bottom + 1;
  }).map(text => text.textContent);
})
"""
LABELS_ON_EACH_OTHER = """
Array.from(document.querySelectorAll('svg.drawing')).filter(svg => svg.getClientRects().length).flatMap(svg => {
  const boxes = Array.from(svg.querySelectorAll('text')).map(text => [text.textContent, text.getBoundingClientRect()]);
  return boxes.flatMap(([name, a], index) => boxes.slice(index + 1)
    .filter(([, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1.5
                    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4)
    .map(([other]) => name + ' / ' + other));
})
"""
BROKEN_ANCHORS = """
Array.from(document.querySelectorAll('a[href^="#"]')).map(a => a.hash.slice(1))
  .filter(id => !document.getElementById(id))
"""
REPEATED_IDS = """
(() => { const ids = Array.from(document.querySelectorAll('[id]')).map(e => e.id);
         return ids.filter((id, index) => ids.indexOf(id) !== index); })()
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_report(example.report(), folder)
    return folder


@pytest.fixture(scope="module")
def tab(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[chromium.Tab]:
    with chromium.tab(tmp_path_factory.mktemp("profile")) as tab:
        tab.still()
        tab.open(folder / "report.html")
        yield tab


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_does_not_scroll_sideways(tab: chromium.Tab, width: int) -> None:
    tab.show(width)
    assert tab.ask("innerWidth") == width
    assert tab.ask(OVERFLOW) <= 0


@pytest.mark.parametrize("width", [1280, 390])
def test_labels_stay_inside_their_figure_and_off_each_other(tab: chromium.Tab, width: int) -> None:
    tab.show(width)
    assert tab.ask(LABELS_OUTSIDE) == []
    assert tab.ask(LABELS_ON_EACH_OTHER) == []


def test_dark_mode_changes_page_and_drawings(tab: chromium.Tab) -> None:
    tab.show(1280)
    light = (tab.ask(BACKGROUND), tab.ask(LETTERING))
    tab.show(1280, dark=True)
    dark = (tab.ask(BACKGROUND), tab.ask(LETTERING))
    assert light == ("rgb(255, 255, 255)", "rgb(26, 31, 36)")
    assert dark == ("rgb(21, 25, 29)", "rgb(227, 231, 235)")


def test_a_long_table_scrolls_in_its_own_box_under_its_header(tab: chromium.Tab) -> None:
    tab.show(1280)
    box = "document.querySelector('.long .scroll')"
    assert tab.ask(f"{box}.scrollHeight > 2 * {box}.clientHeight")
    tab.ask(f"{box}.scrollTop = 900")
    offset = f"{box}.querySelector('th').getBoundingClientRect().top - {box}.getBoundingClientRect().top"
    assert abs(tab.ask(offset)) < 3


def test_identifiers_are_unique_and_anchors_lead_somewhere(tab: chromium.Tab) -> None:
    assert tab.ask(REPEATED_IDS) == []
    assert tab.ask(BROKEN_ANCHORS) == []


def test_nothing_was_fetched_and_nothing_reported(tab: chromium.Tab, folder: Path) -> None:
    assert tab.fetched() == {(folder / "report.html").as_uri()}
    assert tab.noise() == []

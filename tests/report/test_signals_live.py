"""The signals behind a point, in a browser: opened by mouse, by keyboard and by address, drawn as they were packed."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.slow import slow

from pmg.pipeline.point_signals.cell import Bins, BudgetRow, CellSignals, ChannelSignals, ShaftRows, Spectrum
from pmg.pipeline.point_signals.encoded import encode
from pmg.pipeline.report.document import Figure, Section, Signals
from pmg.pipeline.report.write import write_report
from pmg.sim import signals

from . import chromium, example
from .controls import press_all

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pmg.pipeline.report.document import Report

pytestmark = chromium.NEEDED

OPEN = "document.getElementById('signals').open"
SHOWN = "document.getElementById('signals').dataset.point"
POINTS = 4
HOSTILE = "<a href='https://example.org'>P</a></script><script>alert(1)</script>"


def cell(row: int) -> CellSignals:
    """A made-up point: two torques with a margin on both sides, two speeds; the third was rejected."""
    bins = Bins((-0.5, 0.0, 4.0, 4.5), (5, 40, 5))
    wave = np.sin(np.arange(50) / 3.0) + row
    spectrum = Spectrum(np.geomspace(0.5, 200.0, 60), np.geomspace(1e-2, 1e-4, 60), 0.25)
    channels = []
    for signal in (signals.TORQUE_SUN, signals.TORQUE_RING, signals.SPEED_SUN, signals.SPEED_RING):
        torque = signal.unit == "N m"
        channels.append(
            ChannelSignals(
                signal,
                bins,
                wave - 0.2 * torque,
                wave + 0.2 * torque,
                np.full(12, float(row)),
                (0.0, 4.0),
                float(row),
                0.01,
                0.02,
                1e-3,
                spectrum if torque else None,
            )
        )
    shafts = tuple(
        ShaftRows(
            side,
            float(row),
            (BudgetRow("scatter", "scatter within the window", "A", "t", False, 1e-3, 9.0, ""),),
            1e-3,
            0.0,
            1e-3,
            9.0,
            2.26,
            2.26e-3,
        )
        for side in ("sun", "ring")
    )
    accepted = row != 2
    reasons = () if accepted else ("speed drifts",)
    return CellSignals(
        row, f"P_{row}", accepted, reasons, (), (20.0, 8.0), shafts, f"{row}.mcap", 1e3, 500, 4500, tuple(channels)
    )


def opening() -> Report:
    """The example, its map with points behind the first cells of its second row."""
    grid = example.speed_map()
    names = [["" for _ in grid.x] for _ in grid.y]
    names[1][:POINTS] = [f"P_{row}" for row in range(POINTS)]
    panel = replace(grid, points=tuple(map(tuple, names)))
    figure = Figure("opening", "Map of points", "Cells open.", (panel,))
    cells = [cell(row) for row in range(POINTS)]
    packed = encode([*cells, replace(cell(4), point="P_3"), replace(cell(5), point=HOSTILE)])
    report = example.report()
    return replace(
        report,
        sections=(*report.sections, Section("last", "Points", (figure,))),
        signals=Signals(packed.index_json, packed.base64),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_report(opening(), folder)
    return folder


@pytest.fixture
def tab(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[chromium.Tab]:
    with chromium.tab(tmp_path_factory.mktemp("profile")) as tab:
        tab.show(1280)
        tab.open(folder / "report.html")
        tab.ask("(document.getElementById('opening').scrollIntoView(), 1)")
        tab.wait("document.getElementById('opening').dataset.drawn === 'yes'")
        yield tab
        assert tab.noise() == []


def drawn(tab: chromium.Tab, point: str) -> None:
    tab.wait(f"{SHOWN} === {json.dumps(point)} && document.querySelectorAll('#signals table').length === 3")


def test_no_control_of_the_page_or_of_an_open_point_sends_anything(folder: Path, tmp_path: Path) -> None:
    pressed = press_all(folder / "report.html", tmp_path / "profile", "P_1")
    assert ("button", "Close") in pressed
    assert "select" in {kind for kind, _ in pressed}


def test_a_click_on_a_cell_draws_its_signals(tab: chromium.Tab) -> None:
    place = tab.ask(
        "(() => { const plot = document.querySelector('#opening .plot'), box = plot.getBoundingClientRect(),"
        " {xaxis, yaxis} = plot._fullLayout;"
        " return {x: box.x + xaxis._offset + xaxis.c2p(100), y: box.y + yaxis._offset + yaxis.c2p(50)}; })()"
    )
    tab.click(place["x"], place["y"])
    drawn(tab, "P_1")
    assert tab.ask("location.hash") == "#point=P_1"
    traces = "document.querySelector('.signals-time').data"
    low = tab.ask(f"{traces}.find(t => t.name === 'least').y")
    assert np.allclose(low, np.sin(np.arange(50) / 3.0) + 0.8, atol=1e-4)
    assert tab.ask(f"{traces}.find(t => t.name === 'after the filter').y") == pytest.approx([1.0] * 12)
    windows = tab.ask("document.querySelector('.signals-time').layout.shapes.map(s => [s.x0, s.x1])")
    assert windows == [[0, 4]] * 4
    spectrum = tab.ask("document.querySelector('.signals-spectrum').data.length")
    assert spectrum == 2


def test_a_cell_can_be_reached_by_keyboard_alone_and_left_again(tab: chromium.Tab) -> None:
    tab.ask("(document.querySelector('#efficiency').scrollIntoView(), 1)")
    for _ in range(200):
        tab.press("Tab")
        if tab.ask("document.activeElement.closest('#opening') !== null && document.activeElement.matches('.plot')"):
            break
    assert "Enter opens the signals" in tab.ask("document.activeElement.getAttribute('aria-label')")
    for key in ("ArrowUp", "ArrowRight", "ArrowRight", "Enter"):
        tab.press(key)
    drawn(tab, "P_2")
    assert "rejected: speed drifts" in tab.ask("document.querySelector('#signals dl').textContent")
    tab.ask("(document.querySelector('#signals .close').click(), 1)")
    tab.wait(f"!{OPEN}")
    assert tab.ask("document.activeElement.closest('#opening') !== null")
    assert tab.ask("location.hash") == ""


def test_an_address_opens_its_point_and_the_list_leads_on(tab: chromium.Tab, folder: Path) -> None:
    tab.ask("(location.hash = '#point=P_3', 1)")
    drawn(tab, "P_3")
    tab.ask("(document.querySelector('#signals .before').click(), 1)")
    drawn(tab, "P_2")
    tab.ask("(document.querySelector('#signals .after').click(), 1)")
    drawn(tab, "P_3")


def test_the_list_goes_round(tab: chromium.Tab) -> None:
    tab.ask("(location.hash = '#point=P_0', 1)")
    drawn(tab, "P_0")
    tab.ask("(document.querySelector('#signals .before').click(), 1)")
    drawn(tab, HOSTILE)
    tab.ask("(document.querySelector('#signals .after').click(), 1)")
    drawn(tab, "P_0")


@pytest.mark.parametrize("name", ["nobody", "%", "%3Cimg src=x onerror=alert(1)%3E"])
def test_an_address_of_no_point_says_so_and_leads_on(tab: chromium.Tab, name: str) -> None:
    tab.ask(f"(location.hash = '#point={name}', 1)")
    tab.wait(OPEN)
    assert "no signals of a point named" in tab.ask("document.querySelector('#signals .lacking').textContent")
    assert tab.ask("document.querySelector('#signals .body').querySelector('img') === null")
    tab.ask("(document.querySelector('#signals .before').click(), 1)")
    drawn(tab, "P_3 (2)")


def test_points_of_one_name_are_each_reached(tab: chromium.Tab) -> None:
    tab.ask("(location.hash = '#point=P_3', 1)")
    drawn(tab, "P_3")
    tab.ask("(document.querySelector('#signals .after').click(), 1)")
    drawn(tab, "P_3 (2)")
    assert "4.mcap" in tab.ask("document.querySelector('#signals dl').textContent")
    tab.ask("(document.querySelector('#signals .before').click(), 1)")
    drawn(tab, "P_3")


def test_a_mean_is_told_to_the_digits_of_its_uncertainty(tab: chromium.Tab) -> None:
    tab.ask("(location.hash = '#point=P_1', 1)")
    drawn(tab, "P_1")
    assert "Mean sun torque1.000 ± 0.020 (95 %) N m" in tab.ask("document.querySelector('#signals dl').textContent")


@pytest.mark.parametrize("dark", [pytest.param(False, marks=slow), True])
def test_axe_finds_nothing_to_object_to_in_an_open_point(tab: chromium.Tab, *, dark: bool) -> None:
    tab.show(1280, dark=dark)
    tab.ask("(location.hash = '#point=P_0', 1)")
    drawn(tab, "P_0")
    assert tab.objections() == []


def test_the_list_is_sorted_and_searched(tab: chromium.Tab) -> None:
    tab.ask("(location.hash = '#point=P_3', 1)")
    drawn(tab, "P_3")
    listed = "[...document.querySelectorAll('#signals .bar select option')].map(o => o.value)"
    assert tab.ask(listed) == [HOSTILE, "P_0", "P_1", "P_2", "P_3", "P_3 (2)"]
    field = "document.querySelector('#signals input[type=search]')"
    tab.ask(f"({field}.value = 'p_1', {field}.dispatchEvent(new Event('input')), 1)")
    assert tab.ask(listed) == ["P_1", "P_3"]  # what is found, and what is shown
    tab.ask(f"({field}.focus(), 1)")
    tab.press("Enter")
    drawn(tab, "P_1")


def test_what_lies_between_two_cursors_is_counted(tab: chromium.Tab) -> None:
    tab.ask("(location.hash = '#point=P_1', 1)")
    drawn(tab, "P_1")
    body = "document.querySelectorAll('#signals .cursors + div tbody tr')"
    rows = f"[...{body}].map(row => [...row.cells].map(cell => cell.textContent))"
    wave = np.sin(np.arange(50) / 3.0) + 1.0
    whole = wave[5:45]
    name, _, mean, least, largest, bins = tab.ask(rows)[0]
    assert (name, bins) == (signals.TORQUE_SUN.meaning, "40")
    told = [float(text.replace("−", "-")) for text in (mean, least, largest)]
    expected = [whole.mean(), whole.min() - 0.2, whole.max() + 0.2]
    assert told == pytest.approx(expected, abs=2e-3)
    cursor = "document.querySelectorAll('#signals .cursors input')[1]"
    tab.ask(f"({cursor}.value = 1, {cursor}.dispatchEvent(new Event('input')), 1)")
    assert tab.ask(rows)[0][-1] == "10"

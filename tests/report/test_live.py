"""The page in a browser with its scripts: drawn without the network, by mouse and keyboard, without a fault for axe."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from tests.slow import slow

from pmg.pipeline.report import live_chart, live_map
from pmg.pipeline.report.document import Chart, Column, Figure, PowerFlow, Section, Series, SpeedMap, Table
from pmg.pipeline.report.live import live_json
from pmg.pipeline.report.write import write_report

from . import chromium, example
from .controls import drawn

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = chromium.NEEDED

TRACES = "document.querySelector('#efficiency .plot').data"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_report(example.report(), folder)
    return folder


@pytest.fixture(scope="module")
def tab(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[chromium.Tab]:
    with chromium.tab(tmp_path_factory.mktemp("profile")) as tab:
        tab.show(1280)
        tab.open(folder / "report.html")
        drawn(tab)
        yield tab


def test_every_figure_is_drawn_in_place_of_its_still_drawing(tab: chromium.Tab) -> None:
    stills = "Array.from(document.querySelectorAll('.still')).filter(e => e.getClientRects().length).length"
    assert tab.ask(stills) == 0
    assert tab.ask("document.querySelectorAll('.plot .main-svg').length") >= 5


@pytest.mark.parametrize("width", [1280, 390])
def test_the_drawn_page_does_not_scroll_sideways(tab: chromium.Tab, width: int) -> None:
    tab.show(width)
    tab.wait("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    tab.show(1280)


def test_a_name_in_the_legend_switches_both_of_its_series(tab: chromium.Tab) -> None:
    shown = f"{TRACES}.filter(t => t.name === '500 rpm').map(t => t.visible ?? true)"
    assert tab.ask(shown) == [True, True]
    tab.ask("document.querySelector('#efficiency').scrollIntoView()")
    box: dict[str, Any] = tab.ask(
        "(() => { const entry = [...document.querySelectorAll('#efficiency .legendtoggle')][1];"
        " const box = entry.getBoundingClientRect(); return {x: box.x + box.width / 2, y: box.y + box.height / 2}; })()"
    )
    tab.click(box["x"], box["y"])
    tab.wait(f"{shown}.every(v => v === 'legendonly')")
    assert tab.ask(f"{TRACES}.filter(t => t.name !== '500 rpm').every(t => (t.visible ?? true) === true)")


COVERING = """[...document.querySelectorAll('#flow .plot')].flatMap(plot => {
  const boxes = what => [...plot.querySelectorAll(what)].map(one => [one.textContent, one.getBoundingClientRect()]);
  const labels = boxes('.annotation-text');
  return labels.flatMap(([a, p], at) => [...labels.slice(at + 1), ...boxes('.shapelayer path')].filter(([, q]) =>
    Math.min(p.right, q.right) - Math.max(p.left, q.left) > 2 &&
    Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 4).map(([b]) => a + ' / ' + (b || 'an area'))); })"""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("width", [1280, 1000, 800, 390])
def test_no_label_of_a_power_flow_covers_another_or_an_area(tmp_path: Path, width: int, sign: float) -> None:
    stages = (("electric supply", 247.8), ("into the gearbox", 207.3), ("out of the gearbox", 147.6))
    losses = (("sun bearings", 25.1, 1), ("magnetic gear", 13.8, 1), ("ring bearings", 18.3, 1))
    flow = PowerFlow(
        "",
        tuple((name, sign * watts) for name, watts in (*stages, ("useful electric power", 137.3))),
        (("driving motor", sign * 40.5, 0), *losses, ("unexplained", sign * 59.7 - 57.2, 1), ("motor", sign * 10.3, 2)),
        (1.3,) * 10,
    )
    figure = Figure("flow", "Power flow", "All of it.", (flow,))
    write_report(replace(example.report(), sections=(Section("only", "Only", (figure,)),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(width)
        tab.open(tmp_path / "report.html")
        drawn(tab)
        assert tab.ask("document.querySelectorAll('#flow .annotation-text').length") >= 10
        assert tab.ask(COVERING) == []


def test_labels_of_a_flow_that_nearly_stops_keep_apart(tmp_path: Path) -> None:
    """Both motors feed the losses of such a point: its columns are narrow at the end."""
    stages = (("electric supply", 47.33), ("into the gearbox", 43.69), ("out of the gearbox", 16.19))
    losses = (("ring bearings", 10.02, 1), ("magnetic gear", 3.7, 1), ("sun bearings", 10.16, 1))
    more = (("relative bearing", 3.82, 1), ("unexplained", -0.2, 1), ("loading motor", 17.08, 2))
    flow = PowerFlow(
        "",
        (*stages, ("useful electric power", -0.89)),
        (("driving motor", 3.637, 0), *losses, *more),
        (0.64, 0.61, 0.81, 0.81, 0.029, 0.87, 2.0, 0.90, 0.32, 1.6, 0.00011),
    )
    figure = Figure("flow", "Power flow", "All of it.", (flow,))
    write_report(replace(example.report(), sections=(Section("only", "Only", (figure,)),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(1366)
        tab.open(tmp_path / "report.html")
        drawn(tab)
        assert tab.ask(COVERING) == []


def test_figures_follow_the_colours_of_the_page(tab: chromium.Tab) -> None:
    ink = "getComputedStyle(document.querySelector('#efficiency .plot .xtick text')).fill"
    tab.ask("document.querySelector('#efficiency').scrollIntoView()")
    assert tab.ask(ink) == "rgb(26, 31, 36)"
    tab.show(1280, dark=True)
    tab.wait(f"{ink} === 'rgb(227, 231, 235)'")
    tab.ask("(document.getElementById('scheme').click(), 1)")  # as the system -> light
    tab.wait(f"{ink} === 'rgb(26, 31, 36)'")
    tab.ask("(document.getElementById('scheme').click(), document.getElementById('scheme').click(), 1)")
    tab.show(1280)
    tab.wait(f"{ink} === 'rgb(26, 31, 36)'")


def test_arrow_keys_walk_over_a_map_and_say_where(tab: chromium.Tab) -> None:
    tab.ask("(document.querySelector('#map .plot').focus(), 1)")
    said = "document.getElementById('announced').textContent"
    assert tab.ask(said) == "sun speed [rpm] 50, ring speed [rpm] 25: not measured"
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowUp", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"):
        tab.press(key)
    z = example.speed_map().z
    assert tab.ask(said) == f"sun speed [rpm] 200, ring speed [rpm] 50: {z[1, 3]:.4g}".replace("-", "−")


def test_a_table_sorts_by_its_numbers_and_back(tab: chromium.Tab) -> None:
    column = "[...document.querySelectorAll('#points tbody tr')].map(row => row.cells[1].textContent)"
    head = "document.querySelectorAll('#points th')[1]"
    given = tab.ask(column)
    tab.ask(f"({head}.querySelector('button').click(), {head}.querySelector('button').click(), 1)")
    falling = [float(text.split(" ")[0].rstrip("†")) for text in tab.ask(column)]
    assert falling == sorted(falling, reverse=True)
    assert tab.ask(f"{head}.getAttribute('aria-sort')") == "descending"
    tab.ask(f"({head}.querySelector('button').click(), 1)")
    assert tab.ask(column) == given


def test_a_table_keeps_the_rows_that_are_searched_and_within_a_bound(tab: chromium.Tab) -> None:
    rows = "[...document.querySelectorAll('#points tbody tr:not([hidden])')].map(row => row.cells[0].textContent)"
    field, bound = (f"document.querySelector('#points .filter {kind}')" for kind in ("input[type=search]", ".bound"))

    def put(where: str, text: str) -> None:
        tab.ask(f"({where}.value = '{text}', {where}.dispatchEvent(new Event('input', {{bubbles: true}})), 1)")

    put(field, "g1-01 window")
    assert tab.ask(rows) == [f"g1-{k:03d}" for k in range(10, 20)]
    put(bound, ">= 40")
    assert tab.ask(rows) == [f"g1-{k:03d}" for k in range(17, 20)]  # 20 + 17 * 1.2345 = 40.99; of 14 none is stated
    put(bound, "")
    put(field, "")
    assert len(tab.ask(rows)) == 120


def test_a_table_downloads_what_its_file_holds(tab: chromium.Tab, folder: Path) -> None:
    text = tab.ask("pmg.text(document.getElementById('points-csv').textContent)")
    assert text == (folder / "tables" / "points.csv").read_text(encoding="utf-8")


@pytest.mark.parametrize("dark", [pytest.param(False, marks=slow), True])
def test_axe_finds_nothing_to_object_to(tab: chromium.Tab, *, dark: bool) -> None:
    tab.show(1280, dark=dark)
    found = tab.objections()
    tab.show(1280)
    assert found == []


def test_nothing_was_fetched_and_nothing_reported(tab: chromium.Tab, folder: Path) -> None:
    assert tab.fetched() == {(folder / "report.html").as_uri()}
    assert tab.noise() == []


def test_a_browser_that_cannot_unpack_keeps_still_drawings_and_links_to_files(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with chromium.tab(tmp_path_factory.mktemp("old")) as old:
        old.call("Page.addScriptToEvaluateOnNewDocument", source="delete window.DecompressionStream")
        old.show(1280)
        old.open(folder / "report.html")
        assert old.ask("document.querySelector('#efficiency .still').getClientRects().length") == 1
        followed = (
            "new Promise(done => { addEventListener('click', event => { done(!event.defaultPrevented);"
            " event.preventDefault(); }); document.querySelector('a.csv').click(); })"
        )
        assert old.ask(followed) is True
        assert old.noise() == []


def test_what_hovers_over_a_point_is_its_name_letter_by_letter(tmp_path: Path) -> None:
    name = "<a href='https://example.org'>P</a>&%{x}$1$"
    series = Series("measured", np.array([1.0]), np.array([2.0]), None, "markers", points=(name,))
    figure = Figure("one", "One point", "It stands alone.", (Chart("x", "y", (series,)),))
    write_report(replace(example.report(), sections=(Section("only", "Only", (figure,)),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(1280)
        tab.open(tmp_path / "report.html")
        drawn(tab)
        tab.ask("(Plotly.Fx.hover(document.querySelector('#one .plot'), [{curveNumber: 0, pointNumber: 0}]), 1)")
        told = tab.wait("document.querySelector('#one .hoverlayer text')?.textContent")
        assert name in told
        assert tab.ask("document.querySelector('#one .hoverlayer a') === null")


def over(label: str) -> Chart:
    x = np.linspace(0.0, 10.0, 21)
    return Chart(label, "y", (Series("", x, np.sin(x), None, "line"),))


def test_a_time_under_the_pointer_is_told_in_every_plot_over_that_time(tmp_path: Path) -> None:
    labels = {"a": "time [s]", "b": "time [s]", "c": "time of the test [h]", "d": "speed [rpm]"}
    figures = tuple(Figure(name, name, "Swings.", (over(label),)) for name, label in labels.items())
    write_report(replace(example.report(), sections=(Section("only", "Only", figures),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Emulation.setDeviceMetricsOverride", width=1280, height=4000, deviceScaleFactor=1, mobile=False)
        tab.open(tmp_path / "report.html")
        drawn(tab)
        tab.ask(
            "(window.scrollTo(0, 0), window.hovers = 0, document.querySelector('#a .plot').on("
            "'plotly_hover', () => { window.hovers += 1; }), 1)"
        )
        box = tab.ask(
            "(() => { const b = document.querySelector('#a .nsewdrag').getBoundingClientRect();"
            " return {x: b.x, y: b.y, w: b.width, h: b.height}; })()"
        )
        at = "Array.from(document.querySelectorAll('#%s .hoverlayer text')).map(t => t.textContent).join(' ')"
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=box["x"] + 5, y=box["y"] + 5)
        where = "document.querySelector('#a .plot')._fullLayout"
        place = tab.ask(f"({where}, [{where}.xaxis.l2p(4), {where}.yaxis.l2p(Math.sin(4))])")
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=box["x"] + place[0], y=box["y"] + place[1])
        assert "time [s]: 4" in tab.wait(at % "a")
        assert "time [s]: 4" in tab.wait(at % "b")
        assert tab.ask(at % "c") == tab.ask(at % "d") == ""
        assert tab.ask("window.hovers") <= 2
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=2, y=2)
        tab.wait(f"({at % 'a'}) === '' && ({at % 'b'}) === ''")
        assert tab.noise() == []


def test_the_first_column_of_a_wide_table_stays_and_its_edge_says_that_there_is_more(tmp_path: Path) -> None:
    columns = (Column("point", "Point"), *(Column(f"c{k}", f"Column {k}", "N m", digits=3) for k in range(24)))
    wide = Table("wide", "Wide", "Many columns.", columns, tuple((f"P_{i}", *np.full(24, 1.25)) for i in range(5)))
    write_report(replace(example.report(), sections=(Section("only", "Only", (wide,)),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(1280)
        tab.open(tmp_path / "report.html")
        box, first = "document.querySelector('#wide .scroll')", "document.querySelector('#wide tbody td')"
        edge = f"{first}.getBoundingClientRect().left - {box}.getBoundingClientRect().left"
        assert tab.ask(f"{box}.scrollWidth > {box}.clientWidth + 100")
        before, dark = tab.ask(edge), darkest(tab)
        tab.ask(f"({box}.scrollLeft = {box}.scrollWidth, 1)")
        assert tab.ask(edge) == pytest.approx(before, abs=1.0)
        assert dark < darkest(tab) - 30


def darkest(tab: chromium.Tab) -> float:
    """Brightness of the table's right edge between two lines of text, at its darkest."""
    clip = tab.ask(
        "(() => { const box = document.querySelector('#wide .scroll').getBoundingClientRect();"
        " const row = document.querySelectorAll('#wide tbody tr')[2].getBoundingClientRect();"
        " return {x: box.right + scrollX - 14, y: row.top + scrollY + 2, width: 12, height: 3, scale: 1}; })()"
    )
    shot = tab.call("Page.captureScreenshot", format="png", clip=clip)["data"]
    with Image.open(io.BytesIO(base64.b64decode(shot))) as picture:
        return float(np.asarray(picture.convert("L"), dtype=np.float64).min())


def test_one_switch_changes_what_differs_with_the_cause_and_nothing_else(tmp_path: Path) -> None:
    x, grid = np.array([1.0, 2.0]), example.speed_map()
    plain, caused = (
        Chart("x", "y", (Series("measured", x, x), Series("simulated", x, y, None, "line", 1)))
        for y in (np.array([3.0, 4.0]), np.array([1.1, 2.1]))
    )
    other = replace(grid, z=0.5 * grid.z)
    figure = Figure("one", "One", "Far off.", (plain, grid), switched=(caused, other), switched_caption="Close.")
    chart, cells = json.loads(live_json(figure))["panels"]
    assert chart["changed"][0] == {}
    assert set(chart["changed"][1]) == {"y", "text"}
    assert "zmin" not in cells["changed"][0]  # one scale for both
    write_report(replace(example.report(), sections=(Section("only", "Only", (figure,)),)), tmp_path)
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(1280)
        tab.open(tmp_path / "report.html")
        drawn(tab)
        simulated, words = "document.querySelector('#one .plot').data[1].y", "document.querySelector('#one .caption')"
        limits = "document.querySelector('#one .plot')._fullLayout.yaxis.range"
        assert tab.ask(simulated) == [3, 4]
        before = tab.ask(limits)
        tab.ask("(document.getElementById('with-cause').click(), 1)")
        tab.wait(f"{simulated}[0] === 1.1")
        assert tab.ask(f"{words}.textContent") == "Close."
        assert tab.ask(limits) == before
        tab.ask("(document.getElementById('with-cause').click(), 1)")
        tab.wait(f"{simulated}[0] === 3")
        assert tab.ask(f"{words}.textContent") == "Far off."


def test_a_figure_switches_to_panels_of_its_own_kinds_alone() -> None:
    with pytest.raises(ValueError, match="switched"):
        Figure("one", "One", "C.", (example.chart(),), switched=(example.speed_map(),))


def test_the_legend_says_how_its_groups_are_drawn() -> None:
    title = live_chart.plot(example.chart())["layout"]["legend"]["title"]["text"]
    assert title == "filled markers: measured; dashed lines: simulated"


def test_bars_stand_on_each_other_and_hang_from_zero_where_they_are_negative() -> None:
    x = np.array([1.0, 3.0])
    heights = np.array([[1.0, -2.0], [4.0, -1.0], [-3.0, 5.0]])
    chart = Chart("x", "y", tuple(Series(f"{i}", x, y, None, "bars", i) for i, y in enumerate(heights)))
    bars = [trace for trace in live_chart.plot(chart)["data"] if trace["type"] == "bar"]
    assert [trace["base"] for trace in bars] == [[0.0, 0.0], [1.0, -2.0], [0.0, 0.0]]
    assert [trace["y"] for trace in bars] == heights.tolist()
    assert {trace["width"] < 2.0 for trace in bars} == {True}


def test_a_surface_holds_the_values_of_its_map() -> None:
    z = np.array([[1.0, np.nan], [3.0, 4.0]])
    relief = SpeedMap(np.array([0.0, 1.0]), np.array([5.0, 6.0]), z, "x", "y", "z", relief=True)
    drawing = live_map.plot(relief, 1)
    surface, points = drawing["data"]
    assert (drawing["kind"], surface["type"], points["type"]) == ("surface", "surface", "scatter3d")
    assert surface["z"] == [[1.0, None], [3.0, 4.0]]
    assert (points["x"], points["y"], points["z"]) == ([0.0, 0.0, 1.0], [5.0, 6.0, 6.0], [1.0, 3.0, 4.0])

"""Drawings: deterministic, coloured by the page, and safe for any numbers and texts."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_hex

from pmg.pipeline.report import mapgrid
from pmg.pipeline.report.document import Chart, Figure, PowerFlow, Series, SpeedMap
from pmg.pipeline.report.draw import draw_png
from pmg.pipeline.report.theme import DARK, LIGHT, ROLES, SERIES, Palette

from . import example
from .example import draw_svg

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.report.figure import Panel

ONE = np.array([1.0])
NONE = np.array([])
SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = '</text><script>alert("$x_1^")</script> & $\\frac{}$ id="a" #fe00d7'

AWKWARD: dict[str, Panel] = {
    "no series": Chart("x", "y", ()),
    "no points": Chart("x", "y", (Series("a", NONE, NONE, NONE, "both"),)),
    "nothing finite": Chart("x", "y", (Series("a", ONE, np.array([np.nan]), ONE),)),
    "infinite": Chart("x", "y", (Series("a", np.arange(3.0), np.array([1.0, np.inf, -np.inf]), np.full(3, np.inf)),)),
    "one point": Chart("x", "y", (Series("a", ONE, ONE),), (("nowhere", float("nan")),)),
    "nothing on a logarithm": Chart("x", "y", (Series("a", ONE, ONE),), (("zero", 0.0), ("below", -1.0)), y_log=True),
    "band with gaps": Chart("x", "y", (Series("a", np.arange(3.0), np.ones(3), np.array([1, np.nan, 1.0]), "band"),)),
    "huge": Chart("x", "y", (Series("a", np.arange(2.0), np.array([1e300, -1e-300])),)),
    "map of nothing": SpeedMap(np.arange(2.0), np.arange(3.0), np.full((3, 2), np.nan), "x", "y", "z", annotate=True),
    "map of one cell": SpeedMap(ONE, ONE, np.array([[5.0]]), "x", "y", "z", contours=(5.0,), annotate=True),
    "map of zeros": SpeedMap(
        np.arange(2.0), np.arange(2.0), np.zeros((2, 2)), "x", "y", "z", diverging=True, contours=(0.0,), annotate=True
    ),
    "map with infinity": SpeedMap(
        np.arange(2.0), np.arange(2.0), np.array([[1.0, np.inf], [np.nan, 2.0]]), "x", "y", "z", np.ones((2, 2), bool)
    ),
    "bars both ways": Chart(
        "x",
        "y",
        tuple(Series(f"{i}", np.arange(3.0), np.array([1.0, -2.0, np.nan]), None, "bars", i) for i in range(2)),
    ),
    "surface with a hole": SpeedMap(
        np.arange(3.0), np.arange(3.0), np.where(np.eye(3), np.nan, 1.0), "x", "y", "z", title="t", relief=True
    ),
    "surface of one row": SpeedMap(np.arange(3.0), ONE, np.ones((1, 3)), "x", "y", "z", relief=True),
    "flow of nothing": PowerFlow("", (("in", 0.0), ("out", 0.0)), (("a", 0.0, 0),)),
    "flow without branches": PowerFlow("t", (("in", 5.0), ("out", 5.0)), ()),
    "flow of gains only": PowerFlow("t", (("in", 0.0), ("out", 5.0)), (("a", -5.0, 0),)),
    "everything lost": PowerFlow("t", (("in", 20.0), ("out", 0.0)), (("a", 19.99, 0), ("b", 0.01, 0))),
}


def figure(*panels: Panel, columns: int = 1) -> Figure:
    return Figure("drawn", "Drawn", "It is drawn.", panels, columns)


def texts(svg: str) -> list[str]:
    return ["".join(text.itertext()) for text in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", AWKWARD)
def test_awkward_numbers_are_drawn_without_complaint(name: str) -> None:
    drawn = figure(AWKWARD[name])
    assert draw_png(drawn).startswith(b"\x89PNG")
    assert "nan" not in draw_svg(drawn).lower()


def test_the_same_figure_gives_the_same_bytes() -> None:
    panels = (example.chart(), example.speed_map(), example.power_flow())
    assert draw_svg(figure(*panels)) == draw_svg(figure(*panels))
    assert draw_png(figure(*panels)) == draw_png(figure(*panels))


def test_a_drawing_takes_all_its_colours_from_the_page() -> None:
    svg = draw_svg(figure(example.chart(), example.power_flow()))
    assert set(re.findall(r"var\(--([a-z0-9-]+)\)", svg)) <= set(ROLES)
    assert "var(--ink)" in svg
    assert set(re.findall(r"#[0-9a-f]{6}\b", re.sub(r'(?:href="|url\()#\S+', "", svg))) == set()


def test_only_map_cells_keep_fixed_colours() -> None:
    svg = draw_svg(figure(example.speed_map()))
    labels = re.findall(r"<text[^>]*>", svg)
    assert sum("var(--ink)" in label for label in labels) > 20
    assert "<image" not in svg


def test_no_colour_of_a_map_stands_for_a_role() -> None:
    fixed = {to_hex(mapgrid.shades(diverging)(k)) for diverging in (False, True) for k in range(mapgrid.SHADES)}
    fixed |= {mapgrid.against((level, level, level)) for level in (0.0, 1.0)} | {mapgrid.HATCHING}
    assert len(fixed) == 2 * mapgrid.SHADES + 3
    assert fixed.isdisjoint(LIGHT.colours.values())
    assert len(set(LIGHT.colours.values())) == len(ROLES)


def test_texts_stay_texts_and_hostile_ones_do_no_harm() -> None:
    chart = Chart(HOSTILE, HOSTILE, (Series(HOSTILE, ONE, ONE, group=HOSTILE),), ((HOSTILE, 1.0),), HOSTILE, HOSTILE)
    svg = draw_svg(figure(chart, PowerFlow(HOSTILE, ((HOSTILE, 1.0), (HOSTILE, 0.5)), ((HOSTILE, 0.5, 0),))))
    assert "<script" not in svg
    assert HOSTILE in texts(svg)
    allowed = {"svg", "g", "defs", "path", "clipPath", "rect", "use", "text", "tspan", "pattern"}
    assert {element.tag.removeprefix(SVG) for element in ElementTree.fromstring(svg).iter()} <= allowed


def test_text_that_the_drawing_font_lacks_is_still_text() -> None:
    assert "速度" in texts(draw_svg(figure(Chart("速度", "y", (Series("a", ONE, ONE),)))))
    assert draw_png(figure(Chart("速度", "y", (Series("a", ONE, ONE),))))


def test_a_logarithmic_axis_has_plain_numbers_and_gaps_where_it_has_no_place() -> None:
    x = np.array([-1.0, 0.0, 0.01, 1.0, 100.0])
    decades = Chart("f", "y", (Series("a", x, x, None, "line"),), x_log=True, y_log=True)
    shown = texts(draw_svg(figure(decades)))
    assert {"0.01", "0.1", "1", "10", "100"} <= set(shown)
    assert not any("mathdefault" in text for text in shown)
    few = Chart("f", "y", (Series("a", np.array([1.0, 30.0]), np.array([1.0, 2.0])),), x_log=True)
    assert {"2", "5", "10", "20"} <= set(texts(draw_svg(figure(few))))
    empty = Chart("f", "y", (Series("a", -x[3:], x[3:]),), x_log=True)
    assert "no data" in texts(draw_svg(figure(empty)))
    assert draw_png(figure(decades, few, empty)).startswith(b"\x89PNG")


def test_the_flow_is_labelled_with_power_and_share() -> None:
    words = " ".join(texts(draw_svg(figure(example.power_flow())))).replace("\N{NO-BREAK SPACE}", " ")
    assert "198.7 W · 100.0 %" in words
    assert "20.25 W · 10.2 %" in words
    assert "gain" not in words


def test_a_gain_is_called_one_and_not_clipped() -> None:
    flow = PowerFlow("t", (("in", 10.0), ("out", 12.0)), (("zero offset", -2.0, 0),))
    words = " ".join(texts(draw_svg(figure(flow)))).replace("\N{NO-BREAK SPACE}", " ")
    assert "−2.00 W · −20.0 %" in words
    assert "a gain, not a loss" in words


@pytest.mark.parametrize(("label", "hatched"), [("Unexplained part", True), ("Bearings", False)])
def test_only_the_unexplained_is_hatched(label: str, hatched: bool) -> None:
    svg = draw_svg(figure(PowerFlow("t", (("in", 10.0), ("out", 8.0)), ((label, 2.0, 0),))))
    assert ("<pattern" in svg) is hatched


def test_the_map_names_grey_and_hatched_cells_only_where_there_are_any() -> None:
    full = replace(example.speed_map(), z=np.ones((13, 16)), hatch=None)
    assert not {"not measured", "within U"} & set(texts(draw_svg(figure(full))))
    assert {"not measured", "within U"} <= set(texts(draw_svg(figure(example.speed_map()))))


def test_the_map_carries_the_speeds_that_were_set() -> None:
    plain = replace(example.speed_map(), annotate=False)
    shown = texts(draw_svg(figure(plain)))
    assert {"25", "100", "1350", "1500", "600"} <= set(shown)


def test_values_are_written_into_cells_on_request() -> None:
    small = SpeedMap(
        np.arange(2.0), np.arange(2.0), np.array([[1.25, -7.5], [np.nan, 3.0]]), "x", "y", "z", annotate=True
    )
    assert {"1.2", "−7.5", "3.0"} <= set(texts(draw_svg(figure(small))))
    assert "−7.5" not in texts(draw_svg(figure(replace(small, annotate=False))))


def test_points_beyond_the_axes_are_counted() -> None:
    series = Series("a", np.arange(4.0), np.array([0.5, 2.0, -1.0, np.nan]))
    assert "2 points beyond the axes" in texts(draw_svg(figure(Chart("x", "y", (series,), y_limits=(0.0, 1.0)))))
    assert "no data" in texts(draw_svg(figure(AWKWARD["nothing finite"])))


def test_error_bars_reach_twice_the_standard_uncertainty() -> None:
    """The vertical range follows the longest bar: y = 0 with u = 1 must need the axis of +-2, not of +-1."""
    shown = texts(draw_svg(figure(Chart("x", "y", (Series("a", ONE, 0 * ONE, ONE),)))))
    assert {"2.0", "−2.0"} <= set(shown)
    assert "2.5" not in shown


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (lambda: Series("a", ONE, NONE), "lengths"),
        (lambda: Series("a", ONE, ONE, style="band"), "needs u"),
        (lambda: SpeedMap(ONE, ONE, np.ones((2, 1)), "x", "y", "z"), "of shape"),
        (lambda: SpeedMap(np.array([2.0, 1.0]), ONE, np.ones((1, 2)), "x", "y", "z"), "rising"),
        (lambda: Figure("Not An Id", "t", "c", (example.chart(),)), "lower-case"),
        (lambda: Figure("../up", "t", "c", (example.chart(),)), "lower-case"),
        (lambda: Figure("empty", "t", "c", ()), "at least one panel"),
    ],
)
def test_a_figure_that_makes_no_sense_is_refused(wrong: Callable[[], object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        wrong()


def luminance(colour: str) -> float:
    channels = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize(
    ("lettering", "ground"),
    [
        ("ink", "paper"),
        ("ink", "soft"),
        ("ink", "good-soft"),
        ("ink", "attention-soft"),
        ("muted", "paper"),
        ("muted", "soft"),
        ("link", "paper"),
        ("link", "soft"),
        ("good", "good-soft"),
        ("attention", "attention-soft"),
        ("attention", "paper"),
    ],
)
def test_lettering_is_readable(palette: Palette, lettering: str, ground: str) -> None:
    assert contrast(palette[lettering], palette[ground]) >= 4.5


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("series", range(SERIES))
def test_series_stand_out_from_the_page(palette: Palette, series: int) -> None:
    assert contrast(palette.series(series), palette["paper"]) >= 3.0

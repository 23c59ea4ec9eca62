"""Still drawings: the same bytes from any process, strokes that draw again what they drew, and less of the same SVG."""

from __future__ import annotations

import io
import os
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as MatplotlibFigure

from pmg.pipeline.files.parallel import keeping_workers, map_in_order
from pmg.pipeline.report import draw
from pmg.pipeline.report.document import Figure
from pmg.pipeline.report.draw import draw_all
from pmg.pipeline.report.stills.compact import compact
from pmg.pipeline.report.stills.strokes import Recorder, Redrawn
from pmg.sim.errors import StoreError

from . import example

RESOLUTION = 100


def test_figures_have_the_same_bytes_from_other_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = [
        Figure("chart", "Chart", "It rises.", (example.chart(),)),
        Figure("map", "Map", "It falls.", (example.speed_map(),)),
    ]
    here = draw_all(figures)
    monkeypatch.setattr(draw, "SEVERAL", 2)
    with keeping_workers(2):
        assert draw_all(figures) == here


def test_workers_that_load_a_module_at_once_do_the_same_work(capfd: pytest.CaptureFixture[str]) -> None:
    """``this`` prints as it is loaded, once in each of them."""
    with keeping_workers(2, loading="this"):
        assert list(map_in_order(abs, [-1, 2], 99)) == [(-1, 1), (2, 2)]
    assert capfd.readouterr().out.count("Beautiful is better than ugly.") in (1, 2)
    with keeping_workers(1, loading="no.such.module"):
        assert list(map_in_order(abs, [-1], 1)) == [(-1, 1)]


def test_a_worker_that_dies_is_told_of() -> None:
    with pytest.raises(StoreError, match="worker"), keeping_workers(2):
        list(map_in_order(os._exit, [1, 1], 2))


def clipped() -> MatplotlibFigure:
    """Lines, markers, a mesh, bars, hatching and text, clipped by their axes."""
    figure = MatplotlibFigure((4.0, 3.0), 72.0, facecolor="none")
    left, right = figure.subplots(1, 2)
    left.plot([0.0, 1.0, 2.0], [0.0, 2.0, 1.0], marker="o", linestyle="--")
    left.errorbar([0.5, 1.5], [1.0, 1.0], [0.4, 0.9])
    left.bar([1.0], [1.5], hatch="//", edgecolor="black")
    left.set(xlim=(0.2, 1.8), ylim=(0.1, 1.8))
    right.pcolormesh(np.arange(12.0).reshape(3, 4), edgecolor="white")
    right.scatter([0.5, 3.5], [0.5, 2.5], c=[0.0, 1.0], s=60.0)
    right.set_xlim(0.7, 3.7)
    return figure


def dots(figure: MatplotlibFigure) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba(), dtype=np.float64)  # type: ignore[no-untyped-call]


def test_strokes_draw_again_what_they_drew() -> None:
    first = clipped()
    recorder = Recorder(4.0 * 72.0, 3.0 * 72.0, io.StringIO(), {"Date": None})
    first.draw(recorder)
    again = MatplotlibFigure((4.0, 3.0), RESOLUTION, facecolor="none")
    again.add_artist(Redrawn(recorder.strokes, 4.0, 3.0))
    plain = clipped()
    plain.set_dpi(RESOLUTION)
    found, expected = dots(again), dots(plain)
    inked = expected[..., 3] > 0
    assert inked.mean() > 0.2
    # Letters may stand a part of a dot aside, as their widths are measured at another resolution.
    assert (np.abs(found - expected).max(axis=2) > 64.0).mean() < 0.0015


def drawn_svg() -> str:
    file = io.StringIO()
    recorder = Recorder(4.0 * 72.0, 3.0 * 72.0, file, {"Date": None})
    with rc_context({"svg.fonttype": "none"}):
        clipped().draw(recorder)
    recorder.finalize()  # type: ignore[no-untyped-call]
    return file.getvalue()


def test_a_compact_drawing_has_every_text_and_every_mark_at_its_place() -> None:
    svg = drawn_svg()
    made = compact(svg)
    assert len(made) < 0.6 * len(svg)
    before, after = ElementTree.fromstring(svg), ElementTree.fromstring(made)
    tag = "{http://www.w3.org/2000/svg}"
    texts = [[text.text for text in root.iter(f"{tag}text")] for root in (before, after)]
    assert len(texts[0]) > 10
    assert texts[0] == texts[1]
    places = [
        [(round(float(use.attrib["x"]), 2), round(float(use.attrib["y"]), 2)) for use in root.iter(f"{tag}use")]
        for root in (before, after)
    ]
    assert places[0]
    assert places[0] == places[1]
    names = {element.attrib["id"] for element in after.iter() if "id" in element.attrib}
    assert set(re.findall(r'(?:url\(#|href="#)([^")]*)', made)) <= names

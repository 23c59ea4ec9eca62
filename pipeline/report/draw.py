"""Figures drawn: as PNG and SVG for documents, as SVG that takes its colours from the page, and as its live data."""

from __future__ import annotations

import io
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as MatplotlibFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from pmg.pipeline.files.parallel import map_in_order
from pmg.pipeline.report import draw_chart, draw_flow, draw_map
from pmg.pipeline.report.figure import Chart, Figure, Panel, SpeedMap
from pmg.pipeline.report.live import live_json
from pmg.pipeline.report.sheet import PAPER, POINTS
from pmg.pipeline.report.stills.compact import compact
from pmg.pipeline.report.stills.strokes import Recorder, RecordingCanvas, Redrawn
from pmg.pipeline.report.theme import alone, themed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import TextIO

    from matplotlib.figure import SubFigure

    from pmg.pipeline.report.sheet import Sheet
    from pmg.pipeline.report.stills.strokes import Stroke

NARROW = 4.4
"""Width of a figure that stands beside text [in]."""
RESOLUTION = 200
"""Dots per inch of the PNG files."""

SEVERAL = 8
"""So many figures are worth the start of other processes."""

_NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))
_STYLE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "pmg",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "axes.linewidth": 0.8,
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.7,
    "lines.linewidth": 1.5,
    "lines.markersize": 5.0,
    "legend.frameon": False,
    "errorbar.capsize": 2.0,
}


@dataclass(frozen=True)
class Drawings:
    """Figures drawn in every way.

    Parameters
    ----------
    files : dict of str to bytes
        The PNG of each figure, and an SVG that stands alone, with colours for white paper and text as text.
    inline, live : dict of str to str
        The SVG element of each figure, by its id, as a page takes it, and what the page draws it live from.
    """

    files: dict[str, bytes]
    inline: dict[str, str]
    live: dict[str, str]


def draw_png(figure: Figure) -> bytes:
    """A figure as PNG on white; the same figure gives the same bytes."""
    with _our_style():
        return _dots(_drawing_of(figure))


def draw_all(figures: Sequence[Figure]) -> Drawings:
    """Every figure as PNG, as SVG for a page and for itself, and as live data.

    Each is laid out once, in the colours of paper. The same figures give the same bytes, drawn here or, where
    `keeping_workers` keeps some, in other processes.

    Parameters
    ----------
    figures : sequence of Figure
        What to draw.
    """
    drawn = Drawings({}, {}, {})
    for figure, (png, svg, inline, live) in map_in_order(_drawn, figures, SEVERAL):
        drawn.files.update({figure.file: png, figure.vector_file: svg})
        drawn.inline[figure.id], drawn.live[figure.id] = inline, live
    return drawn


@dataclass(frozen=True)
class _Drawing:
    """A figure laid out and drawn: its width and height [in], its strokes, and the SVG file that they made."""

    size: tuple[float, float]
    strokes: list[Stroke]
    svg: str


def _drawing_of(figure: Figure) -> _Drawing:
    """A figure laid out for every output, which takes as long as drawing it, and drawn."""
    file = io.StringIO()
    canvas, recorder = _laid_out(figure, file)
    canvas.draw(recorder)
    recorder.finalize()  # type: ignore[no-untyped-call]
    width, height = canvas.get_size_inches()
    return _Drawing((float(width), float(height)), recorder.strokes, compact(file.getvalue()))


def _drawn(figure: Figure) -> tuple[bytes, bytes, str, str]:
    """A figure as PNG, as an SVG that stands alone, as an element of a page, and as its live data."""
    with _our_style():
        drawing = _drawing_of(figure)
        png = _dots(drawing)
    svg = alone(drawing.svg, figure.title, figure.caption).encode()
    return png, svg, themed(drawing.svg, figure.id), live_json(figure)


def _dots(drawing: _Drawing) -> bytes:
    """A drawing as a PNG file on white."""
    again = MatplotlibFigure(drawing.size, RESOLUTION, facecolor=PAPER.palette["paper"])
    again.add_artist(Redrawn(drawing.strokes, *drawing.size))
    canvas: Any = FigureCanvasAgg(again)
    file = io.BytesIO()
    canvas.print_png(file, metadata={"Software": None})
    return file.getvalue()


def _laid_out(figure: Figure, file: TextIO) -> tuple[MatplotlibFigure, Recorder]:
    """A figure with all that it shows at its place, and what draws it into a file."""
    sheet = replace(PAPER, width=NARROW) if figure.narrow else PAPER
    columns = min(figure.columns, len(figure.panels))
    column = sheet.shared(columns)
    rows = [figure.panels[start : start + columns] for start in range(0, len(figure.panels), columns)]
    heights = [max(_height(panel, column) for panel in row) for row in rows]
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.0, hspace=0.0)
    size = (sheet.width, sum(heights))
    canvas = MatplotlibFigure(size, POINTS, layout=layout, facecolor="none")
    recorder = Recorder(size[0] * POINTS, size[1] * POINTS, file, _NO_METADATA)
    RecordingCanvas(canvas, recorder)
    boxes = canvas.subfigures(len(rows), columns, squeeze=False, height_ratios=heights, wspace=0, hspace=0)
    for row, height, places in zip(rows, heights, boxes, strict=True):
        for panel, box in zip(row, places, strict=False):
            box.set_facecolor("none")
            _draw(panel, box, height, column)
    layout.execute(canvas)
    canvas.set_layout_engine(None)
    return canvas, recorder


def _height(panel: Panel, sheet: Sheet) -> float:
    """Height that a panel asks for [in]."""
    if isinstance(panel, Chart):
        return draw_chart.height(panel, sheet)
    return draw_map.height(panel, sheet) if isinstance(panel, SpeedMap) else draw_flow.height(panel, sheet)


def _draw(panel: Panel, box: SubFigure, height: float, sheet: Sheet) -> None:
    if isinstance(panel, Chart):
        draw_chart.draw(panel, box, sheet)
    elif isinstance(panel, SpeedMap):
        draw_map.draw(panel, box, sheet)
    else:
        draw_flow.draw(panel, box, height, sheet)


@contextmanager
def _our_style() -> Iterator[None]:
    """The style above and nothing of the user's own settings."""
    with matplotlib.rc_context(), warnings.catch_warnings():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        # A sign that the drawing font lacks shows as a box in the PNG; the page has fonts of its own.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield

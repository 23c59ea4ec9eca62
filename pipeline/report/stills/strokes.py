"""Strokes of a drawing: kept while it is written as SVG, and drawn again by any renderer.

matplotlib places every tick and text anew for each kind of file, which takes longer than to draw them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from matplotlib.artist import Artist
from matplotlib.backend_bases import FigureCanvasBase, GraphicsContextBase
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.font_manager import fontManager, get_font
from matplotlib.transforms import Affine2D, IdentityTransform, Transform, TransformedBbox, TransformedPath

from pmg.pipeline.report.sheet import POINTS

if TYPE_CHECKING:
    from typing import TextIO

    from matplotlib.backend_bases import RendererBase
    from matplotlib.font_manager import FontProperties


@dataclass(frozen=True)
class Stroke:
    """One call of a renderer, in points from the lower left corner.

    Parameters
    ----------
    method : str
        Name of the method.
    context : GraphicsContextBase
        Line, colour and clipping.
    given, named : tuple and dict
        What else it takes.
    """

    method: str
    context: GraphicsContextBase
    given: tuple[Any, ...]
    named: dict[str, Any]


class Recorder(RendererSVG):
    """An SVG file being written, and every stroke of it.

    Parameters
    ----------
    width, height : float
        Of the drawing [pt].
    file : TextIO
        Receives the SVG; `finalize` writes its end.
    metadata : dict
        Of the SVG.
    """

    def __init__(self, width: float, height: float, file: TextIO, metadata: dict[str, Any]) -> None:
        super().__init__(width, height, file, metadata=metadata)  # type: ignore[no-untyped-call]
        self.strokes: list[Stroke] = []
        self._within = False

    def _stroke(self, method: str, context: GraphicsContextBase, *given: Any, **named: Any) -> None:  # noqa: ANN401 - as matplotlib hands it
        """Keep a stroke and write it; what the SVG makes of it in turn is not kept."""
        if self._within:
            getattr(RendererSVG, method)(self, context, *given, **named)
            return
        kept = tuple(each.frozen() if isinstance(each, Transform) else each for each in given)
        if method == "draw_text":  # its last two are for the SVG alone; its height is told from above
            x, y, *rest = kept
            self.strokes.append(Stroke(method, _copied(context), (x, self.height - y, *rest[:3]), {}))
        else:
            self.strokes.append(Stroke(method, _copied(context), kept, named))
        self._within = True
        try:
            getattr(RendererSVG, method)(self, context, *given, **named)
        finally:
            self._within = False

    def draw_path(self, *given: Any, **named: Any) -> None:  # noqa: ANN401, D102 - as RendererBase says
        self._stroke("draw_path", *given, **named)

    def draw_markers(self, *given: Any, **named: Any) -> None:  # noqa: ANN401, D102
        self._stroke("draw_markers", *given, **named)

    def draw_path_collection(self, *given: Any, **named: Any) -> None:  # noqa: ANN401, D102
        self._stroke("draw_path_collection", *given, **named)

    def draw_quad_mesh(self, *given: Any, **named: Any) -> None:  # noqa: ANN401, D102
        self._stroke("draw_quad_mesh", *given, **named)

    def draw_text(self, *given: Any, **named: Any) -> None:  # noqa: ANN401, D102
        self._stroke("draw_text", *given, **named)

    def draw_image(self, *_: object, **__: object) -> None:
        """Refused, as nothing of the kind is kept: figures are vectors.

        Raises
        ------
        NotImplementedError
            Always.
        """
        raise NotImplementedError("a figure holds an image; drawings keep vectors only")

    def _get_font_height_metrics(self, letters: FontProperties) -> tuple[float | None, float | None, float | None]:
        """Ascent, descent and gap of a line [pt], kept; matplotlib else reads them from the font for each text."""
        return _line_of(letters)


@lru_cache(maxsize=64)
def _line_of(letters: FontProperties) -> tuple[float | None, float | None, float | None]:
    """Ascent, descent and gap of a line [pt]; None where the font does not tell them."""
    font = get_font(fontManager.findfont(letters))
    table, head = font.get_sfnt_table("OS/2"), font.get_sfnt_table("head")
    if table is None or head is None:
        return None, None, None
    unit = letters.get_size_in_points() / head["unitsPerEm"]
    return unit * table["sTypoAscender"], -unit * table["sTypoDescender"], unit * table["sTypoLineGap"]


class RecordingCanvas(FigureCanvasBase):
    """The canvas of a figure that is laid out and drawn by one renderer."""

    def __init__(self, figure: Any, recorder: Recorder) -> None:  # noqa: ANN401 - as matplotlib takes it
        super().__init__(figure)
        self.recorder = recorder

    def get_renderer(self) -> Recorder:
        """What measures texts while the figure is laid out."""
        return self.recorder


def _copied(context: GraphicsContextBase) -> GraphicsContextBase:
    """A context that holds on to no figure, which would go with it to another process."""
    made = GraphicsContextBase()
    made.copy_properties(context)
    _clip(made, context, IdentityTransform())
    return made


def _clip(made: GraphicsContextBase, like: GraphicsContextBase, place: Any) -> None:  # noqa: ANN401 - a transform
    """Clip as another context does, at another place."""
    rectangle: Any = like.get_clip_rectangle()
    if rectangle is not None:
        made.set_clip_rectangle(TransformedBbox(rectangle, place).frozen())
    path, transform = like.get_clip_path()
    if path is not None and transform is not None:
        outline: Any = path
        made.set_clip_path(TransformedPath(outline, (transform + place).frozen()))


class Redrawn(Artist):
    """Strokes as the one artist of a figure of the same size, whatever its resolution and its margins.

    Parameters
    ----------
    strokes : list of Stroke
        What is drawn.
    width, height : float
        Of the drawing [in].
    """

    def __init__(self, strokes: list[Stroke], width: float, height: float) -> None:
        super().__init__()
        self._strokes = strokes
        self._size = width * POINTS, height * POINTS

    def draw(self, renderer: RendererBase) -> None:
        """Draw every stroke."""
        figure = self.get_figure(root=True)
        assert figure is not None
        place: Any = Affine2D().scale(1.0 / self._size[0], 1.0 / self._size[1]) + figure.transFigure.frozen()  # type: ignore[operator]
        scale = Affine2D().scale(*place.get_matrix().diagonal()[:2])
        tall = renderer.get_canvas_width_height()[1]
        for stroke in self._strokes:
            context = renderer.new_gc()
            context.copy_properties(stroke.context)
            _clip(context, stroke.context, place)
            given = stroke.given
            if stroke.method == "draw_path":
                path, transform, *face = given
                given = (path, transform + place, *face)
            elif stroke.method == "draw_markers":
                marker, shape, path, transform, *face = given
                given = (marker, shape + scale, path, transform + place, *face)
            elif stroke.method == "draw_path_collection":
                shape, paths, each, offsets, transform, *rest = given
                given = (shape + scale, paths, each, offsets, transform + place, *rest)
            elif stroke.method == "draw_quad_mesh":
                shape, across, up, corners, offsets, transform, *rest = given
                given = (shape + scale, across, up, corners, offsets, transform + place, *rest)
            else:
                x, y, *rest = given
                x, y = place.transform((x, y))
                given = (x, tall - y if renderer.flipy() else y, *rest)
            getattr(renderer, stroke.method)(context, *given, **stroke.named)
            context.restore()

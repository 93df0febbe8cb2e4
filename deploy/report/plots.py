"""Plots: one style, one palette, as PNG or SVG. matplotlib is imported only when something is drawn."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from deploy.report.output import writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.typing import RcKeyType

Draw = Callable[["Figure"], None]
"""Draws into an empty figure."""
Save = Callable[["Figure", io.BytesIO], None]
"""Writes a drawn figure in one file format."""

PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Okabe and Ito's, which people with colour-blindness tell apart."""
LIMIT_COLOUR, BAR_COLOUR, INK = "#cf1124", "#9fb3c8", "#102a43"
_STYLE: dict[RcKeyType, str | float | bool] = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.titlesize": 9.0,
    "grid.color": "#e4e7eb",
    "axes.axisbelow": True,
    "axes.edgecolor": "#7b8794",
    "axes.labelcolor": "#323f4b",
    "xtick.color": "#52606d",
    "ytick.color": "#52606d",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "tandem",
}


def colour(number: int) -> str:
    """The palette's colour of a series, from its start again where the palette ends."""
    return PALETTE[number % len(PALETTE)]


def svg(draw: Draw, width: float, height: float) -> str:
    """An SVG of that size in inches; drawn again it is the same text."""
    undated = {"Date": None, "Creator": None}
    return _saved(
        draw, (width, height), lambda figure, out: figure.savefig(out, format="svg", metadata=undated)
    ).decode()


def png(draw: Draw, width: float, height: float, dpi: int = 110) -> bytes:
    """A PNG of that size in inches."""
    return _saved(draw, (width, height), lambda figure, out: figure.savefig(out, format="png", dpi=dpi))


def save_png(path: Path, draw: Draw, width: float, height: float) -> None:
    """Write a PNG of that size in inches. Raises TandemError where the disk refuses."""
    image = png(draw, width, height)
    with writing(path):
        path.write_bytes(image)


def _saved(draw: Draw, size: tuple[float, float], save: Save) -> bytes:
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure)
        out = io.BytesIO()
        save(figure, out)
    return out.getvalue()

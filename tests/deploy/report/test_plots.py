"""The plots of a report: the same each time, and within the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from deploy.report.page import data_uri
from deploy.report.plots import PALETTE, colour, png, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(figure: Figure) -> None:
    figure.subplots().plot([0.0, 1.0], [1.0, 0.0], color=colour(0))


def test_a_plot_drawn_again_is_the_same_text_and_its_words_stay_words() -> None:
    def named(figure: Figure) -> None:
        figure.subplots().set_title("lag <ms>")

    assert svg(draw, 2.0, 2.0) == svg(draw, 2.0, 2.0)
    assert "lag &lt;ms&gt;" in svg(named, 2.0, 2.0)


def test_an_image_lies_within_the_page() -> None:
    assert data_uri(svg(draw, 2.0, 2.0)).startswith("data:image/svg+xml;base64,")
    assert data_uri(png(draw, 2.0, 2.0)).startswith("data:image/png;base64,iVBOR")


def test_colours_begin_again_where_the_palette_ends() -> None:
    assert colour(len(PALETTE)) == colour(0) != colour(1)

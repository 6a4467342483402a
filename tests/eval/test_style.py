"""How pictures are drawn."""

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from semslam.eval.style import render


def test_a_long_title_is_drawn_within_the_picture() -> None:
    drawn: list[Figure] = []

    def draw(figure: Figure) -> None:
        drawn.append(figure)
        figure.subplots().set_title("a sequence with a long name: feature_map odometry, " * 3)

    render(draw, (5.0, 4.0))
    (figure,) = drawn
    title = figure.axes[0].get_tightbbox(FigureCanvasAgg(figure).get_renderer())
    assert title is not None
    assert title.x1 <= figure.bbox.width
    assert title.y1 <= figure.bbox.height

"""Colours, dashes and legends of the plots of a report."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lidarium.evaluation.drawing.style import COLOURS, DASHES, colours, dash, dress, legend


def test_the_first_colours_are_those_that_all_can_distinguish():
    assert colours(3) == list(COLOURS[:3])
    many = colours(12)
    assert len(many) == len(set(many)) == 12
    assert colours(0) == []


def test_neighbours_differ_without_colour():
    assert dash(0) == dash(len(DASHES)) == "-"
    assert all(dash(k) != dash(k + 1) for k in range(20))


def test_a_legend_has_as_many_columns_as_there_is_room_for():
    for width, columns in ((3.0, 1), (12.0, 4)):
        figure = Figure(figsize=(width, 3.0), layout="constrained")
        dress(figure.subplots(), "title", "x", "y")
        names = [f"a policy of some name {k}" for k in range(4)]
        legend(figure, names, [Line2D([], []) for _ in names])
        (found,) = figure.legends
        assert found._ncols == columns
        assert [text.get_text() for text in found.get_texts()] == names

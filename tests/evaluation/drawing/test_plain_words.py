"""Words of figures are taken as they are."""

from matplotlib import rcParams
from matplotlib.figure import Figure

from lidarium.evaluation.drawing.plain_words import plain_words


def test_a_dollar_begins_no_formula_and_what_controls_a_terminal_is_replaced():
    figure = Figure()
    axes = figure.subplots()
    axes.set_title("$\\frac{$\x1b[31m\nsecond")
    with plain_words(figure):
        assert not axes.title.get_parse_math()
        assert axes.title.get_text() == "$\\frac{$\N{REPLACEMENT CHARACTER}[31m\nsecond"
        assert not rcParams["text.parse_math"]
    assert rcParams["text.parse_math"]

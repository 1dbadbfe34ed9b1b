"""Words of figures, taken as they are."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.text import Text

from lidarium.mapping.files.guarded_reading import printable


@contextmanager
def plain_words(figure: Figure) -> Iterator[None]:
    """Take all words of a figure as they are while it is drawn: a name with ``$`` is no formula."""
    # Labels of ticks are made only when a figure is drawn.
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        for text in figure.findobj(Text):
            text.set_parse_math(False)
            text.set_text("\n".join(map(printable, text.get_text().split("\n"))))
        yield

"""Names in markdown: shown as they are, whatever they have in them."""

import re

from lidarium.mapping.files.names import printable

_SPECIAL = re.compile(r"([\\`*\[\]<>|$~])")


def plain(text: str) -> str:
    """Return text in which nothing stands for anything but itself, links and tables among it."""
    return _SPECIAL.sub(r"\\\1", printable(text).replace("&", "&amp;"))


def code(name: str) -> str:
    """Return a name as code; one that would end the code or a table's cell as plain text."""
    shown = printable(name)
    return f"`{shown}`" if shown.strip() and not set("`|") & set(shown) else plain(shown)

"""Names in markdown: shown as they are, whatever they have in them."""

import re

from lidarium.mapping.files.guarded_reading import printable

_SPECIAL = re.compile(r"([\\`*\[\]<>|$~])")
_WRITTEN = re.compile(r"`([^`]*)`|\\([\\`*\[\]<>|$~])|&amp;")


def plain(text: str) -> str:
    """Return text in which nothing stands for anything but itself, links and tables among it."""
    return _SPECIAL.sub(r"\\\1", printable(text).replace("&", "&amp;"))


def code(name: str) -> str:
    """Return a name as code; one that would end the code or a table's cell as plain text."""
    shown = printable(name)
    return f"`{shown}`" if shown.strip() and not set("`|") & set(shown) else plain(shown)


def as_text(markdown: str) -> str:
    """Return what `plain` and `code` wrote as it reads, for pages that are no markdown."""
    return _WRITTEN.sub(lambda found: found[1] or found[2] or "&", markdown)

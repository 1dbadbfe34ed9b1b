"""Names that come from outside, made fit to be printed anywhere."""

import unicodedata

UNKNOWN = "\N{REPLACEMENT CHARACTER}"


def printable(name: str) -> str:
    """Return a name in which bytes that are no UTF-8, and what controls a terminal, are replaced."""
    return "".join(
        UNKNOWN if unicodedata.category(letter) in ("Cc", "Cs", "Co") else letter for letter in name
    )

"""Names that come from outside are made fit to be printed."""

import pytest

from lidarium.mapping.files.names import UNKNOWN, printable


@pytest.mark.parametrize("name", ["flat 3", "étage", "床", "a\N{COMBINING ACUTE ACCENT}", ""])
def test_names_of_any_language_stay(name):
    assert printable(name) == name


def test_what_controls_a_terminal_or_is_no_letter_is_replaced():
    assert printable("a\x1b[31mb\n") == f"a{UNKNOWN}[31mb{UNKNOWN}"
    assert printable(b"caf\xe9".decode("utf-8", "surrogateescape")) == f"caf{UNKNOWN}"
    printable("x\udcff").encode()

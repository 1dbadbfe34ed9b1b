"""Names in markdown read as they are."""

import pytest

from lidarium.evaluation.report.plain_text import as_text, code, plain

EVIL = '</script><img src=x onerror=alert(1)>"&amp; `a|b` \\*'


@pytest.mark.parametrize("name", [EVIL, "plain", "`", "a`b", "\\`", "&amp;", "a\\*b", "", "|"])
def test_markdown_reads_as_the_name_that_was_written(name):
    assert as_text(plain(name)) == name
    assert as_text(code(name)) == name
    assert as_text(f"1 of {code(name)}, {plain(name)}.") == f"1 of {name}, {name}."


def test_nothing_in_a_name_makes_a_link_or_a_table():
    assert plain("[a](b) | *c*") == r"\[a\](b) \| \*c\*"
    assert code("a|b") == r"a\|b"
    assert code("a_b") == "`a_b`"
    assert code(" ") == " "

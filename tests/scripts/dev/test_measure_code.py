"""Figures of the sources are counted as a reader would count them."""

import ast

from lidarium.scripts.dev.measure_code import LAYERS, functions, length, measure, parameters

SOURCE = '''
def long(a, /, b, *, c):
    """Say what it does.

    In three lines.
    """
    first = a

    return first


class Thing:
    def method(self, a):
        return a
'''


def test_docstrings_and_self_do_not_count():
    outer, method = functions(ast.parse(SOURCE))
    assert (length(outer), parameters(outer)) == (4, 3)
    assert (length(method), parameters(method)) == (2, 1)


def test_a_checkout_is_measured(tmp_path):
    for folder in (*LAYERS, "benchmarks", "src", "tests/envs"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "envs" / "one.py").write_text(SOURCE)
    (tmp_path / "envs" / "__init__.py").write_text("")
    (tmp_path / "mapping" / "two.py").write_text("x = 1\n" * 301 + "# " + "y" * 109 + "\n")
    (tmp_path / "tests" / "envs" / "test_one.py").write_text("")
    found = measure(tmp_path)
    assert found["files above 300 lines"] == "1"
    assert found["longest function [lines]"] == "4"
    assert found["most parameters"] == "3"
    assert found["lines beyond 110 columns"] == "1"
    assert found["modules with a test at the mirrored path"] == "1 of 2"

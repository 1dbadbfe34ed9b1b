"""Figures as markdown."""

import math

import pytest

from lidarium.evaluation.analysis.figures import compared, time_figure, values_of
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.report.tables import (
    NONE,
    as_text,
    code,
    comparisons_table,
    floors_table,
    interval,
    markdown_table,
    number,
    p_value,
    plain,
    times_table,
)
from lidarium.evaluation.statistics import Interval


def cells(table):
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in table.splitlines()]


def test_the_first_column_of_a_table_is_to_the_left():
    assert markdown_table(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | ---: |\n| 1 | 2 |"


def test_what_is_later_than_the_horizon_says_so_and_0_has_no_sign():
    assert number(math.inf, 600.0) == "> 600"
    assert number(math.inf) == number(-math.inf, 600.0) == NONE
    assert number(-0.04) == "0.0"
    assert number(-0.06, digits=1) == "-0.1"


def test_an_interval_is_in_brackets_and_scaled():
    assert interval(Interval(0.5, 0.25, 1.0, 0.95, 8), scale=100.0) == "50.0 [25.0, 100.0]"
    assert interval(Interval(40.0, 30.0, math.inf, 0.95, 8), 90.0) == "40.0 [30.0, > 90]"
    assert interval(Interval(40.0, -math.inf, math.inf, 0.95, 2), 90.0) == "40.0"
    assert interval(None) == NONE


@pytest.mark.parametrize(
    ("value", "text"), [(0.00001, "< 0.0001"), (0.00123, "0.0012"), (0.0312, "0.031"), (1.0, "1.000")]
)
def test_a_p_value_has_the_digits_that_matter(value, text):
    assert p_value(value) == text


def test_times_are_listed_by_policy_with_those_that_got_there(row):
    runs = [row(seed=seed, t90_s=50.0 if seed else None) for seed in range(4)]
    _, _, (policy, size, reached, success, *_) = cells(times_table({"a": time_figure(runs, "t90_s", 100.0, 0)}, 100.0))
    assert (policy, size, reached) == ("`a`", "4", "3")
    assert success.startswith("75.0 [")


def test_a_floor_without_a_run_of_a_policy_has_a_dash(row):
    (group,) = grouped([row("a", t90_s=30.0), row("a", seed=1), row("b", floor="clinic", t90_s=20.0)])
    header, _, *lines = cells(floors_table(group, "t90_s"))
    assert header == ["floor", "`a`", "`b`"]
    by_floor = {name: shown for name, *shown in lines}
    assert by_floor["clinic"] == [NONE, "20.0 (1/1)"]
    assert by_floor["apartment"][0].endswith("(1/2)")
    assert by_floor["apartment"][1] == NONE


def test_comparisons_say_how_many_pairs_are_less_more_and_the_same(row):
    runs = [row(policy, seed, path_m=[10.0 - (policy == "b") * (seed > 0)]) for policy in "ab" for seed in range(4)]
    (group,) = grouped(runs)
    values = values_of(runs)
    lines = cells(comparisons_table(compared(group, values, "a", seed=0), values))
    (path,) = [line for line in lines if line[1] == "path of the team [m]"]
    assert path[0] == "`b`"
    assert path[2] == "4"
    assert path[3] == "-0.8 (10.0 / 10.0, 9.0 / 10.0, 9.0 / 10.0, 9.0 / 10.0)"
    assert path[5] == "0.88 [0.40, 0.99]"
    assert path[6] == "3 / 0 / 1"


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

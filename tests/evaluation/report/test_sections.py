"""What a report says of a group, and what to be careful with."""

import pytest

from lidarium.evaluation.analysis.figures import values_of
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.report.sections import _file_stem, describe_group


@pytest.fixture
def described(tmp_path):
    def describe(rows, baseline="a"):
        (group,) = grouped(rows)
        return describe_group(group, values_of(rows), {}, tmp_path, baseline, 0)

    return describe


def test_a_group_without_its_baseline_is_not_compared_and_that_is_said(row, described, tmp_path):
    section = described([row("b"), row("b", seed=1, t90_s=30.0)])
    assert section.numbers["comparisons"] == []
    assert any("no runs of the baseline `a`" in warning for warning in section.warnings)
    assert any(
        "time to 90 % was not reached in 1 of 2 runs of `b` (50 % censored)" in warning for warning in section.warnings
    )
    assert section.numbers["by_floor"]["apartment"]["b"]["t90_s"]["reached"] == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(section.numbers["pictures"])


def test_runs_without_a_partner_are_counted(row, described):
    section = described([row("a"), row("a", seed=1), row("b", seed=1), row("b", seed=2), row("b", seed=3)])
    assert {each.policy: each.pairs for each in section.numbers["comparisons"]} == {"b": 1}
    assert any("3 of `b` or `a`" in warning for warning in section.warnings)
    assert any("fewer than 50 pairs with `a`: `b` (1)" in warning for warning in section.warnings)


def test_floors_have_stems_of_their_own():
    floors = ["a/b", "a.b", "plain", "x" * 80 + "1", "x" * 80 + "2"]
    stems = [_file_stem(floor, floors) for floor in floors]
    assert stems[2] == "plain"
    assert len(set(stems)) == len(stems)
    assert max(map(len, stems)) <= 60 + 9

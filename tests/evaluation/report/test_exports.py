"""Results in the formats of others."""

import pytest

from lidarium.evaluation.analysis.figures import time_figure, values_of
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.report.exports import escaped, latex_table, marl_eval


@pytest.fixture
def rows(row):
    return [
        row(policy, seed, floor=floor, t99_s=None if seed else time)
        for policy in ("a_b", "c")
        for seed in range(2)
        for floor, time in (("clinic", 30.0), ("apartment", 20.0))
    ]


def test_marl_eval_has_a_number_for_each_floor_of_each_run(rows):
    (group,) = grouped(rows)
    ((task, algorithms),) = marl_eval([group], values_of(rows))["lidarium"].items()
    assert task == group.title
    assert set(algorithms) == {"a_b", "c"}
    assert set(algorithms["c"]) == {"seed_0", "seed_1"}
    assert algorithms["c"]["seed_0"]["absolute_metrics"]["t99_s"] == [20.0, 30.0]
    assert algorithms["c"]["seed_1"]["step_0"]["t99_s"] == [group.horizon_s] * 2
    assert algorithms["c"]["seed_0"]["step_0"]["step_count"] == 0
    assert all(len(numbers) == 2 for numbers in algorithms["a_b"]["seed_0"]["absolute_metrics"].values())


def test_marl_eval_has_the_floors_that_all_policies_have(rows):
    (group,) = grouped(rows[1:])
    (algorithms,) = marl_eval([group], values_of(rows))["lidarium"].values()
    times = {policy: len(runs["seed_0"]["absolute_metrics"]["t99_s"]) for policy, runs in algorithms.items()}
    assert times == {"a_b": 1, "c": 1}


def test_marl_eval_has_no_seed_that_a_policy_lacks(rows):
    (group,) = grouped([row for row in rows if row["policy"] == "c" or row["seed"] == 0])
    (algorithms,) = marl_eval([group], values_of(rows))["lidarium"].values()
    assert {policy: set(runs) for policy, runs in algorithms.items()} == {"a_b": {"seed_0"}, "c": {"seed_0"}}


def test_the_table_in_latex_has_a_line_for_each_policy(rows):
    (group,) = grouped(rows)
    figures = {policy: time_figure(runs, "t99_s", group.horizon_s, 0) for policy, runs in group.runs.items()}
    lines = latex_table([group], [figures]).splitlines()
    (line,) = [each for each in lines if "a\\_b" in each]
    assert line.startswith(f"{group.title} & ")
    assert line.count("&") == 4
    assert r"50\,\%" in line
    assert line.endswith(r"\\")
    assert (lines[0], lines[-1]) == (r"\begin{tabular}{llrrr}", r"\end{tabular}")


def test_nothing_in_a_name_has_a_meaning_to_latex():
    assert escaped("a_b & 50 % \\") == r"a\_b \& 50 \% \textbackslash{}"

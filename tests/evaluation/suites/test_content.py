"""What a suite holds is checked with words that name it."""

import pytest

from lidarium.evaluation.suites.content import (
    MOST_EACH,
    ROBOTS,
    check_members,
    check_numbers,
    check_texts,
    check_trials,
    listed,
    seeds_of,
    starts_of,
    tables_of,
)


def test_a_number_of_seeds_is_counted_from_0():
    assert seeds_of(3, {"seeds": 3}) == (0, 1, 2)
    assert seeds_of([5, 9], {"seeds": [5, 9]}) == (5, 9)


def test_one_name_stands_for_a_list_of_it():
    assert listed({"floors": "clinic"}, "floors") == ("clinic",)
    assert listed({"floors": ["clinic", "office"]}, "floors") == ("clinic", "office")


def test_teams_of_starts_are_kept_by_floor():
    content = {"clinic": [[[1, 2.0, 0.5]], [[1, 2, 0], [3, 4, 0]]]}
    assert starts_of(content) == {"clinic": (((1, 2.0, 0.5),), ((1, 2, 0), (3, 4, 0)))}
    assert starts_of({}) == {}


def test_tables_are_copies():
    content = {"noisy": {"noise": "datasheet"}}
    tables_of(content, "variants")["noisy"]["noise"] = "none"
    assert content == {"noisy": {"noise": "datasheet"}}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: check_members("floors", []), "has no floors; want at least one"),
        (lambda: check_members("floors", ["a", "b", "a"]), "names 'a' twice among its floors"),
        (lambda: check_members("floors", [["a"]]), "among its floors; want names or numbers"),
        (lambda: check_members("seeds", range(MOST_EACH + 1)), "has 1,000,001 seeds"),
        (lambda: check_numbers("robots", [2, 2.5], ROBOTS), "robots of the suite has 2.5"),
        (lambda: check_texts("floors", ["a", 3]), "floors of the suite has 3; want names"),
        (lambda: check_trials(10_000, 1001), "has 10,010,000 episodes"),
        (lambda: seeds_of(0, {"seeds": 0}), "seeds of the suite is 0"),
        (lambda: seeds_of(True, {"seeds": 2.5}), "seeds of the suite is 2.5; want a list"),
        (lambda: tables_of({"a": 3}, "variants"), r"as in \[variants.name\]"),
        (lambda: starts_of([1]), "want a table of teams by floor"),
        (lambda: starts_of({"clinic": [[[1.0, 2.0]]]}), r"a start on 'clinic' is .*; want x, y"),
        (lambda: starts_of({"clinic": [[1.0, 2.0, 3.0]]}), "starts on 'clinic' has 1.0"),
        (lambda: starts_of({"clinic": [[[1.0, 2.0, float("nan")]]]}), "a start on 'clinic'"),
    ],
)
def test_what_a_suite_cannot_hold_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_trials_up_to_the_limit_are_fine():
    check_trials(10_000, 1000, 0)
    check_members("floors", ["a"])

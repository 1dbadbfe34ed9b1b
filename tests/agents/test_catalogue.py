"""Policies by name."""

import pytest

from lidarium.agents import make_policy, policy_names, register_policy


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [("nearest_frontir", "nearest_frontier"), ("randomwalk", "random_walk"), ("zoo:mapo-2", "zoo:mappo-2")],
)
def test_an_unknown_policy_is_refused_with_the_nearest_name(wrong, meant):
    with pytest.raises(ValueError, match=f"did you mean '{meant}'"):
        make_policy(wrong)


def test_a_name_that_is_nothing_like_any_lists_all():
    with pytest.raises(ValueError, match=r"unknown policy 'zzz' \(known: random_walk, "):
        make_policy("zzz")


def test_a_name_is_registered_once():
    with pytest.raises(ValueError, match="registered already"):
        register_policy("random_walk", object, "another")


def test_an_unknown_setting_is_refused_with_the_nearest_name():
    with pytest.raises(ValueError, match=r"policy 'random_walk': unknown setting .*'sped'"):
        make_policy("random_walk", sped=1.0)


def test_names_come_in_order_with_a_line_about_each():
    names = policy_names()
    assert list(names) == sorted(names)
    assert all(summary and "\n" not in summary for summary in names.values())

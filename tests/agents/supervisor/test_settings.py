import pytest

from lidarium.agents.supervisor.settings import SupervisorSettings


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("period_s", 0.0),
        ("merge_period_s", -1.0),
        ("same_goal_m", float("nan")),
        ("assignment", "greedy"),
        ("returns_home", 1),
        ("searches_per_merge", 0),
        ("searches_per_merge", 1.5),
        ("battery_margin", float("inf")),
        ("cost_weight", "much"),
    ],
)
def test_settings_that_cannot_be_used_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        SupervisorSettings(**{name: value})

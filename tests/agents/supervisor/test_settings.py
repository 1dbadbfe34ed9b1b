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


def test_robots_without_a_goal_are_paused_or_have_ended_but_not_both():
    with pytest.raises(ValueError, match="pauses_idle and is_stop_final"):
        SupervisorSettings(pauses_idle=True, is_stop_final=True)

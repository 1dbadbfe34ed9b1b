"""The systems of the theses as they were printed, as policies by name."""

import pytest

import lidarium
from lidarium.agents.srt.settings import THESIS
from lidarium.mapping.merging.settings import merge_settings


def test_the_supervisor_of_the_thesis_merges_by_its_rules_every_second_and_stops_for_good():
    settings = lidarium.policy("supervised:thesis").settings
    assert (settings.merging, settings.merge_period_s, settings.period_s, settings.is_stop_final) == (
        "thesis",
        1.0,
        10.0,
        True,
    )
    env = lidarium.parallel_env(
        "apartment", robots=2, known_starts=False, horizon_s=15.0, resolution=0.05, starts="fixed"
    )
    policy = lidarium.policy("supervised:thesis")
    lidarium.run_episode(policy, env, seed=0)
    station = policy._supervisor.station
    assert station._merge == merge_settings("thesis", 0.05)
    assert len(policy.merge_seconds) >= 12


def test_the_tree_of_the_thesis_has_its_settings_and_own_ones_come_first():
    policy = lidarium.policy("srt:thesis", speed=0.25)
    assert policy.settings.speed == 0.25
    assert policy.settings.margin == THESIS["margin"]
    assert policy.settings.memory == "regions"


def test_a_supervised_tree_explores_on_the_map_that_the_station_has_merged():
    policy = lidarium.Supervised(lidarium.policy("srt"), period_s=5.0)
    env = lidarium.parallel_env(
        "apartment", robots=2, known_starts=False, resolution=0.05, stop_coverage=0.97, starts="fixed"
    )
    lidarium.run_episode(policy, env, seed=1)
    assert env.scorer.coverage >= 0.97
    assert policy.joins
    shared, own = (env.belief("robot_0").shared_map, env.belief("robot_0").map)
    assert shared is not None
    assert (shared.log_odds != 0).sum() > 1.2 * (own.log_odds != 0).sum()


@pytest.mark.parametrize("name", ["supervised:thesi", "srt:tehsis"])
def test_a_misspelt_policy_of_a_thesis_is_refused(name):
    with pytest.raises(ValueError, match=f"did you mean '{name.partition(':')[0]}:thesis'"):
        lidarium.policy(name)

"""What a run takes where options are left out."""

from pathlib import Path

import pytest

from lidarium.scripts.commands.run import (
    LONE_POLICY,
    TEAM_POLICY,
    TEAM_WORLD,
    Run,
    _completed,
    _parsed_starts,
    folder_of,
)


def test_a_team_is_supervised_in_a_world_in_which_robots_need_each_other():
    team = _completed(Run(robots=2))
    assert team.chosen_policy == TEAM_POLICY
    assert team.unknown_starts
    assert {name: getattr(team, name) for name in TEAM_WORLD} == TEAM_WORLD
    given = _completed(Run(robots=2, noise="none"))
    assert given.chosen_policy == TEAM_POLICY
    assert (given.noise, given.odometry) == ("none", None)
    assert _completed(Run(robots=2, realism="lab")).localization is None
    assert _completed(Run(robots=2, given=frozenset({"realism"}))).localization is None  # --realism ideal


def test_one_robot_and_robots_with_a_goal_drive_to_the_nearest_frontier():
    assert _completed(Run(robots=1)).chosen_policy == LONE_POLICY
    chosen = Run(robots=3, policy="random_walk")
    assert _completed(chosen) is chosen


def test_starts_are_words_or_numbers_of_each_robot():
    assert _parsed_starts("drawn", 4) == "drawn"
    assert _parsed_starts("1.0,2.5,0;4,2,1.57;", 2).tolist() == [[1.0, 2.5, 0.0], [4.0, 2.0, 1.57]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2", "--starts is '1,2'; want"),
        ("1,2,3;4,5", "--starts is"),
        ("a,b,c", "--starts is 'a,b,c'"),
        ("1,2,inf", "--starts is"),
        ("", "--starts is ''"),
        ("1,2,3", "has 1 starts for 2 robots"),
    ],
)
def test_starts_that_cannot_be_read_are_refused(text, message):
    with pytest.raises(ValueError, match=message):
        _parsed_starts(text, 2)


def test_films_and_the_folder_are_named_by_what_is_run():
    assert Run(video=True, gif=True).films == ["run.mp4", "run.gif"]
    assert Run().films == []
    assert folder_of(Run(policy="random_walk", seed=4), "maps/a b") == Path("runs/maps-a-b-random_walk-4")
    assert folder_of(Run(out=Path("here")), "apartment") == Path("here")

"""Actions of all rows become speeds, waypoints or frontiers."""

import numpy as np
import pytest
from driven_teams import HALL, ROOMS, Teams

from lidarium.envs.levels.row_levels import FrontierLevel, VelocityLevel, WaypointLevel, check_actions, make_level
from lidarium.envs.engine.running import DECIDES, STEPS, WAITS
from lidarium.envs.simulation.endings import FRONTIER_UNREACHABLE, NO_FRONTIER

ALL = np.ones(4, np.bool_)


@pytest.fixture
def teams():
    return Teams((ROOMS, HALL), (1, 2))


def modes_of(*modes):
    return np.array(modes, np.int8)


def observed(level, seen=ALL):
    out = {name: np.zeros((4, *(box.shape or ())), box.dtype) for name, box in level.boxes.items()}
    infos = {}
    level.observe(ALL, ALL, seen, out, infos)
    return out, infos


def frontier_level(teams):
    level = FrontierLevel(teams.perception, teams.settings)
    for episode in range(teams.episodes):
        level.start(episode)
    return level


def test_actions_have_the_shape_and_are_finite_where_robots_live():
    live = np.array([True, False])
    assert check_actions([[1, 2], [np.nan, 0]], (2, 2), live, "two numbers")[0].tolist() == [1.0, 2.0]
    for actions, words in (
        ([[1, 2], [3]], r"actions are .*; want an array \(2, 2\): two numbers for each row"),
        (np.zeros((3, 2)), r"shape \(3, 2\); want \(2, 2\): two numbers for each row, row = episode"),
        ([["a", "b"], ["c", "d"]], "actions are of type .*; want two numbers for each row"),
        ([[np.inf, 0], [0, 0]], "the action of row 0 is .*, nan or infinite; want two numbers"),
    ):
        with pytest.raises(ValueError, match=words):
            check_actions(actions, (2, 2), live, "two numbers")


def test_shares_become_speeds_and_who_has_ended_stands(teams):
    level, commands, modes = VelocityLevel(teams.settings), np.ones((4, 2)), modes_of(STEPS, WAITS)
    shares = np.array([[0.5, -0.5], [2.0, 0.0], [-1.0, 0.25], [1.0, 1.0]])
    assert level.take(shares, np.array([True, True, True, False]), commands, modes) is None
    speed, turn_rate = teams.settings.speed_limits[0]
    wanted = np.array([[0.5 * speed, -0.5 * turn_rate], [speed, 0.0], [-speed, 0.25 * turn_rate], [0.0, 0.0]])
    assert commands == pytest.approx(wanted)
    assert modes.tolist() == [STEPS, WAITS]


def test_a_waypoint_is_a_share_of_half_the_observed_map(teams):
    level, modes = WaypointLevel(teams.perception, teams.settings), modes_of(STEPS, WAITS)
    shares = np.array([[1.0, -0.5], [0.0, 9.0], [0.1, 0.1], [0.0, 0.0]])
    level.take(shares, np.array([True, True, False, False]), np.zeros((4, 2)), modes)
    half = 0.5 * teams.settings.map_cells * teams.settings.occupancy.resolution
    places = teams.simulation.beliefs.believed[:2, :2] - teams.offsets[:2]
    assert level.drives.targets[:2] == pytest.approx(places + half * np.array([[1.0, -0.5], [0.0, 1.0]]))
    assert level.drives.is_ordered.tolist() == [True, True, False, False]
    assert modes.tolist() == [DECIDES, WAITS]
    _, infos = observed(level)
    assert [state.value for state in infos["drive"][2:]] == ["idle", "idle"]
    assert infos["_drive"].all()


def test_a_frontier_is_driven_to_and_an_action_that_is_no_number_of_one_refused(teams):
    level = frontier_level(teams)
    most = teams.settings.frontiers
    out, _ = observed(level)
    assert (out["action_mask"][:, 0] == 1).all()
    modes = modes_of(STEPS, STEPS)
    stopping = level.take(np.array([0, most, 0, most]), ALL, np.zeros((4, 2)), modes)
    assert not stopping.any()
    assert modes.tolist() == [DECIDES, DECIDES]
    assert level.drives.is_ordered.tolist() == [True, False, True, False]
    places = teams.simulation.beliefs.believed[:, :2] - teams.offsets
    for row in (0, 2):
        assert level.drives.targets[row] == pytest.approx(places[row] + out["frontiers"][row, 0, :2])
    for number in (-1, most + 1, 0.5):
        with pytest.raises(ValueError, match=rf"row 2 is {number}.*; want a whole number from 0 to {most}"):
            level.take(np.array([0, 0, number, 0]), ALL, np.zeros((4, 2)), modes_of(STEPS, STEPS))


def test_a_team_without_offers_ends_and_stands_for_a_step(teams):
    level, modes = frontier_level(teams), modes_of(STEPS, STEPS)
    observed(level)
    level.start(1)
    commands = np.ones((4, 2))
    stopping = level.take(np.zeros(4, np.int64), np.array([True, True, True, False]), commands, modes)
    assert stopping.tolist() == [0, 0, FRONTIER_UNREACHABLE, 0]
    assert modes.tolist() == [DECIDES, STEPS]
    assert not commands[2:].any()
    teams.perception.own_map(2)
    navigation = teams.perception.planning_map(2, True)
    navigation.frontiers.flags[:] = 0
    stopping = level.take(np.zeros(4), ALL, commands, modes_of(WAITS, STEPS))
    assert stopping[2:].tolist() == [NO_FRONTIER, NO_FRONTIER]


def test_a_level_is_made_by_its_name(teams):
    kinds = {"velocity": VelocityLevel, "waypoint": WaypointLevel, "frontier": FrontierLevel}
    for name, kind in kinds.items():
        assert type(make_level(name, teams.perception, teams.settings)) is kind
    with pytest.raises(ValueError, match="level is 'thought'; want velocity, waypoint or frontier"):
        make_level("thought", teams.perception, teams.settings)

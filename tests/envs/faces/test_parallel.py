"""The environment: what reset and step take, give and refuse, and every way in which an episode ends."""

import copy
import math

import numpy as np
import pytest
from all_observed import ALL

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import ENDED

STAY = np.zeros(2, np.float32)
AHEAD = np.array([1.0, 0.0], np.float32)
WALL_ACROSS = Solid(np.array([[2.0, 0.0], [2.2, 0.0], [2.2, 4.0], [2.0, 4.0]]))


def box(width=5.0, height=4.0, solids=(), starts=((1.0, 1.0, 0.0), (1.0, 3.0, 0.0)), goal=None):
    return Floor("box", (0.0, 0.0, width, height), tuple(solids), starts=np.array(starts, np.float64), goal=goal)


def make(floor=None, **options):
    options = {"robots": 2, "stop_coverage": None, "map_cells": 64, "observe": ALL, **options}
    return lidarium.parallel_env(box() if floor is None else floor, **{"starts": "fixed", **options})


def step_all(env, action=STAY):
    return env.step(dict.fromkeys(env.agents, action))


def until_end(env, action=STAY, limit=500):
    """Step until an agent ends; the last outcome."""
    for _ in range(limit):
        outcome = step_all(env, action)
        if any(outcome[2].values()) or any(outcome[3].values()):
            return outcome
    raise AssertionError("no agent ended")


def test_a_reset_gives_an_observation_and_the_truth_to_every_agent():
    env = make(robots=2)
    observations, infos = env.reset(seed=0)
    assert env.agents == env.possible_agents == ["robot_0", "robot_1"]
    for agent, observation in observations.items():
        assert set(observation) == {"scan", "pose", "velocity", "bumper", "map"}
        assert observation["scan"].shape == (727,)
        assert observation["map"].shape == (1, 64, 64)
        assert set(infos[agent]["truth"]) == {"pose", "coverage", "seen_cells"}
        assert np.array_equal(infos[agent]["truth"]["pose"], env.world.poses[int(agent[-1])])


def test_the_first_scan_is_taken_before_anything_moves():
    env = make()
    observations, infos = env.reset(seed=0)
    assert np.array_equal(env.world.poses, [[1.0, 1.0, 0.0], [1.0, 3.0, 0.0]])
    assert (observations["robot_0"]["map"] == 255).any()
    assert observations["robot_0"]["scan"][363] == pytest.approx(4.0, abs=1e-3)
    assert infos["robot_0"]["truth"]["coverage"] > 0.2
    assert env.scorer.time == 0.0


def test_with_known_starts_positions_are_from_the_corner_of_the_start_cell_and_headings_true():
    env = make(box(starts=[(1.013, 2.037, 0.7), (3.0, 2.0, -2.0)]))
    observations, _ = env.reset(seed=0)
    assert observations["robot_0"]["pose"] == pytest.approx([0.013, 0.037, 0.7], abs=1e-6)
    assert observations["robot_1"]["pose"][2] == pytest.approx(-2.0)
    assert (np.abs(observations["robot_1"]["pose"][:2]) <= 0.05).all()
    for _ in range(20):
        observations = step_all(env, np.array([0.4, 0.1], np.float32))[0]
    gone = observations["robot_0"]["pose"][:2] - [0.013, 0.037]
    assert gone == pytest.approx(env.world.poses[0, :2] - [1.013, 2.037], abs=1e-5)


def test_with_unknown_starts_the_first_pose_is_zero_and_nobody_is_told_the_frame():
    env = make(box(starts=[(1.013, 2.037, 0.7), (3.0, 2.0, -2.0)]), known_starts=False)
    observations, _ = env.reset(seed=0)
    for agent, observation in observations.items():
        assert observation["pose"].tolist() == [0.0, 0.0, 0.0]
        belief = env.belief(agent)
        assert belief.shared_map is None
        assert belief.teammates == {}
    for _ in range(10):
        observations = step_all(env, AHEAD)[0]
    # In its own frame a robot that drove straight on has gone along x.
    assert observations["robot_0"]["pose"][0] > 0.3
    assert observations["robot_0"]["pose"][1:] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_the_map_shows_the_cells_around_the_robot_along_the_axes_of_its_frame():
    env = make(box(starts=[(1.0, 2.0, 2.1)]), robots=1)
    observation = env.reset(seed=0)[0]["robot_0"]
    row, column = 32, 32
    assert observation["map"][0, row, column] == 255
    # The wall at x = 0 is twenty cells to the left; what is behind it stays unknown.
    assert observation["map"][0, row, column - 21] == 0
    assert (observation["map"][0, row, : column - 22] == 127).all()


def test_actions_are_shares_of_the_limits_and_clipped():
    env = make(robots=1)
    for action in ([1.0, 0.0], [7.0, 0.0]):
        env.reset(seed=0)
        for _ in range(15):
            step_all(env, np.array(action, np.float32))
        assert env.world.velocities[0, 0] == pytest.approx(0.77)
    env.reset(seed=0)
    for _ in range(10):
        step_all(env, np.array([-0.5, 0.5], np.float32))
    assert env.world.velocities[0] == pytest.approx([-0.385, 1.57])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_actions_that_are_not_finite_are_refused(value):
    env = make(robots=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="nan or infinite"):
        step_all(env, np.array([value, 0.0], np.float32))


def test_no_return_reads_as_the_range_and_a_hit_as_less():
    env = make(box(12.0, 12.0, starts=[(6.0, 6.0, 0.0)]), robots=1)
    scan = env.reset(seed=0)[0]["robot_0"]["scan"]
    assert scan.max() == np.float32(5.6)
    env = make(box(6.6, 4.0, starts=[(1.0 + 2e-4, 2.0, 0.0)]), robots=1)
    scan = env.reset(seed=0)[0]["robot_0"]["scan"]
    assert scan[363] == np.float32(np.float64(np.float32(5.6)) - 1e-3)


# ---- endings


def test_covered_ends_all_robots_at_once():
    env = make(stop_coverage=0.9)
    env.reset(seed=0)
    outcome = until_end(env, np.array([0.0, 0.5], np.float32))
    assert all(outcome[2].values())
    assert not any(outcome[3].values())
    assert {info["ended_because"] for info in outcome[4].values()} == {"covered"}
    assert env.agents == []
    assert env.scorer.ended_because == {"robot_0": "covered", "robot_1": "covered"}
    assert env.scorer.coverage >= 0.9


def test_the_horizon_truncates_all_robots_after_its_steps():
    env = make(horizon_s=2.0)
    env.reset(seed=0)
    while env.agents:
        outcome = step_all(env)
    assert env.world.steps[0] == 20
    assert all(outcome[3].values())
    assert not any(outcome[2].values())
    assert {info["ended_because"] for info in outcome[4].values()} == {"horizon"}


def test_no_horizon_goes_on():
    env = make(horizon_s=None)
    env.reset(seed=0)
    for _ in range(700):
        env.drive_at(np.zeros((2, 2)))
    assert step_all(env)[3] == {"robot_0": False, "robot_1": False}


def test_a_robot_at_the_goal_has_reached_it_and_the_others_go_on():
    env = make(box(goal=(2.0, 1.0)), goal_radius=0.25)
    observations, _ = env.reset(seed=0)
    assert observations["robot_0"]["goal"] == pytest.approx([1.0, 0.0], abs=0.05)
    outcome = until_end(env, AHEAD)
    assert outcome[2] == {"robot_0": True, "robot_1": False}
    assert outcome[4]["robot_0"]["ended_because"] == "reached"
    assert "ended_because" not in outcome[4]["robot_1"]
    assert math.dist(env.world.poses[0, :2], (2.0, 1.0)) <= 0.25
    assert env.agents == ["robot_1"]


@pytest.mark.parametrize(("goal", "told"), [((9.0, 1.0), "outside of the floor"), ((2.1, 1.0), "inside a wall")])
def test_a_goal_that_no_robot_can_be_at_is_refused_before_the_run(goal, told):
    env = make(box(solids=[WALL_ACROSS], goal=(1.5, 3.0)))
    with pytest.raises(ValueError, match=told):
        env.reset(seed=1, options={"goal": goal})


@pytest.mark.parametrize(("x", "told"), [(9.0, "inside a wall"), (0.1, "does not fit at start")])
def test_a_kidnapping_to_where_no_robot_fits_is_refused_before_the_run(x, told):
    faults = FaultSettings(schedule=[Fault(kind="kidnapping", robot=1, at_s=0.2, place=(x, 2.0, 0.0))])
    with pytest.raises(ValueError, match=rf"the place of fault 0 does not fit robot 1: .*{told}"):
        make(box(), faults=faults).reset(seed=1)


def test_a_goal_is_refused_where_none_is_observed():
    env = make(box())
    with pytest.raises(ValueError, match=r"option goal is \(2.0, 1.0\), but the floor of the environment has no goal"):
        env.reset(seed=1, options={"goal": (2.0, 1.0)})


def test_the_goal_stays_where_it_is_as_the_frame_of_the_pose_sees_it():
    env = make(box(goal=(4.0, 3.0)))
    observations, _ = env.reset(seed=0)
    first = observations["robot_0"]["goal"].copy()
    for _ in range(10):
        observations = step_all(env, AHEAD)[0]
    assert np.array_equal(observations["robot_0"]["goal"], first)
    gap = observations["robot_0"]["goal"] - observations["robot_0"]["pose"][:2]
    assert gap == pytest.approx(np.array([4.0, 3.0]) - env.world.poses[0, :2], abs=1e-5)


def test_a_goal_given_at_reset_replaces_that_of_the_floor():
    env = make(box(goal=(4.0, 3.0)))
    env.reset(seed=0, options={"goal": (2.0, 1.0)})
    assert env.goal == (2.0, 1.0)
    env.reset(seed=0)
    assert env.goal == (4.0, 3.0)


@pytest.mark.parametrize(
    "reason", ["no_frontier", "frontier_unreachable", "stopped", "unreachable", "battery is tired"]
)
def test_a_robot_that_is_stopped_ends_at_the_next_step_with_that_reason(reason):
    env = make()
    env.reset(seed=0)
    env.stop("robot_0", reason)
    assert env.agents == ["robot_0", "robot_1"]
    outcome = env.step({"robot_1": STAY})
    assert outcome[2] == {"robot_0": True, "robot_1": False}
    assert outcome[4]["robot_0"]["ended_because"] == reason
    assert env.agents == ["robot_1"]
    with pytest.raises(ValueError, match=r"robot_0 is not among the live agents \['robot_1'\]"):
        env.stop("robot_0", reason)


def test_contact_ends_a_robot_where_it_should_and_costs_only_otherwise():
    facing = box(starts=[(0.6, 1.0, math.pi), (1.0, 3.0, 0.0)])
    env = make(facing, stop_on_contact=True)
    env.reset(seed=0)
    outcome = until_end(env, AHEAD)
    assert outcome[2]["robot_0"]
    assert outcome[4]["robot_0"]["ended_because"] == "collision"
    assert outcome[0]["robot_0"]["bumper"].tolist() == [0, 1, 0]
    env = make(facing)
    env.reset(seed=0)
    rewards = [step_all(env, AHEAD)[1] for _ in range(15)]
    assert env.agents == ["robot_0", "robot_1"]
    assert rewards[-1]["robot_0"] < -0.1
    assert env.world.collisions.tolist() == [1, 0]


def test_a_robot_that_ends_leaves_the_agents_and_its_body_stays():
    env = make(box(starts=[(1.0, 2.0, 0.0), (2.0, 2.0, 0.0)]))
    env.reset(seed=0)
    env.stop("robot_1", "stopped")
    env.step({"robot_0": STAY})
    assert env.world.flags[1] & ENDED
    place = env.world.poses[1].copy()
    for _ in range(40):
        observations = env.step({"robot_0": AHEAD})[0]
        assert set(observations) == {"robot_0"}
    assert np.array_equal(env.world.poses[1], place)
    assert env.world.poses[0, 0] == pytest.approx(2.0 - 0.36, abs=1e-5)
    assert observations["robot_0"]["bumper"][1] == 1
    assert observations["robot_0"]["scan"][363] == pytest.approx(0.18, abs=1e-4)
    # A new episode has the whole team again.
    env.reset(seed=0)
    assert env.agents == ["robot_0", "robot_1"]
    assert not env.world.flags[1] & ENDED


def test_a_robot_that_drives_when_it_is_stopped_does_not_go_on_driving():
    env = make(box(starts=[(1.0, 2.0, 0.0), (1.0, 3.0, 0.0)]))
    env.reset(seed=0)
    for _ in range(10):
        step_all(env, AHEAD)
    env.stop("robot_0", "stopped")
    env.step({"robot_1": STAY})
    place = env.world.poses[0].copy()
    for _ in range(5):
        step_all(env, AHEAD)
    assert np.array_equal(env.world.poses[0], place)


def test_the_reason_for_ending_outranks_the_horizon():
    env = make(horizon_s=0.1)
    env.reset(seed=0)
    env.stop("robot_0", "no_frontier")
    outcome = step_all(env)
    assert (outcome[2]["robot_0"], outcome[3]["robot_0"]) == (True, False)
    assert (outcome[2]["robot_1"], outcome[3]["robot_1"]) == (False, True)
    assert env.agents == []


# ---- misuse


def test_a_step_before_the_reset_is_refused_and_one_after_the_end_gives_nothing():
    env = make(horizon_s=0.1)
    with pytest.raises(RuntimeError, match=r"call reset\(\) before step\(\)"):
        env.step({})
    env.reset(seed=0)
    step_all(env)
    assert env.step({}) == ({}, {}, {}, {}, {})


def test_a_missing_action_and_nan_are_refused_by_name():
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"no action for robot_1; step\(\) needs one for every agent"):
        env.step({"robot_0": STAY})
    with pytest.raises(ValueError, match="nan"):
        env.step({"robot_0": STAY, "robot_1": np.array([math.nan, 0.0])})
    with pytest.raises(ValueError, match=r"action of robot_1 .* want two numbers"):
        env.step({"robot_0": STAY, "robot_1": np.zeros(3)})
    assert env.scorer.time == 0.0
    step_all(env)
    assert env.scorer.time == pytest.approx(0.1)


def test_unknown_reset_options_are_ignored():
    env = make()
    first = env.reset(seed=0)[0]
    second = env.reset(seed=0, options={"colour": "red", "episodes": [1]})[0]
    assert np.array_equal(first["robot_0"]["scan"], second["robot_0"]["scan"])


def test_starts_given_at_reset_are_taken():
    env = make()
    starts = np.array([[2.0, 2.0, 1.0], [4.0, 1.0, -1.0]])
    env.reset(seed=0, options={"starts": starts})
    assert np.array_equal(env.world.poses, starts)


@pytest.mark.parametrize("known_starts", [True, False])
@pytest.mark.parametrize("turns", [-1, 1, 3])
def test_headings_of_starts_are_told_within_half_a_turn(known_starts, turns):
    starts = np.array([[2.0, 2.0, 1.0 + 2.0 * math.pi * turns], [4.0, 1.0, -math.pi]])
    for floor, options in [(box(), {"starts": starts}), (box(starts=starts), {})]:
        env = make(floor, known_starts=known_starts)
        observations, _ = env.reset(seed=0, options=options)
        assert all(env.observation_space(agent).contains(observation) for agent, observation in observations.items())
        assert env.world.poses[:, 2] == pytest.approx([1.0, math.pi])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"starts": [[1.0, 1.0, 0.0]]}, r"want \(2, 3\)"),
        ({"starts": [[0.05, 1.0, 0.0], [2.0, 2.0, 0.0]]}, "does not fit"),
        ({"starts": [[-3.0, 1.0, 0.0], [2.0, 2.0, 0.0]]}, "inside a wall"),
        ({"starts": [[1.0, 1.0, 0.0], [1.2, 1.0, 0.0]]}, "apart"),
        ({"goal": (math.nan, 1.0)}, "goal"),
        ({"floor": "apartmnt"}, "did you mean 'apartment'"),
    ],
)
def test_known_reset_options_with_bad_values_are_refused(options, words):
    env = make()
    with pytest.raises(ValueError, match=words):
        env.reset(seed=0, options=options)
    env.reset(seed=0)
    step_all(env)


def test_a_floor_given_at_reset_is_taken_for_that_episode_only():
    env = make()
    env.reset(seed=0, options={"floor": "scene_corner"})
    assert env.floor.name == "scene_corner"
    env.reset(seed=0)
    assert env.floor.name == "box"


@pytest.mark.parametrize(
    ("floor", "options", "words"),
    [
        (box(0.3, 0.3, starts=np.zeros((0, 3))), {"robots": 1}, "fit"),
        (box(starts=[(0.0, -2.0, 0.0)]), {"robots": 1}, "inside a wall"),
        (box(1.5, 1.5, starts=np.zeros((0, 3))), {"robots": 12}, "12 robots"),
        ("no_such_floor", {}, "no floor called"),
        (box(solids=[WALL_ACROSS], starts=[(1.0, 1.0, 0.0), (4.0, 1.0, 0.0)]), {}, "disconnected"),
    ],
)
def test_a_team_that_cannot_be_placed_is_refused_with_the_cause(floor, options, words):
    with pytest.raises(ValueError, match=words):
        make(floor, **options).reset(seed=0)


def test_a_missing_file_is_not_found():
    with pytest.raises(FileNotFoundError):
        make("no/such/map.yaml").reset(seed=0)


def test_an_unknown_level_or_render_mode_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="known: velocity, waypoint, frontier"):
        make(level="fly")
    with pytest.raises(ValueError, match="human, rgb_array or None"):
        make(render_mode="ascii")


# ---- rewards and the rest


def test_rewards_are_the_settings_weights():
    free = ExplorationEnv(box(), make_settings(robots=2, map_cells=64, stop_coverage=None))
    free.reset(seed=0)
    before = free.scorer.coverage
    total = 0.0
    for _ in range(20):
        total += sum(step_all(free, np.array([0.3, 0.4], np.float32))[1].values())
    area = (free.scorer.coverage - before) * free.score.counted[0] * 0.05**2
    assert total == pytest.approx(area - 20 * 2 * 0.01 * 0.1 - 0.01 * free.world.travelled.sum(), abs=1e-9)


def test_a_team_on_a_floor_of_cells_and_at_other_resolutions():
    solid = np.zeros((80, 100), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    floor = Floor("image", (0.0, 0.0, 5.0, 4.0), cells=Raster(solid, (0.0, 0.0), 0.05))
    for resolution, raster in [(0.05, 0.05), (0.1, 0.05), (0.025, 0.025), (0.05, 0.01)]:
        env = make(floor, resolution=resolution, raster_resolution=raster, stop_coverage=0.99)
        env.reset(seed=1)
        until_end(env, np.array([0.2, 0.6], np.float32), 900)
        assert env.scorer.ended_because["robot_0"] == "covered"


def test_state_is_the_truth_of_the_whole_team():
    env = make()
    env.reset(seed=0)
    step_all(env, AHEAD)
    assert env.state().dtype == np.float32
    assert env.state_space.contains(env.state())


def test_default_settings_are_a_team_of_three_for_ten_minutes():
    env = lidarium.parallel_env()
    assert env.settings == ExplorationSettings(observe=("scan", "velocity", "bumper", "map"), starts="drawn")
    assert len(env.possible_agents) == 3
    env.reset(seed=0)
    assert env.floor.name == "apartment"


def test_any_word_of_a_policy_ends_a_robot_for_good():
    env = lidarium.parallel_env("apartment", robots=2, resolution=0.1)
    env.reset(seed=0)
    _, _, terminated, truncated, infos = env.step({"robot_0": lidarium.Stop(""), "robot_1": lidarium.Stop("horizon")})
    assert terminated == {"robot_0": True, "robot_1": True}
    assert truncated == {"robot_0": False, "robot_1": False}
    assert [infos[agent]["ended_because"] for agent in ("robot_0", "robot_1")] == ["stopped", "horizon"]
    assert not env.agents


@pytest.mark.parametrize("level", ["frontier", "tour", "waypoint", "graph"])
def test_after_another_level_is_chosen_an_episode_has_to_begin(level):
    env = lidarium.parallel_env("apartment", robots=2, lidar={"beams": 40})
    env.reset(seed=0)
    env.use_level(level)
    assert env.agents == []
    with pytest.raises(RuntimeError, match="call reset"):
        env.step({agent: env.action_space(agent).sample() for agent in env.possible_agents})
    env.reset(seed=0)
    env.step({agent: lidarium.Target(0.0, 0.0) for agent in env.agents})


def test_a_level_without_the_form_that_is_asked_for_changes_nothing():
    env = lidarium.parallel_env("apartment", robots=1, level="frontier", lidar={"beams": 40}, action_mask="beside")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action_mask"):
        env.use_level("velocity")
    assert env.level == "frontier"
    env.step({"robot_0": 0})
    env.reset(seed=0)


def test_an_agent_that_has_ended_cannot_be_stopped_again():
    env = make(level="waypoint", ended_agents="zeros", horizon_s=60.0)
    env.reset(seed=0)
    env.stop("robot_0", "done")
    step_all(env)
    with pytest.raises(ValueError, match=r"robot_0 is not among the live agents \['robot_1'\]"):
        env.stop("robot_0", "done")
    before = env.time_s
    env.step(dict.fromkeys(env.agents, np.array([0.3, 0.3], np.float32)))
    assert env.time_s > before + 0.5


def test_targets_of_an_earlier_episode_do_not_change_a_later_one():
    def episode(env):
        env.reset(seed=3)
        ahead = dict.fromkeys(env.agents, np.array([1.0, 0.2], np.float32))
        for _ in range(3):
            env.step(ahead)
        env.stop("robot_0", "done")
        env.step(ahead)
        with pytest.raises(ValueError, match="no action for robot_1"):
            env.step({"robot_1": None})
        return env.world.poses.copy()

    fresh, used = make(), make()
    used.reset(seed=0)
    used.step(dict.fromkeys(used.agents, lidarium.Target(0.0, 0.0)))
    assert np.array_equal(episode(fresh), episode(used))


def test_an_environment_whose_station_hears_by_radio_can_be_copied():
    env = make(radio={"kind": "range", "reach": 20.0})
    env.reset(seed=0)
    step_all(env, AHEAD)
    other = copy.deepcopy(env)
    for each in (env, other):
        for _ in range(15):
            step_all(each, AHEAD)
    assert other.report("robot_0").time_s == env.report("robot_0").time_s == 1.0
    assert np.array_equal(other.world.poses, env.world.poses)
    assert other.station is not env.station

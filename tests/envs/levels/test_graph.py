"""Robots of the level of nodes move along edges, see at nodes only, and stop where no node shows anything."""

import numpy as np
import pytest

import lidarium
from lidarium import Floor, Solid
from lidarium.envs.levels.node_graph import add_edges, frontiers_of, in_sight, pairs_of, thinned, ways_along
from lidarium.scripts.main import main

LIDAR = {
    "beams": 720,
    "field_of_view": 2.0 * np.pi,
    "range_min": 0.0,
    "range_max": 5.0,
    "noise_floor": 0.0,
    "noise_share": 0.0,
}
OPTIONS = {
    "robots": 1,
    "robot": "point",
    "lidar": LIDAR,
    "resolution": 0.1,
    "raster_resolution": 0.1,
    "stop_coverage": None,
    "starts": "fixed",
    "graph": {"spacing": 4.0, "least_utility": 0},
}


def corridor(starts=((1.05, 1.05, 0.0),)):
    walls = ((0.0, -0.2, 21.0, 0.0), (0.0, 2.0, 21.0, 2.2), (-0.2, -0.2, 0.0, 2.2), (21.0, -0.2, 21.2, 2.2))
    solids = tuple(
        Solid(np.array([[x, y], [to_x, y], [to_x, to_y], [x, to_y]]), 0.0, 2.0) for x, y, to_x, to_y in walls
    )
    return Floor("corridor", (-0.2, -0.2, 21.2, 2.2), solids, starts=np.array(starts))


def test_ways_go_around_what_is_not_known_to_be_free():
    grid = np.full((9, 9), -1, np.int8)
    grid[:7, 4] = 1  # a wall with an opening at the top
    cells = np.array([(row, column) for row in (0, 4, 8) for column in (0, 4, 8)])
    is_node = grid[cells[:, 0], cells[:, 1]] < 0
    edges = np.zeros((9, 3, 3), np.bool_)
    add_edges(grid, cells, 3, is_node, np.flatnonzero(is_node), edges)
    pairs = {tuple(pair) for pair in pairs_of(edges, 3).tolist()}
    assert pairs == {(0, 3), (3, 6), (2, 5), (5, 8), (6, 7), (7, 8)} | ({(3, 7), (5, 7)} & pairs)
    lengths, previous = ways_along(cells.astype(float), np.array(sorted(pairs - {(3, 7), (5, 7)})), 0)
    assert lengths[[3, 6, 7, 8, 5, 2]].tolist() == [4.0, 8.0, 12.0, 16.0, 20.0, 24.0]
    assert np.isinf(lengths[1])
    assert previous[2] == 5


def test_utility_counts_frontiers_in_sight_and_in_range():
    grid = np.zeros((12, 12), np.int8)
    grid[2:10, 2:10] = -1
    frontiers = np.argwhere(frontiers_of(grid))
    assert len(frontiers) == 28  # the rim of a square of eight cells
    cells = np.array([(5, 5), (2, 2)])
    assert in_sight(grid, cells, frontiers, 100.0).sum(axis=1).tolist() == [28, 28]
    assert in_sight(grid, cells, frontiers, 1.5)[1].sum() == 3
    grid[3:9, 4] = 1
    assert in_sight(grid, cells[:1], frontiers, 100.0).sum() < 28


def test_of_the_frontiers_in_a_square_the_nearest_to_its_corner_counts():
    cells = np.array([(5, 5), (6, 6), (9, 5), (3, 2), (-3, -3), (1, 7)])
    # Squares of four cells, measured from (5, 5); those at its row and column are twice as wide.
    assert thinned(cells, np.array([5.0, 5.0]), 4.0).tolist() == [[5, 5], [9, 5], [-3, -3], [1, 7]]


def test_a_frontier_counts_until_it_is_none_any_more():
    """Though another one of its square is the one that counts for the nodes that see it now."""
    env = lidarium.parallel_env(corridor(), level="graph", **{**OPTIONS, "graph": {"spacing": 1.0}})
    observations, _ = env.reset(seed=0)
    policy = lidarium.policy("nearest_node")
    policy.reset(env)
    level, most = env.engine.level, 0
    while env.agents:
        lattice = level._lattice(0)
        is_frontier = frontiers_of(level._map(0).log_odds)
        for node in np.flatnonzero(lattice.is_node & ~lattice.is_spent):
            if np.hypot(*(lattice.positions[node] - env.world.poses[0, :2])) <= 10.0:
                assert is_frontier.ravel()[lattice.seen[node]].all()
                most = max(most, len(lattice.seen[node]))
        observations, *_ = env.step(policy.act(observations))
    assert most > 0


@pytest.mark.parametrize("policy", ["nearest_node", "utility_node", "nearest_frontier", "tour_frontier"])
def test_a_corridor_takes_the_way_of_its_nodes(policy):
    env = lidarium.parallel_env(corridor(), level="graph", **OPTIONS)
    places = []
    episode = lidarium.run_episode(
        lidarium.policy(policy), env, 0, on_decision=lambda env: places.append(env.world.poses[0, 0]), level="graph"
    )
    assert np.unique(np.round(places, 6)).tolist() == [1.05, 5.05, 9.05, 13.05, 17.05]
    assert env.world.travelled[0] == pytest.approx(16.0)
    assert env.scorer.coverage > 0.999
    # Four moves at cruise speed, and the step in which the robot ends.
    speed = env.settings.robot.cruise_speed
    assert env.scorer.time == pytest.approx(16.0 / speed, abs=5 * env.settings.time_step)
    assert set(env.scorer.ended_because.values()) == {"no_frontier"}
    assert not episode.given_up


def test_robots_see_nothing_on_their_way():
    env = lidarium.parallel_env(corridor(), level="graph", **OPTIONS)
    observations, _ = env.reset(seed=0)
    before = env.scorer.coverage
    nodes = observations["robot_0"]["nodes"]
    assert nodes[0] == pytest.approx([4.0, 0.0, 4.0, nodes[0, 3]])
    assert nodes[0, 3] > 0
    assert observations["robot_0"]["action_mask"].sum() == 2
    stay = env.action_space("robot_0").n - 1
    env.step({"robot_0": stay})
    assert env.scorer.coverage == before
    env.step({"robot_0": 0})
    assert env.world.poses[0, :2] == pytest.approx([5.05, 1.05])
    # One scan at the end: 5 m beyond the node, from 1.05 + 4 + 5 m on nothing.
    assert env.scorer.coverage == pytest.approx(10.05 / 21.0, abs=0.02)


def test_two_robots_are_never_on_one_node():
    floor = corridor(((1.05, 1.05, 0.0), (5.05, 1.05, 0.0)))
    env = lidarium.parallel_env(floor, level="graph", **{**OPTIONS, "robots": 2})
    policy = lidarium.policy("nearest_node")
    observations, _ = env.reset(seed=0)
    policy.reset(env)
    for _ in range(8):
        observations, *_ = env.step(policy.act(observations))
        if not env.agents:
            break
        assert abs(env.world.poses[0, 0] - env.world.poses[1, 0]) > 1.0
    assert env.scorer.coverage > 0.999


def test_what_the_level_cannot_do_is_refused():
    with pytest.raises(ValueError, match="want localization='truth' and backend='kinematic'"):
        lidarium.parallel_env(corridor(), level="graph", **{**OPTIONS, "localization": "odometry"})
    env = lidarium.parallel_env(corridor(), level="graph", **OPTIONS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="want a node from 0 to 399, or 400 to stay"):
        env.step({"robot_0": 401})
    with pytest.raises(ValueError, match="scale of utility_node is 0"):
        lidarium.policy("utility_node", scale=0.0)


def test_an_evaluation_keeps_no_records_of_moves_along_edges(tmp_path, capsys):
    words = ["--policies", "nearest_node", "--floors", "srt_l_room", "--robots", "1", "--horizon-s", "60"]
    assert main(["evaluate", *words, "--seeds", "1", "--workers", "1", "--out", str(tmp_path / "out"), "--json"]) == 0
    assert '"record":null' in (tmp_path / "out" / "episodes.jsonl").read_text()
    assert not list(tmp_path.rglob("*.npz"))
    capsys.readouterr()


def test_time_and_idle_energy_are_those_of_the_whole_decision():
    options = {**OPTIONS, "graph": {"spacing": 1.0, "least_utility": 0}, "battery": "kobuki", "odometry": "ideal"}
    env = lidarium.parallel_env("apartment", level="graph", **options)
    env.reset(seed=0)
    *_, infos = env.step({"robot_0": 0})
    taken_s = env.unwrapped.scorer.time
    assert taken_s > 0.5
    assert infos["robot_0"]["reward_terms"]["time"] == pytest.approx(-0.01 * taken_s)
    settings, meters = env.unwrapped.settings, env.unwrapped.engine._meters
    driven = float(env.unwrapped.world.travelled[0])
    idle = meters.used_j[0] - settings.battery.per_metre_j * driven
    assert settings.battery.idle_w * taken_s <= idle <= settings.battery.idle_w * taken_s + 4.0  # and the turn

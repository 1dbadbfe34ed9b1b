"""Where another robot drove, a robot forgets what it took for walls, and sees for itself."""

import numpy as np
import pytest

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.mapping.planning.footprint import MARGIN_M, footprint_mask, passed

RESOLUTION = 0.05


@pytest.fixture
def env():
    environment = ExplorationEnv("apartment", make_settings(robots=2, known_starts=False, localization="slam"))
    environment.reset(seed=0)
    return environment


def centres(belief, cells):
    """Return the places of cells (row, column) in the robot's map frame [m]."""
    return np.asarray(belief.map_origin) + (cells[:, ::-1] + 0.5) * RESOLUTION


def test_walls_along_the_trail_become_unknown_and_nothing_else_changes(env):
    belief = env.belief("robot_0")
    before = belief.map.log_odds.copy()
    walls = np.argwhere(before > 0)
    middle = centres(belief, walls[len(walls) // 2][None])[0]
    trail = middle + np.array([(-0.4, 0.0), (0.4, 0.0), (0.4, 3.0)])
    env.perception.trails.forget_walls(0, trail)
    after = belief.map.log_odds
    where = footprint_mask(before.shape, belief.map_origin, trail, belief.radius, RESOLUTION, 0.0) & (before > 0)
    assert where[tuple(walls[len(walls) // 2])]
    assert (after[where] == 0).all()
    assert (after[~where] == before[~where]).all()


def test_what_stands_at_the_end_of_the_trail_stays(env):
    belief = env.belief("robot_0")
    before = belief.map.log_odds.copy()
    walls = np.argwhere(before > 0)
    places = centres(belief, walls)
    end = places[len(walls) // 2]
    env.perception.trails.forget_walls(0, end + np.array([(0.0, 1.0), (0.0, 0.0)]))
    near = np.hypot(*(places - end).T) < belief.radius
    assert (belief.map.log_odds[tuple(walls[near].T)] > 0).all()


def test_frontiers_open_where_walls_were_forgotten(env):
    belief = env.belief("robot_0")
    count = len(belief.map.frontiers.cells())
    walls = centres(belief, np.argwhere(belief.map.log_odds > 0))
    corner = walls[np.argmin(walls.sum(axis=1))]
    env.perception.trails.forget_walls(0, corner + np.array([(0.0, 0.5), (5.0, 0.5), (9.0, 9.0)]))
    assert len(belief.map.frontiers.cells()) > count


def test_a_wall_that_is_one_is_drawn_again_when_it_is_seen_again(env):
    belief = env.belief("robot_0")
    before = belief.map.log_odds > 0
    places = centres(belief, np.argwhere(before))
    env.perception.trails.forget_walls(0, np.array([*places, (50.0, 50.0)]))
    assert np.count_nonzero((belief.map.log_odds > 0) & before) < 0.2 * np.count_nonzero(before)
    for _ in range(5):
        env.step({agent: np.zeros(2, np.float32) for agent in env.agents})
    assert np.count_nonzero((belief.map.log_odds > 0) & before) > 0.9 * np.count_nonzero(before)


def test_a_map_that_is_rendered_anew_forgets_them_again_until_the_next_episode(env):
    perception, belief = env.perception, env.belief("robot_0")
    localizer, pose = perception.poses.localizers[0], env.beliefs.believed[0]
    assert localizer is not None
    scan, poses = env.simulation.ranges[0][None].copy(), pose[None].copy()
    walls = np.argwhere(belief.map.log_odds > 0)
    middle = walls[len(walls) // 2]
    place = centres(belief, middle[None])[0]
    perception.trails.forget_walls(0, place + np.array([(0.0, 0.0), (20.0, 0.0)]))
    env.simulation.render_again(0, poses, scan)
    perception.trails.forget_again(0)
    assert belief.map.log_odds[tuple(middle)] == 0
    env.reset(seed=0)
    perception.trails.forget_again(0)
    assert env.belief("robot_0").map.log_odds[tuple(middle)] > 0


def test_a_trail_beyond_the_map_or_of_one_place_changes_nothing(env):
    belief = env.belief("robot_0")
    before = belief.map.log_odds.copy()
    for trail in ([[500.0, 500.0], [501.0, 500.0]], [[-500.0, 0.0]], [belief.pose[:2].tolist()]):
        env.perception.trails.forget_walls(0, np.array(trail))
    assert (belief.map.log_odds == before).all()


@pytest.mark.parametrize("trail", [np.zeros((0, 2)), np.zeros(2), np.zeros((3, 3)), np.array([[0.0, np.nan]])])
def test_what_is_no_trail_is_refused(env, trail):
    with pytest.raises(ValueError, match="want places"):
        env.perception.trails.forget_walls(0, trail)


def test_a_wall_beside_the_trail_stays(env):
    belief = env.belief("robot_0")
    before = belief.map.log_odds.copy()
    walls = centres(belief, np.argwhere(before > 0))
    corner = walls[np.argmin(walls.sum(axis=1))]
    beside = corner - (0.0, belief.radius + RESOLUTION)
    assert (np.hypot(*(walls - beside).T) > belief.radius).all()
    env.perception.trails.forget_walls(0, beside + np.array([(0.0, 0.0), (0.0, -5.0)]))
    assert (belief.map.log_odds == before).all()


@pytest.mark.parametrize("margin", [0.0, MARGIN_M])
def test_a_body_sweeps_a_band_as_wide_as_it_is_and_its_margin(margin):
    rows, columns = np.nonzero(
        footprint_mask((80, 120), (0.0, 0.0), np.array([[1.0, 2.0], [4.0, 2.0]]), 0.2, RESOLUTION, margin)
    )
    reach = 0.2 + margin
    assert (rows.min() + 0.5) * RESOLUTION == pytest.approx(2.0 - reach, abs=RESOLUTION)
    assert (rows.max() + 0.5) * RESOLUTION == pytest.approx(2.0 + reach, abs=RESOLUTION)
    assert (columns.max() + 0.5) * RESOLUTION == pytest.approx(4.0 + reach, abs=RESOLUTION)


def test_where_a_body_has_passed_is_no_place_near_its_stand():
    trail = np.array([[1.0, 2.0], [4.0, 2.0]])
    places = (np.argwhere(passed((80, 120), (0.0, 0.0), trail, 0.2, RESOLUTION))[:, ::-1] + 0.5) * RESOLUTION
    assert np.hypot(*(places - trail[-1]).T).min() > 0.2 + MARGIN_M - RESOLUTION
    assert np.abs(places[:, 1] - 2.0).max() < 0.2 + RESOLUTION

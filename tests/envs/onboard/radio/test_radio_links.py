"""Who reaches whom by radio."""

import numpy as np
import pytest
from seen_truth import begun

import lidarium
from lidarium.envs.onboard.radio.exchange import RadioLinks
from lidarium.envs.simulation.kernels.arrays import DOOR_KIND, DOOR_OPEN, STAYS_SHUT

NEAR_AND_FAR = np.array([(2.0, 4.0, 0.0), (3.0, 4.0, 0.0), (8.4, 6.3, 0.0)])


def links_of(**radio):
    env = begun(NEAR_AND_FAR, radio=radio)
    made = RadioLinks(env.world, env.settings, 0)
    made.start(3)
    return made, env


def test_robots_within_the_reach_are_linked_in_both_directions():
    made, _ = links_of(kind="range", reach=2.0)
    assert not made.links.any()
    made.find(0, draws=True)
    assert made.links[0, 1]
    assert made.links[1, 0]
    assert not made.links[:2, 2].any()
    assert not made.links[2, :2].any()


def test_the_station_is_where_the_first_robot_started():
    made, env = links_of(kind="range", reach=2.0)
    env.world.poses[0, :2] = NEAR_AND_FAR[2, :2] + (0.5, 0.0)
    made.find_station()
    assert made.station_links.tolist() == [False, True, False]


def test_the_station_reaches_robots_through_others():
    made, _ = links_of(kind="none")
    made.station_links[:] = [True, False, False]
    made.links[:] = [[0, 1, 0], [0, 0, 1], [0, 0, 0]]
    assert made.reached().tolist() == [True, True, True]
    made.links[0, 1] = False
    assert made.reached().tolist() == [True, False, False]
    made.station_links[:] = False
    assert not made.reached().any()


def test_who_is_dead_has_no_radio():
    made, env = links_of(kind="all")
    env.world.failed[1] = 1
    made.find(0, draws=True)
    assert not made.links[1].any()
    assert not made.links[:, 1].any()
    assert made.links[0, 2]


def test_messages_are_lost_as_often_as_the_settings_say_and_from_the_seed():
    made, _ = links_of(kind="all", loss=0.3)
    lost = [made.is_lost(is_of_station=False) for _ in range(2000)]
    assert np.mean(lost) == pytest.approx(0.3, abs=0.05)
    made.start(3)
    for _ in range(50):
        made.is_lost(is_of_station=True)
    assert [made.is_lost(is_of_station=False) for _ in range(2000)] == lost
    safe, _ = links_of(kind="all")
    assert not any(safe.is_lost(is_of_station=False) for _ in range(100))


@pytest.mark.parametrize("radio", ["line_of_sight", lidarium.RadioSettings(kind="signal", wall_loss=200.0)])
def test_a_door_that_is_shut_is_between_robots_and_an_open_one_is_not(radio):
    env = lidarium.parallel_env("apartment", robots=2, radio=radio, doors=1.0, known_starts=False)
    env.reset(seed=1)
    world = env.unwrapped.world
    number, (x, y, to_x, to_y) = next(
        (k, door[:4]) for k, door in enumerate(world.population.doors_of(0)) if door[DOOR_KIND] == STAYS_SHUT
    )
    across = 0.6 * np.array([y - to_y, to_x - x]) / np.hypot(to_x - x, to_y - y)
    world.poses[:2, :2] = np.array([0.5 * (x + to_x), 0.5 * (y + to_y)]) + np.array([across, -across])
    links = RadioLinks(world, env.unwrapped.settings, 0)
    for opened, is_linked in ((0.0, False), (1.0, True)):
        world.population.doors_of(0)[number, DOOR_OPEN] = opened
        links.find(0, draws=True)
        assert links.links[0, 1] == is_linked
    env.close()

"""People are drawn where they fit, away from robots; what does not fit is refused with a reason."""

import numpy as np
import pytest
from scipy import ndimage

from lidarium.agents.catalogue import make_policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.arrays import WALKER_X, WALKER_Y
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.truth.beliefs import team_log_odds
from lidarium.evaluation.truth.true_map import occupied_in_truth

CLOSET = Floor("closet", (0.0, 0.0, 1.2, 1.2))
SLOT = Floor("slot", (0.0, 0.0, 4.0, 0.5))


def begun(floor, seed=0, options=None, **settings):
    env = ExplorationEnv(floor, make_settings(**{"robots": 1, "horizon_s": 5.0, **settings}))
    env.reset(seed=seed, options=options)
    return env


@pytest.mark.parametrize(
    ("floor", "people", "words"),
    [
        (CLOSET, 1, "people is 1, but only 0 fit on floor 'closet' a metre away from the robots; want fewer people"),
        ("apartment", 900, r"people is 900, but only \d+ fit on floor 'apartment'"),
        (SLOT, 2, "no person fits on floor 'slot': no place is 0.6 m wide; want people=0"),
    ],
)
def test_more_people_than_fit_are_refused(floor, people, words):
    with pytest.raises(ValueError, match=words):
        begun(floor, people=people, robot="point" if floor is SLOT else "kobuki")


@pytest.mark.parametrize("value", [-1, 1.5, "many", 1001])
def test_a_number_of_people_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match="people is"):
        make_settings(people=value)


@pytest.mark.parametrize("value", [-0.1, 1.1, "all"])
def test_a_share_of_doors_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match="doors is"):
        make_settings(doors=value)


def test_people_stand_aside_from_a_robot_wherever_it_starts():
    drawn = begun("apartment", people=6, seed=3).simulation.population.people_of(0)[0, [WALKER_X, WALKER_Y]]
    env = begun("apartment", people=6, seed=3, options={"starts": [(float(drawn[0]), float(drawn[1]), 0.0)]})
    people = env.simulation.population.people_of(0)[:, [WALKER_X, WALKER_Y]]
    assert np.hypot(*(people - env.world.poses[0, :2]).T).min() >= 1.0


def test_the_floor_that_counts_and_the_start_are_the_same_with_people():
    without, among = (begun("office:1", seed=2, people=people) for people in (0, 8))
    assert np.array_equal(without.score.counted_masks[0], among.score.counted_masks[0])
    assert np.array_equal(without.world.poses, among.world.poses)


def ghosts_in(env):
    """Return how many cells of the robots' maps are occupied far from all that is solid."""
    log_odds, _ = team_log_odds(env)
    far = ndimage.distance_transform_edt(~occupied_in_truth(env)) * env.settings.occupancy.resolution
    return int(((log_odds > 0) & (far > 0.2)).sum())


def test_people_leave_no_ghosts_in_the_maps_of_robots():
    results = []
    for people in (0, 8):
        env = ExplorationEnv("office:2", make_settings(robots=2, people=people, starts="drawn", resolution=0.05))
        results.append(result_of(run_episode(make_policy("nearest_frontier"), env, 1)))
        assert ghosts_in(env) == 0
    without, among = results
    assert among["iou_occupied"] >= 0.97 * without["iou_occupied"]
    assert among["coverage_final"] >= 0.99
    assert among["contacts_by_robot"] == 0
    assert among["near_misses"] > 0
    assert among["closest_approach_m"] > 0.0
    assert among["yielding_s"] > 0.0
    assert without["near_misses"] is None

"""Localizers that are not kernels, and the realism presets."""

import copy
import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.making import REALISM, make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.localizer import KeyScans
from lidarium.mapping.localization.registry import LOCALIZERS


class Reckoner:
    """Dead reckoning from odometry, as a localizer outside of the kernels."""

    Settings = dict

    def __init__(self, settings, geometry):
        self.geometry, self.covariance = geometry, np.diag([0.04, 0.09, 0.01])

    def reset(self, pose, seed):
        self.start = Transform(*(float(value) for value in pose))
        self.seed, self.keys, self.correction = seed, [], None

    def localize(self, sensing):
        place = self.start @ Transform(*(float(value) for value in sensing.odometry))
        pose = np.array([place.x, place.y, place.theta])
        self.keys.append((pose, sensing.ranges, sensing.time_s))
        return pose

    def take_correction(self):
        correction, self.correction = self.correction, None
        return correction


class Corrector(Reckoner):
    """The same, which says after every tenth scan that all scans are to be mapped anew where they were."""

    def localize(self, sensing):
        pose = super().localize(sensing)
        if len(self.keys) % 10 == 0:
            # The last scan is mapped by the robot itself.
            self.correction = KeyScans(
                np.stack([key[0] for key in self.keys[:-1]]),
                np.stack([key[1] for key in self.keys[:-1]]),
                np.array([key[2] for key in self.keys[:-1]]),
            )
        return pose


@pytest.fixture
def localizers():
    LOCALIZERS.register("reckoner", Reckoner, "for tests")
    LOCALIZERS.register("corrector", Corrector, "for tests")
    yield
    LOCALIZERS.unregister("reckoner")
    LOCALIZERS.unregister("corrector")


def explored(steps=150, seed=2, **options):
    env = lidarium.parallel_env(
        "apartment", robots=2, lidar="lidar_360_6m", stop_coverage=None, **{"starts": "fixed", **options}
    )
    env.reset(seed=seed)
    generator = np.random.default_rng(seed)
    for step in range(steps):
        if step % 15 == 0:
            actions = {
                agent: generator.uniform([0.1, -0.5], [0.5, 0.5]).astype(np.float32) for agent in env.possible_agents
            }
        observations, *_ = env.step(actions)
    return env, observations


@pytest.mark.parametrize("known_starts", [True, False])
def test_a_localizer_outside_of_the_kernels_is_as_good_as_one_within(localizers, known_starts):
    inside, seen = explored(localization="odometry", odometry="good", known_starts=known_starts, radio="none")
    outside, also_seen = explored(localization="reckoner", odometry="good", known_starts=known_starts, radio="none")
    assert np.allclose(inside.simulation.beliefs.believed, outside.simulation.beliefs.believed, atol=1e-9)
    for one, other in zip(inside.simulation.beliefs.log_odds, outside.simulation.beliefs.log_odds, strict=True):
        assert (one != other).mean() < 1e-4
    assert seen.keys() == also_seen.keys()


def test_a_map_rendered_anew_at_the_same_poses_is_the_same_map(localizers):
    plain, seen = explored(localization="reckoner", odometry="typical", radio="none")
    anew, also_seen = explored(localization="corrector", odometry="typical", radio="none")
    assert anew.simulation.beliefs.renderings.tolist() == [15, 15]
    for one, other in zip(plain.simulation.beliefs.log_odds, anew.simulation.beliefs.log_odds, strict=True):
        assert np.array_equal(one, other)
    for agent, observation in seen.items():
        for name, value in observation.items():
            assert np.array_equal(value, also_seen[agent][name]), name


def test_pooled_and_navigation_maps_follow_a_rendering(localizers):
    env, _ = explored(localization="corrector", odometry="typical", observe=("egocentric_map",), noise="datasheet")
    twin = copy.deepcopy(env)
    own = env.perception.own_map(0)
    fresh = type(own)(env.beliefs.log_odds[0], own.resolution)
    fresh.changed((0, own.log_odds.shape[0], 0, own.log_odds.shape[1]))
    assert np.array_equal(own.clearance.closeness, fresh.clearance.closeness)
    assert np.array_equal(own.frontiers.cells(), fresh.frontiers.cells())
    actions = {agent: np.zeros(2, np.float32) for agent in env.agents}
    one, other = env.step(actions)[0], twin.step(actions)[0]
    assert np.array_equal(one["robot_0"]["egocentric_map"], other["robot_0"]["egocentric_map"])


def test_the_spread_of_a_belief_is_what_the_localizer_tells(localizers):
    env, _ = explored(5, localization="reckoner")
    assert env.belief("robot_1").spread == pytest.approx([0.2, 0.3, 0.1])
    assert explored(5)[0].belief("robot_1").spread.tolist() == [0.0, 0.0, 0.0]


def test_localizers_draw_from_the_seed_of_the_episode(localizers):
    seeds = [
        [localizer.seed for localizer in explored(1, seed=seed, localization="reckoner")[0].perception.poses.localizers]
        for seed in (1, 1, 2)
    ]
    assert seeds[0] == seeds[1]
    assert len({*seeds[0], *seeds[2]}) == 4


def test_episodes_with_localizers_are_recorded_and_run_again_to_the_bit(localizers, tmp_path):
    from lidarium.evaluation.episodes.watching import WatchedExploration
    from lidarium.evaluation.record import Recorder
    from lidarium.evaluation.record.replay import rerun

    recorder = Recorder("nearest_frontier", 3, "apartment")
    settings = make_settings(
        robots=2,
        localization="corrector",
        odometry="good",
        noise="datasheet",
        radio="range",
        horizon_s=20.0,
        lidar="lidar_360_6m",
    )
    env = WatchedExploration("apartment", settings, watchers=[recorder])
    run_episode(lidarium.policy("nearest_frontier"), env, seed=3)
    again = rerun(recorder.finish())
    assert np.array_equal(again.beliefs.believed, env.beliefs.believed)


def test_ideal_realism_is_the_default_to_the_letter():
    assert make_settings(realism="ideal") == make_settings()


def test_realism_is_what_its_preset_says_but_for_what_is_given():
    lab = make_settings(realism="lab")
    assert lab.lidar.is_noisy
    assert lab.odometry.distance_bias == 0.05
    assert make_settings(realism="lab", odometry="poor").odometry.distance_bias == 0.1
    assert not make_settings(realism="lab", noise="none").lidar.is_noisy
    field = make_settings(realism="field")
    assert field.radio.kind == "signal"
    assert field.faults.laser_dropout > 0.0
    assert math.isclose(field.radio.loss, 0.05)


def test_unknown_names_are_refused_with_those_that_are_known():
    with pytest.raises(ValueError, match=r"unknown realism 'moon'.*ideal, lab, field, fast"):
        make_settings(realism="moon")
    with pytest.raises(ValueError, match="unknown odometry 'rusty'"):
        make_settings(odometry="rusty")
    with pytest.raises(ValueError, match="localization is 'gps'; want one of truth, odometry"):
        make_settings(localization="gps")
    assert set(REALISM) == {"ideal", "lab", "field", "fast"}


@pytest.mark.parametrize("turn_rate", [0.0, 0.5, 2.0])
def test_localizers_do_not_see_teammates_also_while_their_robot_turns(localizers, turn_rate):
    env = lidarium.parallel_env(
        Floor("room", (0.0, 0.0, 10.0, 6.0)), robots=2, localization="reckoner", stop_coverage=None
    )
    env.reset(seed=0, options={"starts": [(3.0, 3.0, 0.2), (6.0, 3.0, 0.0)]})
    share = np.float32(turn_rate / env.settings.robot.max_turn_rate)
    nearer = 0
    for _ in range(8):
        env.step({"robot_0": np.array([0.0, share], np.float32), "robot_1": np.zeros(2, np.float32)})
        seen = env.perception.poses.localizers[0].keys[-1][1]
        angles = env.settings.lidar.angles + env.world.poses[0, 2]
        towards = np.abs((angles + math.pi) % (2.0 * math.pi) - math.pi) < 0.05
        nearer += int((env.simulation.ranges[0][towards] < 3.0).sum())
        assert np.isnan(seen[towards]).all()
    assert nearer > 50

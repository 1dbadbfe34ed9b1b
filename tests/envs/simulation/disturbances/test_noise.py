"""The noise is Gaussian, independent in every direction, and a function of its counter alone."""

import math

import numpy as np
import pytest
from scipy import stats

from lidarium.envs.floors.floor import Raster
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE, fill_gaussian, stream_key
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.kernels.compilation import kernel


@kernel
def fill_streams(seeds, robots, steps, table, values):
    for k in range(values.shape[0]):
        fill_gaussian(stream_key(seeds[k], robots[k], steps[k]), table, values[k])


def draws(seeds, robots, steps, beams=727):
    seeds, robots, steps = np.broadcast_arrays(np.asarray(seeds, np.uint64), np.asarray(robots), np.asarray(steps))
    values = np.empty((seeds.size, beams), np.float32)
    fill_streams(seeds.ravel().copy(), robots.ravel().copy(), steps.ravel().copy(), GAUSSIAN_TABLE, values)
    return values.astype(np.float64)


@pytest.fixture(scope="module")
def many():
    return draws(12345, 0, np.arange(-1, 1499))


def test_mean_deviation_skew_and_kurtosis_are_those_of_a_gaussian(many):
    count = many.size
    assert abs(many.mean()) < 5.0 / math.sqrt(count)
    assert abs(many.std() - 1.0) < 5.0 / math.sqrt(2.0 * count)
    assert abs(stats.skew(many, axis=None)) < 5.0 * math.sqrt(6.0 / count)
    # The tails of the table end at five deviations; what is missing there is less than one part in a hundred.
    assert abs(stats.kurtosis(many, axis=None)) < 0.02


def test_the_distribution_is_gaussian_up_to_its_tails(many):
    for quantile in (0.001, 0.01, 0.1, 0.25, 0.5, 0.9, 0.99, 0.999):
        share = float((many < stats.norm.ppf(quantile)).mean())
        assert abs(share - quantile) < 5.0 * math.sqrt(quantile * (1.0 - quantile) / many.size) + 2e-5


@pytest.mark.parametrize("lag", [1, 2, 3, 64])
def test_neighbouring_beams_are_not_correlated(many, lag):
    assert abs(np.mean(many[:, lag:] * many[:, :-lag])) < 5.0 / math.sqrt(many.size)
    squares = many**2 - 1.0
    assert abs(np.mean(squares[:, lag:] * squares[:, :-lag])) < 10.0 / math.sqrt(many.size)


@pytest.mark.parametrize("lag", [1, 2, 10])
def test_steps_are_not_correlated(many, lag):
    assert abs(np.mean(many[lag:] * many[:-lag])) < 5.0 / math.sqrt(many.size)


def test_robots_and_seeds_have_streams_of_their_own():
    base = draws(7, 0, np.arange(500))
    for other in (
        draws(7, 1, np.arange(500)),
        draws(8, 0, np.arange(500)),
        draws(7 + 2**32, 0, np.arange(500)),
        draws(7, 0, np.arange(500, 1000)),
    ):
        assert abs(np.mean(base * other)) < 5.0 / math.sqrt(base.size)
        assert (base == other).mean() < 1e-3


def test_no_two_of_many_streams_are_the_same():
    values = draws(np.arange(40)[:, None, None], np.arange(8)[None, :, None], np.arange(-1, 99)[None, None, :], beams=4)
    assert len(np.unique(values, axis=0)) == len(values)


def hall(rows=120, columns=160):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    raster = Raster(solid, (-0.1, -0.1), 0.025)
    return FloorTables(raster, raster, RayTables(solid), distance_bound(solid))


def simulation(episodes=1, robots=2, floor=0.01, share=0.01, range_max=5.6):
    lidar = Lidar(beams=200, noise_floor=floor, noise_share=share, range_max=range_max)
    return KinematicSimulation.of_team([ROBOTS["kobuki"]] * robots, lidar, OccupancySettings(), episodes=episodes)


STARTS = np.array([[1.0, 1.0, 0.3], [2.5, 1.5, 2.0]])


def test_the_same_seed_gives_the_same_ranges_in_any_row():
    tables, commands = hall(), np.array([[0.3, 0.5], [0.2, -1.0]])
    alone, among = simulation(), simulation(episodes=4)
    alone.place(0, tables, STARTS, 99)
    for episode in range(4):
        among.place(episode, tables, STARTS if episode == 2 else STARTS[::-1].copy(), 99 if episode == 2 else episode)
    for step in range(20):
        alone.step(commands, moves_bodies=step > 0)
        among.step(np.tile(commands, (4, 1)), moves_bodies=step > 0)
        assert np.array_equal(alone.ranges, among.ranges[4:6])
        assert not np.array_equal(alone.ranges, among.ranges[0:2])


def test_ranges_spread_as_the_lidar_says_with_a_floor_and_a_share():
    tables, lidar_world, exact = hall(), simulation(robots=1), simulation(robots=1, floor=0.0, share=0.0)
    gaps = []
    for each in (lidar_world, exact):
        each.place(0, tables, STARTS[:1], 3)
    exact.step(np.zeros((1, 2)))
    for _ in range(400):
        lidar_world.step(np.zeros((1, 2)))
        gaps.append(lidar_world.ranges[0] - exact.ranges[0])
    spread, wanted = np.std(gaps, axis=0), np.maximum(0.01, 0.01 * exact.ranges[0])
    assert np.abs(spread / wanted - 1.0).max() < 0.2
    assert abs(np.mean(spread / wanted) - 1.0) < 0.01


def test_a_beam_without_return_stays_without_and_hits_stay_within_the_lidars_range():
    tables, noisy = hall(), simulation(robots=1, floor=0.3, share=0.0, range_max=1.2)
    noisy.place(0, tables, STARTS[:1], 3)
    exact = simulation(robots=1, floor=0.0, share=0.0, range_max=1.2)
    exact.place(0, tables, STARTS[:1], 3)
    exact.step(np.zeros((1, 2)))
    for _ in range(50):
        noisy.step(np.zeros((1, 2)))
        ranges = noisy.ranges[0]
        assert np.array_equal(np.isinf(ranges), np.isinf(exact.ranges[0]))
        hits = ranges[np.isfinite(ranges)]
        assert hits.min() >= np.float32(0.02)
        assert hits.max() <= np.float32(1.2 - 1e-3)


def test_noise_that_is_off_leaves_the_ideal_ranges_to_the_bit():
    tables = hall()
    plain, off = simulation(floor=0.0, share=0.0), simulation(floor=0.0, share=0.0)
    plain.place(0, tables, STARTS, 1)
    off.place(0, tables, STARTS, 2)
    for _ in range(5):
        plain.step(np.full((2, 2), 0.2))
        off.step(np.full((2, 2), 0.2))
        assert np.array_equal(plain.ranges, off.ranges)

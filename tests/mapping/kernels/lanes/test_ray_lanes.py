"""Rays and bundles that travel in lanes, against their plain definitions, to the bit."""

import math

import numpy as np
import pytest

from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python.plain import end_of_bundle, end_of_ray
from lidarium.mapping.kernels.lanes.ray_groups import GROUP, GROUPS, RAYS
from lidarium.mapping.kernels.lanes.ray_lanes import travel_bundles, travel_rays

INSIDE = 1e-7


@kernel
def rays_at(squares, origin, starts, directions, ranges):
    shape = squares.shape[1] * squares.shape[2], squares.shape[2]
    addresses = starts.ctypes.data, directions.ctypes.data, ranges.ctypes.data
    stride = 8 * directions.shape[1]
    travel_rays(squares.ctypes.data, shape, origin, addresses[0], addresses[1], stride, addresses[2])


@kernel
def bundles_at(squares, origin, inside, bundles):
    shape = squares.shape[1] * squares.shape[2], squares.shape[2]
    stride = 8 * bundles.shape[1]
    travel_bundles(squares.ctypes.data, shape, origin, inside, bundles.ctypes.data, stride)


def floor(generator):
    rows, columns = generator.integers(20, 70, 2)
    solid = (generator.random((rows, columns)) < generator.choice([0.0, 0.01, 0.1])).astype(np.uint8)
    solid[[0, -1]], solid[:, [0, -1]] = 1, 1
    return RayTables(solid).squares


def free_place(squares, generator, on_lattice):
    row, column = generator.choice(np.argwhere(squares[0] > 0))
    within = generator.choice([0.0, 0.5], 2) if on_lattice else generator.random(2)
    return float(column + within[0]), float(row + within[1])


def directions_of(angles):
    across = np.array([np.cos(angles), np.sin(angles)])
    # What is all but nothing is nothing: rays exactly along the lattice.
    across[np.abs(across) < 1e-12] = 0.0
    with np.errstate(divide="ignore"):
        return np.vstack([across, np.where(across == 0.0, math.inf, 1.0 / across)])


@pytest.mark.parametrize("on_lattice", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_rays_end_where_the_plain_ones_do(seed, on_lattice):
    generator = np.random.default_rng(seed)
    squares = floor(generator)
    for reach in (5.0, 25.0, 500.0):
        x, y = free_place(squares, generator, on_lattice)
        turns = generator.integers(0, 16, RAYS) * math.pi / 8
        angles = turns if on_lattice else generator.uniform(-4.0, 4.0, RAYS)
        directions, ranges = directions_of(angles), np.full(RAYS, math.nan)
        starts = np.array([0.0, 0.0 if on_lattice else generator.choice([0.0, reach, 2.0 * reach])])
        rays_at(squares, (x, y, reach), starts, directions, ranges)
        expected = [
            end_of_ray(squares, (x, y, reach), directions[:, ray].tolist(), float(starts[ray // GROUP]))
            for ray in range(RAYS)
        ]
        assert ranges.tolist() == expected
        assert (ranges > 0.0).any()


def test_each_group_of_rays_begins_at_a_distance_of_its_own():
    squares = floor(np.random.default_rng(1))
    squares[:] = 0
    starts, ranges = np.arange(1.0, 1.0 + GROUPS), np.empty(RAYS)
    rays_at(squares, (8.5, 8.5, 50.0), starts, directions_of(np.linspace(0.1, 6.0, RAYS)), ranges)
    assert ranges.tolist() == np.repeat(starts, GROUP).tolist()


@pytest.mark.parametrize("on_lattice", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_bundles_end_where_the_plain_ones_do(seed, on_lattice):
    generator = np.random.default_rng(seed)
    squares = floor(generator)
    for reach in (5.0, 500.0):
        x, y = free_place(squares, generator, on_lattice)
        quarter = generator.integers(0, 4, RAYS) * math.pi / 2
        first = quarter + generator.uniform(0.01, 1.2, RAYS)
        outer = [directions_of(first), directions_of(first + generator.uniform(0.0, 0.3, RAYS))]
        signs = np.where(outer[0][:2] < 0.0, -1.0, 1.0)
        inverse = signs * np.minimum(*(np.abs(each[2:]) for each in outer))
        bundles = np.vstack([outer[0][:2], outer[1][:2], inverse, np.full((1, RAYS), math.nan)])
        bundles_at(squares, (x, y, reach), INSIDE, bundles)
        columns = (bundles[:6, bundle].tolist() for bundle in range(RAYS))
        assert bundles[6].tolist() == [
            end_of_bundle(squares, (x, y, reach), column, INSIDE) for column in columns
        ]


def test_a_bundle_of_no_direction_stays_where_it_begins():
    squares, bundles = floor(np.random.default_rng(2)), np.zeros((7, RAYS))
    bundles[6] = math.nan
    bundles_at(squares, (8.5, 8.5, 50.0), INSIDE, bundles)
    assert (bundles[6] == 0.0).all()

"""Rays and bundles that travel in lanes, to the bit as one by one."""

import math

import numpy as np
import pytest
from both_forms import assert_forms_agree

from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.kernels.simd.rays import FLOAT, GROUP, RAYS, travel_bundles, travel_rays

INSIDE = 1e-7


def rays(squares, origin, starts, directions):
    shape, ranges = (squares[0].size, squares.shape[2]), np.full(RAYS, math.nan)
    # A copy of the squares has nothing behind it: their address is passed.
    arguments = squares.ctypes.data, shape, origin, starts, directions, FLOAT * RAYS, ranges
    return assert_forms_agree(travel_rays, *arguments)[-1]


def bundles_of(squares, origin, outer):
    shape, bundles = (squares[0].size, squares.shape[2]), np.vstack([outer, np.full((1, RAYS), math.nan)])
    arguments = squares.ctypes.data, shape, origin, INSIDE, bundles, FLOAT * RAYS
    return assert_forms_agree(travel_bundles, *arguments)[-1][6]


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
    # All but nothing is nothing: rays exactly along the lattice.
    across[np.abs(across) < 1e-12] = 0.0
    with np.errstate(divide="ignore"):
        return np.vstack([across, np.where(across == 0.0, math.inf, 1.0 / across)])


@pytest.mark.parametrize("on_lattice", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_rays_end_where_they_enter_a_solid_cell_or_at_the_reach(seed, on_lattice):
    generator = np.random.default_rng(seed)
    squares = floor(generator)
    for reach in (5.0, 25.0, 500.0):
        x, y = free_place(squares, generator, on_lattice)
        turns = generator.integers(0, 16, RAYS) * math.pi / 8
        angles = turns if on_lattice else generator.uniform(-4.0, 4.0, RAYS)
        starts = np.array([0.0, 0.0 if on_lattice else generator.choice([0.0, reach, 2.0 * reach])])
        ranges = rays(squares, (x, y, reach), starts, directions_of(angles))
        assert (ranges > 0.0).any()
        assert (ranges <= reach).all()


def test_each_group_of_rays_begins_at_a_distance_of_its_own():
    squares = floor(np.random.default_rng(1))
    squares[:] = 0
    starts = np.array([1.0, 2.0])
    ranges = rays(squares, (8.5, 8.5, 50.0), starts, directions_of(np.linspace(0.1, 6.0, RAYS)))
    assert ranges.tolist() == np.repeat(starts, GROUP).tolist()


@pytest.mark.parametrize("on_lattice", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_bundles_end_where_no_square_holds_them(seed, on_lattice):
    generator = np.random.default_rng(seed)
    squares = floor(generator)
    for reach in (5.0, 500.0):
        origin = (*free_place(squares, generator, on_lattice), reach)
        quarter = generator.integers(0, 4, RAYS) * math.pi / 2
        first = quarter + generator.uniform(0.01, 1.2, RAYS)
        outer = [directions_of(first), directions_of(first + generator.uniform(0.0, 0.3, RAYS))]
        signs = np.where(outer[0][:2] < 0.0, -1.0, 1.0)
        inverse = signs * np.minimum(*(np.abs(each[2:]) for each in outer))
        assert (bundles_of(squares, origin, np.vstack([outer[0][:2], outer[1][:2], inverse])) >= 0.0).all()


def test_a_bundle_of_no_direction_stays_where_it_begins():
    squares = floor(np.random.default_rng(2))
    assert (bundles_of(squares, (8.5, 8.5, 50.0), np.zeros((6, RAYS))) == 0.0).all()

"""Robots can go everywhere on a generated floor."""

import math

import numpy as np

from lidarium.envs.floors.generation.buildings import generate_building
from lidarium.envs.floors.generation.furniture_places import Furnished
from lidarium.envs.floors.generation.passability import START_CLEARANCE, draw_starts, passable
from lidarium.envs.floors.generation.solids import solid_of


def test_starts_are_half_a_metre_off_all_that_stands_and_far_from_each_other():
    for seed in range(12):
        floor = generate_building(seed)
        raster = floor.raster(0.025, 0.0, 2.0)
        solid = np.argwhere(raster.solid)[:, ::-1] * raster.resolution + raster.origin
        for start in floor.starts:
            nearest = np.maximum(np.maximum(solid - start[:2], start[:2] - solid - raster.resolution), 0.0)
            assert np.hypot(*nearest.T).min() >= START_CLEARANCE - 1e-6
        apart = min(math.dist(floor.starts[i, :2], floor.starts[j, :2]) for i, j in ((0, 1), (0, 2), (1, 2)))
        assert apart > 0.25 * math.dist(floor.bounds[:2], floor.bounds[2:])


BOUNDS = (0.0, 0.0, 8.0, 4.0)
LABELS = np.zeros((40, 80), np.int32)
LABELS[:, 40:] = 1


def piece(room, *rectangle):
    return Furnished(room, rectangle, (solid_of(rectangle, 1.0),))


def walls(gap):
    half = (4.0 - gap) / 2
    return solid_of((3.9, 0.0, 4.1, half)), solid_of((3.9, 4.0 - half, 4.1, 4.0))


def test_what_stands_in_a_door_is_left_out_and_the_rest_stays():
    harmless, blocking = piece(0, 0.0, 0.0, 0.5, 0.5), piece(1, 4.2, 1.5, 4.6, 2.5)
    kept, clear, origin = passable(BOUNDS, walls(1.0), [harmless, blocking], LABELS)
    assert kept == [harmless]
    starts = draw_starts(clear, origin, np.random.default_rng(0))
    assert len(starts) == 3
    assert np.abs(starts[:, 0] - 4.0).max() > 2.0


def test_walls_without_a_door_cannot_be_mended():
    assert passable(BOUNDS, walls(0.0), [], LABELS) is None
    assert passable(BOUNDS, walls(0.5), [], LABELS) is None


def test_a_nook_behind_a_piece_is_not_left_cut_off():
    shelf = piece(1, 6.5, 0.0, 7.0, 4.0)
    kept, _, _ = passable(BOUNDS, walls(1.0), [shelf], LABELS)
    assert kept == []

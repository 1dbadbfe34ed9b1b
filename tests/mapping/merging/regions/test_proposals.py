"""Motions under which regions and doors of two maps meet."""

import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, hall, kept, moved, noisy, room

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.regions.graph import BINS, find_regions, likely_rotations
from lidarium.mapping.merging.regions.proposals import (
    _by_doors,
    _by_regions,
    by_growing_regions,
    propose_motions,
)
from lidarium.mapping.merging.regions.segmentation import RegionSettings

SETTINGS = RegionSettings()


def graph(levels):
    return find_regions(levels, RESOLUTION, SETTINGS)


def is_near(motions, truth, at, metres=0.3, angle=math.radians(4.0)):
    """Return of each motion whether it is the true one, to what the walls refine."""
    errors = [Transform(*motion[:3]).difference(truth, at) for motion in motions.tolist()]
    return np.array([distance < metres and turn < angle for distance, turn in errors])


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.2, 2.5, -1.0])
def test_the_true_motion_is_among_those_of_regions_and_of_doors(theta):
    there = about_middle(theta, apartment(), shift=(0.5, -0.3))
    a, b = graph(apartment()), graph(noisy(moved(apartment(), there), 1))
    truth, at = there.inverse(), there.apply((5.0, 4.0))
    assert is_near(_by_regions(a, b, SETTINGS), truth, at).any()
    assert is_near(_by_doors(a.doors, b.doors, SETTINGS), truth, at, 0.5).any()
    # Where nothing else is known, one in twelve is a good share.
    assert is_near(propose_motions(a, b, SETTINGS), truth, at).mean() > 1.0 / 80.0


@pytest.mark.parametrize("theta", [0.2, 2.0])
def test_parts_of_a_floor_propose_their_motion_too(theta):
    west, east = slice(0, 230), slice(150, 402)
    there = about_middle(theta, hall(), (480, 480))
    a, b = kept(hall(), slice(0, 180), west), kept(hall(), slice(0, 180), east)
    found = propose_motions(graph(a), graph(moved(b, there, (480, 480))), SETTINGS)
    assert is_near(found, there.inverse(), there.apply((9.5, 4.0))).any()


def test_a_room_that_was_seen_in_part_meets_at_its_ends():
    whole, part = room(blank(), 20, 20, 60, 100), room(blank(), 20, 20, 60, 100)
    part[:, 70:] = UNKNOWN
    found = _by_regions(graph(whole), graph(part), SETTINGS)
    assert is_near(found, Transform(), (2.0, 2.5)).any()


def test_regions_of_like_shapes_propose_the_scale():
    truth = about_middle(0.7, apartment(), (480, 480))
    larger = np.kron(apartment(), np.ones((3, 3), np.uint8))[::2, ::2]
    found = by_growing_regions(graph(larger), graph(moved(apartment(), truth, (480, 480))), SETTINGS, (0.5, 2.0))
    is_scale = np.abs(found[:, 3] - 1.5) < 0.05
    # A point p of the small map lies at 1.5 R p + t in the large one.
    point = np.array((5.0, 4.0))
    there = [
        Transform(*motion[:3]).apply(truth.apply(point) * motion[3]) - 1.5 * point
        for motion in found[is_scale].tolist()
    ]
    assert np.hypot(*np.array(there).T).min() < 0.3
    assert ((found[:, 3] >= 0.5) & (found[:, 3] <= 2.0)).all()


@pytest.mark.parametrize("level", [FREE, OCCUPIED, UNKNOWN])
def test_maps_of_one_level_propose_nothing_that_fails(level):
    bare, known = graph(np.full((60, 90), level, np.uint8)), graph(apartment())
    for a, b in ((bare, known), (known, bare), (bare, bare)):
        assert np.isfinite(propose_motions(a, b, SETTINGS)).all()
        assert np.isfinite(by_growing_regions(a, b, SETTINGS, (0.5, 2.0))).all()
    cell = graph(np.full((1, 1), level, np.uint8))
    assert propose_motions(cell, known, SETTINGS).shape == (0, 3)
    assert by_growing_regions(known, cell, SETTINGS, (0.5, 2.0)).shape == (0, 4)


@pytest.mark.parametrize("theta", [0.1, 0.9, 2.2, -2.0])
def test_walls_say_how_a_map_may_be_turned(theta):
    there = about_middle(theta, apartment())
    found = likely_rotations(graph(apartment()).directions, graph(moved(apartment(), there)).directions, 72)
    assert len(found) <= 24
    off = np.abs((found + theta + math.pi) % (2.0 * math.pi) - math.pi)
    assert off.min() < math.radians(2.5)


def test_where_walls_run_everywhere_all_rotations_are_tried():
    everywhere = np.ones(BINS)
    rotations = likely_rotations(everywhere, everywhere, 72)
    np.testing.assert_allclose(rotations, np.arange(72) * math.radians(5.0))
    nothing = likely_rotations(np.zeros(BINS), everywhere, 72)
    assert len(nothing) == 72


def test_correlated_directions_are_those_of_a_plain_sum():
    generator = np.random.default_rng(5)
    a, b = generator.random(BINS) ** 8, generator.random(BINS) ** 8
    alike = np.array([sum(a[(k + j) % BINS] * b[j] for j in range(BINS)) for k in range(BINS)])
    found = likely_rotations(a, b, 4 * BINS)
    mean, most = alike.mean(), alike.max()
    assert most > 1.3 * mean
    bins = np.rint(found % (math.pi / 2) / (math.pi / 2) * BINS).astype(int) % BINS
    assert set(bins) == set(np.flatnonzero(alike >= mean + 0.4 * (most - mean)))

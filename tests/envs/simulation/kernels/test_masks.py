"""What true beams have seen is the area between them, as far as it counts."""

import math

import numpy as np
import pytest
from matplotlib.path import Path
from scored_halls import hall, tables_of, team

from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.arrays import MAP_RESOLUTION, RANGE_MAX, world_at
from lidarium.envs.simulation.kernels.masks import footprint, true_lengths, window_corner
from lidarium.mapping.grids.scan_polygon import window_rows, window_words
from lidarium.mapping.kernels.compilation import kernel

RESOLUTION = 0.05
# Back to back, so that no body cuts a beam.
STARTS = np.array([[2.0, 1.5, math.pi], [4.5, 2.5, 0.1]])


def scanned(noise=0.0):
    """Two robots in an empty hall that have taken the scan at the start."""
    simulation = team(2, RESOLUTION, noise=noise)
    simulation.place(0, tables_of(hall()), STARTS, 3)
    simulation.step(np.zeros((2, 2)), moves_bodies=False)
    return simulation


def between_beams(simulation, row):
    """The cells of a map between a robot and the ends of its true beams, and those too near to an edge."""
    world, lidar = simulation.world, simulation.lidars[0]
    x, y, heading = world.poses[row]
    ranges = np.minimum(simulation.ranges[row], lidar.range_max)
    ends = np.stack([x + ranges * np.cos(heading + lidar.angles), y + ranges * np.sin(heading + lidar.angles)])
    polygon = Path(np.concatenate([[[x, y]], ends.T]))
    rows, columns = simulation.beliefs.log_odds[row].shape
    centres = (np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1) + 0.5) * RESOLUTION
    points = centres.reshape(-1, 2)
    inside = polygon.contains_points(points).reshape(rows, columns)
    edges = [polygon.contains_points(points, radius=radius) for radius in (-1e-3, 1e-3)]
    return inside, (edges[0] != edges[1]).reshape(rows, columns)


def test_a_mask_holds_the_cells_of_the_floor_between_the_beams():
    simulation = scanned()
    for row in range(2):
        columns = simulation.beliefs.log_odds[row].shape[1]
        counted = unpack_bits(simulation.score.counted_masks[0], columns)
        seen = unpack_bits(simulation.score.masks[row], columns)
        inside, is_near_edge = between_beams(simulation, row)
        assert np.array_equal(seen[~is_near_edge], (inside & counted)[~is_near_edge])
        assert (is_near_edge & counted).sum() < 0.01 * seen.sum()
        assert seen.sum() == simulation.score.seen[row] > 2000


@kernel
def look(table, row, robots, bits):
    """Fill what a robot sees from where it stands now."""
    return footprint(world_at(table), row, 0, robots, bits)


def area_from(simulation, row):
    reach = simulation.sensor[0, RANGE_MAX] / simulation.sensor[0, MAP_RESOLUTION]
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    _, row_offset, word_offset = look(simulation.table, row, 2, bits)
    rows, columns = simulation.beliefs.log_odds[row].shape
    cells = np.zeros((rows, columns), np.bool_)
    corner = np.array([row_offset, 64 * word_offset])
    window = corner + np.argwhere(unpack_bits(bits, 64 * bits.shape[1]))
    window = window[((window >= 0) & (window < (rows, columns))).all(axis=1)]
    cells[window[:, 0], window[:, 1]] = True
    return cells


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_footprint_is_what_the_mask_got_whatever_the_noise_and_changes_nothing(noise):
    simulation = scanned(noise)
    masks = [mask.copy() for mask in simulation.score.masks]
    ranges, seen = simulation.ranges.copy(), simulation.score.seen.copy()
    for row in range(2):
        cells = area_from(simulation, row)
        counted = unpack_bits(simulation.score.counted_masks[0], cells.shape[1])
        assert np.array_equal(cells & counted, unpack_bits(masks[row], cells.shape[1]))
        assert np.array_equal(simulation.score.masks[row], masks[row])
    assert np.array_equal(simulation.ranges, ranges)
    assert np.array_equal(simulation.score.seen, seen)


def test_what_a_robot_has_seen_grows_as_it_drives():
    simulation = scanned()
    before = unpack_bits(simulation.score.masks[0], 240)
    for _ in range(30):
        simulation.step(np.array([[0.0, 1.0], [0.0, 0.0]]))
    after = unpack_bits(simulation.score.masks[0], 240)
    assert (after >= before).all()
    assert after.sum() > before.sum()


def test_beams_are_as_long_as_their_ranges_and_invalid_ones_have_no_length():
    sensor = np.zeros(10)
    sensor[RANGE_MAX], sensor[MAP_RESOLUTION] = 6.0, 0.05
    lengths = np.full(4, -1.0)
    true_lengths(np.array([1.5, math.inf, math.nan, 6.0], np.float32), sensor, lengths)
    assert lengths == pytest.approx([30.0, 120.0, 0.0, 120.0])


@pytest.mark.parametrize("place", [(100.7, 80.2), (3.0, -5.5), (640.0, 1000.9)])
def test_a_window_begins_at_a_whole_word_and_holds_all_that_is_in_reach(place):
    reach = 56.3
    row, column = window_corner(*place, reach)
    assert column % 64 == 0
    assert row <= math.floor(place[1] - reach) - 1
    assert column <= math.floor(place[0] - reach) - 1
    assert row + window_rows(reach) >= place[1] + reach + 1
    assert column + 64 * window_words(reach) >= place[0] + reach + 1

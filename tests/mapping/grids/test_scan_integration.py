"""Seen cells are lowered, and cells in which beams ended raised, each once."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.mapping.grids.pooled_maps import untouched
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.grids.scan_integration import DEVIATIONS, STEP, SeenScan, integrate_scan, settle_returns

INCREMENTS = np.array([9, 4, -20, 30], np.int64)


def scan_of(seen, cells, is_hit, offset):
    """A scan that has seen cells (rows, columns) of a window, with ends of beams in cells (x, y)."""
    rows, columns = seen.shape
    bits = np.packbits(seen, axis=1, bitorder="little").view(np.uint64)
    ends = np.array(cells, np.float64).T + 0.4
    box = (0, rows, 0, columns // 64)
    return SeenScan(bits, np.zeros_like(bits), box, ends, np.array(is_hit), *offset)


@pytest.mark.parametrize("offset", [(0, 0), (5, 64), (-7, -64), (38, 128)])
def test_a_map_is_updated_cell_by_cell_as_is_defined(offset):
    generator = np.random.default_rng(3)
    log_odds = generator.integers(-20, 31, (48, 192)).astype(np.int8)
    seen = generator.random((16, 128)) < 0.4
    cells = generator.integers(0, (128, 16), (60, 2))
    is_hit = generator.random(60) < 0.7
    hits = np.zeros_like(seen)
    hits[cells[is_hit, 1], cells[is_hit, 0]] = True
    expected, touched = log_odds.copy().astype(int), untouched(48, 192)
    for row in range(16):
        for column in range(128):
            i, j = row + offset[0], column + offset[1]
            if 0 <= i < 48 and 0 <= j < 192:
                if hits[row, column]:
                    expected[i, j] = min(expected[i, j] + 9, 30)
                elif seen[row, column]:
                    expected[i, j] = max(expected[i, j] - 4, -20)
    before = log_odds.copy()
    integrate_scan(log_odds, scan_of(seen, cells, is_hit, offset), INCREMENTS, touched)
    np.testing.assert_array_equal(log_odds, expected)
    # Words in which one of the three levels has changed are noted, with their rows, and no others.
    changed = (np.sign(log_odds) != np.sign(before)).reshape(48, 3, 64).any(axis=2)
    marked = (touched[:48, :1] >> np.arange(3, dtype=np.uint64)) & np.uint64(1)
    np.testing.assert_array_equal(marked.astype(bool), changed)
    rows = [bool(int(touched[48, 0]) >> row & 1) for row in range(48)]
    assert rows == changed.any(axis=1).tolist()


def test_nothing_is_noted_where_no_notes_are_taken():
    log_odds = np.zeros((8, 64), np.int8)
    seen = np.ones((8, 64), np.bool_)
    integrate_scan(log_odds, scan_of(seen, [(3, 2)], [True], (0, 0)), INCREMENTS, np.zeros((0, 1), np.uint64))
    assert log_odds[2, 3] == 9
    assert (np.delete(log_odds.ravel(), 2 * 64 + 3) == -4).all()


FORWARD = ScanGeometry(beams=61, field_of_view=math.radians(60.0), range_min=0.05, range_max=6.0)
NOISE = (0.03, 0.0)
WALL = 2.02
"""A wall across the way ahead: its near side lies in the middle of a cell of 5 cm."""


def ranges_to(wall):
    return (wall / np.cos(FORWARD.angles)).astype(np.float32)


def grid_before_wall(scans=3):
    grid = OccupancyGrid(OccupancySettings(resolution=0.05))
    for _ in range(scans):
        grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL), FORWARD, NOISE)
    return grid


def column_of(grid, x):
    """Return the log-odds of the cells ahead of the laser in a column, within 0.5 m of its axis."""
    first, (x_low, y_low) = 0.05, grid.origin
    column = math.floor((x - x_low) / first)
    rows = [math.floor((y - y_low) / first) for y in np.arange(-0.475, 0.5, 0.05)]
    return grid.log_odds[rows, column]


def settled_one_by_one(log_odds, x, y, lengths, directions, is_hit, deviation, share, occupied):
    """Return the lengths of the beams as the module tells it, beam by beam."""
    around = np.pad(log_odds, 2)

    def level(row, column):
        inside = -2 <= row < len(log_odds) + 2 and -2 <= column < log_odds.shape[1] + 2
        return around[row + 2, column + 2] if inside else 0

    result = lengths.copy()
    for beam in np.flatnonzero(is_hit):
        end = lengths[beam]
        row, column = math.floor(y + end * directions[1, beam]), math.floor(x + end * directions[0, beam])
        if any(level(row + up, column + right) < 0 for up, right in ((1, 0), (-1, 0), (0, 1), (0, -1))):
            continue
        at = end
        while at >= max(end - DEVIATIONS * max(deviation, share * end) - 1.0, 0.0):
            if level(math.floor(y + at * directions[1, beam]), math.floor(x + at * directions[0, beam])) >= occupied:
                result[beam] = at
                break
            at -= STEP
    return result


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    rows=st.integers(1, 20),
    columns=st.sampled_from([64, 128]),
    shares=st.sampled_from([(0.0, 0.1), (0.02, 0.1), (0.3, 0.3), (0.9, 0.05)]),
    noise=st.sampled_from([(0.5, 0.0), (2.0, 0.0), (0.2, 0.05)]),
)
def test_returns_settle_as_told_beam_by_beam_at_the_border_and_beyond_it_too(seed, rows, columns, shares, noise):
    generator = np.random.default_rng(seed)
    log_odds = generator.choice(
        np.array([-20, 0, 20], np.int8), (rows, columns), p=[shares[0], 1.0 - sum(shares), shares[1]]
    )
    x, y = generator.uniform((0.0, 0.0), (columns, rows))
    angles, is_hit = generator.uniform(-math.pi, math.pi, 200), generator.random(200) < 0.8
    lengths, directions = (
        generator.uniform(0.0, 1.5 * rows + 5.0, 200),
        np.array([np.cos(angles), np.sin(angles)]),
    )
    expected = settled_one_by_one(log_odds, x, y, lengths, directions, is_hit, *noise, 15)
    settle_returns(log_odds, x, y, lengths, directions, is_hit, (float(noise[0]), float(noise[1])), 15)
    np.testing.assert_array_equal(lengths, expected)


def test_a_return_just_behind_a_wall_counts_as_one_of_the_wall():
    grid = grid_before_wall()
    before = column_of(grid, WALL).copy()
    grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL + 0.1), FORWARD, NOISE)
    assert (column_of(grid, WALL + 0.1) == 0).all()
    assert (column_of(grid, WALL) >= before).all()


def test_a_return_far_behind_a_wall_tells_of_another_one():
    grid = grid_before_wall()
    grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL + 0.4), FORWARD, NOISE)
    assert (column_of(grid, WALL + 0.4) > 0).all()
    assert (column_of(grid, WALL + 0.2) < 0).all()


def test_without_noise_returns_are_believed_as_they_are():
    grid = grid_before_wall()
    grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL + 0.1), FORWARD)
    assert (column_of(grid, WALL + 0.1) > 0).all()


def test_what_was_marked_before_a_wall_by_chance_is_taken_back():
    grid = OccupancyGrid(OccupancySettings(resolution=0.05))
    grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL - 0.1), FORWARD, NOISE)
    for _ in range(10):
        grid.integrate((0.0, 0.0, 0.0), ranges_to(WALL + 0.06), FORWARD, NOISE)
    assert (column_of(grid, WALL - 0.1) < 0).all()
    assert (column_of(grid, WALL + 0.06) > 0).all()


def test_the_next_piece_of_a_wall_along_which_beams_graze_is_drawn_where_it_is():
    fine = ScanGeometry(beams=721, field_of_view=math.radians(60.0), range_min=0.05, range_max=6.0)
    along = 0.52 / np.sin(np.maximum(fine.angles, 0.01))
    whole = np.where(along <= 3.0, along, np.nan).astype(np.float32)
    begun = np.where(along <= 2.0, along, np.nan).astype(np.float32)
    grid = OccupancyGrid(OccupancySettings(resolution=0.05))
    for ranges in (begun, whole, whole, whole):
        grid.integrate((0.0, 0.0, 0.0), ranges, fine, NOISE)
    ends = np.stack([whole * np.cos(fine.angles), whole * np.sin(fine.angles)], axis=1)[whole > 2.0]
    columns, rows = np.floor((ends - grid.origin) / 0.05).astype(int).T
    assert (grid.log_odds[rows, columns] > 0).all()


@pytest.mark.parametrize("deviation", [0.02, 0.03, 0.05])
@pytest.mark.parametrize("seed", range(5))
def test_a_wall_stays_thin_however_often_noise_is_drawn(seed, deviation):
    generator = np.random.default_rng(seed)
    plain, settled = (OccupancyGrid(OccupancySettings(resolution=0.05)) for _ in range(2))
    for _ in range(100):
        ranges = (ranges_to(WALL) + generator.normal(0.0, deviation, FORWARD.beams)).astype(np.float32)
        plain.integrate((0.0, 0.0, 0.0), ranges, FORWARD)
        settled.integrate((0.0, 0.0, 0.0), ranges, FORWARD, (deviation, 0.0))
    behind = {
        name: sum((column_of(grid, WALL + 0.05 * k) > 0).sum() for k in range(1, 6))
        for name, grid in (("p", plain), ("s", settled))
    }
    assert behind["p"] > 0
    assert behind["s"] <= 0.7 * behind["p"]
    assert np.any([column_of(settled, WALL + x) > 0 for x in (-0.05, 0.0, 0.05)], axis=0).mean() >= 0.9


@pytest.mark.parametrize("noise", [(-0.01, 0.0), (0.0, math.nan), (math.inf, 0.0)])
def test_noise_that_makes_no_sense_is_refused(noise):
    with pytest.raises(ValueError, match="noise is"):
        OccupancyGrid().integrate((0.0, 0.0, 0.0), ranges_to(WALL), FORWARD, noise)


def test_a_noisy_robot_draws_walls_nearly_as_well_as_one_without_noise():
    history = History()
    env = WatchedExploration(
        "apartment", make_settings(robots=1, noise="datasheet", resolution=0.05), watchers=[history]
    )
    episode = run_episode(lidarium.policy("nearest_frontier"), env, seed=0)
    result = result_of(episode, "nearest_frontier", history)
    assert result["iou_occupied"] >= 0.88

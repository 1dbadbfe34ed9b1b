"""What changes in a team's map, told in words of bits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from team_planes import FAR, blank_planes, levels_of_sum, records_of

from lidarium.mapping.grids.map_deltas import (
    OverlaidMaps,
    levels_of_planes,
    note_changes,
    note_overlaid_changes,
)


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 9), st.integers(1, 4), st.floats(0.0, 1.0))
def test_changes_lead_from_map_to_map(seed, robots, rows, words, share):
    generator = np.random.default_rng(seed)
    maps = [np.zeros((rows, words * 64), np.int8) for _ in range(robots)]
    known, occupied, buffer = blank_planes(rows, words)
    told = np.zeros((2, rows * words), np.uint64)
    places = np.zeros((robots, 2))
    for _ in range(4):
        for log_odds in maps:
            is_new = generator.random(log_odds.shape) < share
            log_odds[is_new] = generator.integers(-127, 128, log_odds.shape)[is_new]
        count = note_changes(
            records_of(maps), places, places.copy(), FAR, np.array([0.0, 0.0, 1.0]), known, occupied, buffer
        )
        changes = buffer[:count]
        assert len(set(changes[:, 0].tolist())) == count
        assert (changes[:, 1] | changes[:, 2]).all()
        told[0, changes[:, 0].astype(np.int64)] ^= changes[:, 1]
        told[1, changes[:, 0].astype(np.int64)] ^= changes[:, 2]
        want = levels_of_sum(np.sum(maps, axis=0, dtype=np.int64))
        np.testing.assert_array_equal(levels_of_planes(known, occupied), want)
        np.testing.assert_array_equal(levels_of_planes(*told.reshape(2, words, rows).transpose(0, 2, 1)), want)


def test_only_what_robots_can_have_seen_is_looked_at():
    log_odds = np.full((200, 256), -1, np.int8)
    known, occupied, buffer = blank_planes(200, 4)
    poses, last = np.array([[5.0, 5.0, 0.0]]), np.array([[4.0, 6.0]])
    count = note_changes(records_of([log_odds]), poses, last, 1.0, np.array([0.0, 0.0, 0.1]), known, occupied, buffer)
    seen = np.argwhere(levels_of_planes(known, occupied) == 255)
    # Rows from 4 to 7 m; columns from 3 to 6 m, in whole words of 6.4 m.
    assert seen.min(axis=0).tolist() == [40, 0]
    assert seen.max(axis=0).tolist() == [70, 63]
    assert count == 31
    np.testing.assert_array_equal(last, [[5.0, 5.0]])


def test_robots_beyond_the_map_are_no_harm():
    log_odds = np.full((8, 64), 3, np.int8)
    known, occupied, buffer = blank_planes(8, 1)
    for place in (-50.0, 50.0):
        poses = np.full((1, 3), place)
        assert (
            note_changes(
                records_of([log_odds]),
                poses,
                poses[:, :2].copy(),
                1.0,
                np.array([0.0, 0.0, 0.1]),
                known,
                occupied,
                buffer,
            )
            == 0
        )


@pytest.mark.parametrize(("known", "occupied", "level"), [(0, 0, 127), (1, 0, 255), (1, 1, 0)])
def test_planes_are_three_levels(known, occupied, level):
    planes = np.array([[known << 63]], np.uint64), np.array([[occupied << 63]], np.uint64)
    levels = levels_of_planes(*planes)
    assert levels.shape == (1, 64)
    assert levels[0, 63] == level
    assert (levels[0, :63] == 127).all()


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.integers(1, 3))
def test_turned_maps_are_laid_over_the_lattice_where_they_changed(seed, robots):
    generator = np.random.default_rng(seed)
    resolution, rows, words = 0.1, 70, 2
    maps = [np.zeros((128, 128), np.int8) for _ in range(robots)]
    before = [np.zeros((128, 128), np.int8) for _ in range(robots)]
    placements = np.array(
        [
            (-1.0, -2.0, *generator.uniform(0.0, 5.0, 2), math.cos(theta), math.sin(theta), -6.4, -6.4)
            for theta in generator.uniform(-math.pi, math.pi, robots)
        ]
    )
    known, occupied, buffer = blank_planes(rows, words)
    poses, last = np.zeros((robots, 3)), np.zeros((robots, 2))
    addresses = np.array([log_odds.ctypes.data for log_odds in before])
    for _ in range(3):
        for log_odds in maps:
            row, column = generator.integers(0, 110, 2)
            log_odds[row : row + 9, column : column + 15] = generator.integers(-127, 128, (9, 15))
        overlaid = OverlaidMaps(records_of(maps), addresses, placements, resolution)
        note_overlaid_changes(overlaid, poses, last, FAR, known, occupied, buffer)
        np.testing.assert_array_equal(
            levels_of_planes(known, occupied),
            levels_of_sum(laid_slowly(maps, placements, resolution, rows, words)),
        )


def laid_slowly(maps, placements, resolution, rows, words):
    total = np.zeros((rows, words * 64), np.int64)
    for log_odds, (corner_x, corner_y, start_x, start_y, cosine, sine, own_x, own_y) in zip(
        maps, placements, strict=True
    ):
        y, x = np.meshgrid(
            (np.arange(rows) + 0.5) * resolution, (np.arange(words * 64) + 0.5) * resolution, indexing="ij"
        )
        east, north = x + corner_x - start_x, y + corner_y - start_y
        i = np.floor((cosine * north - sine * east - own_y) / resolution).astype(int)
        j = np.floor((cosine * east + sine * north - own_x) / resolution).astype(int)
        is_inside = (i >= 0) & (i < log_odds.shape[0]) & (j >= 0) & (j < log_odds.shape[1])
        total[is_inside] += log_odds[i[is_inside], j[is_inside]]
    return total

"""Changes of a team's map made of maps in frames of their own."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from team_planes import FAR, blank_planes, levels_of_sum, records_of

from lidarium.mapping.grids.map_deltas import levels_of_planes
from lidarium.mapping.grids.overlaid_deltas import OverlaidMaps, note_overlaid_changes


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

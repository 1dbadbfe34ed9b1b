import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, room

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.corners import STEP, CornerSettings, _orientation_table, detect_corners

ALL = CornerSettings(separation_m=0.0, limit=0)


def test_a_room_has_four_corners_that_open_inwards():
    corners = detect_corners(room(blank(60, 80), 10, 20, 30, 40), RESOLUTION)
    assert corners.neighbours.tolist() == [5, 5, 5, 5]
    assert corners.cells.tolist() == [[20, 10], [59, 10], [20, 39], [59, 39]]
    assert np.degrees(corners.angles).tolist() == [45.0, 135.0, 315.0, 225.0]
    np.testing.assert_allclose(corners.points, (corners.cells + 0.5) * RESOLUTION)


def test_a_room_without_its_corner_cells_has_the_same_corners():
    levels = room(blank(60, 80), 10, 20, 30, 40, wall=1)
    for row, column in ((9, 19), (9, 60), (40, 19), (40, 60)):
        levels[row, column] = UNKNOWN
    corners = detect_corners(levels, RESOLUTION)
    assert corners.neighbours.tolist() == [4, 4, 4, 4]
    assert np.degrees(corners.angles).tolist() == [45.0, 135.0, 315.0, 225.0]


def test_the_outside_of_a_box_is_no_corner():
    levels = np.full((60, 60), FREE, np.uint8)
    levels[20:40, 20:40] = OCCUPIED
    assert len(detect_corners(levels, RESOLUTION, ALL)) == 0


@pytest.mark.parametrize("size", [(161, 203), (160, 200), (37, 64)])
def test_a_quarter_turn_of_the_map_turns_its_corners(size):
    levels = np.ascontiguousarray(apartment()[: size[0], : size[1]])
    # Counter-clockwise with row 0 below: column and row become minus row and column.
    turned = np.ascontiguousarray(np.rot90(levels, -1))
    before, after = detect_corners(levels, RESOLUTION, ALL), detect_corners(turned, RESOLUTION, ALL)
    where = {
        (levels.shape[0] - 1 - y, x, round(angle + 4) % 16)
        for (x, y), angle in zip(before.cells.tolist(), before.angles / STEP, strict=True)
    }
    assert where == {
        (x, y, round(angle) % 16) for (x, y), angle in zip(after.cells.tolist(), after.angles / STEP, strict=True)
    }
    assert len(before)


def test_every_corner_is_found_wherever_the_words_of_eight_cells_begin():
    for shift in range(9):
        levels = room(blank(40, 61), 9, 11 + shift, 20, 23)
        assert len(detect_corners(levels, RESOLUTION)) == 4


def test_the_detector_agrees_with_a_slow_one():
    generator = np.random.default_rng(3)
    levels = generator.choice(np.array([OCCUPIED, UNKNOWN, FREE], np.uint8), (50, 45), p=[0.5, 0.1, 0.4])
    table = _orientation_table()
    around = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
    expected = set()
    for row in range(1, 49):
        for column in range(1, 44):
            code = sum(1 << bit for bit, (y, x) in enumerate(around) if levels[row + y, column + x] == OCCUPIED)
            if levels[row, column] == FREE and table[code]:
                expected.add((column, row))
    assert set(map(tuple, detect_corners(levels, RESOLUTION, ALL).cells.tolist())) == expected
    assert expected


def test_corners_that_lie_close_give_way_to_better_ones():
    corners = detect_corners(apartment(), RESOLUTION, CornerSettings(separation_m=1.0, limit=0))
    distances = np.linalg.norm(corners.points[:, None] - corners.points[None], axis=2) + 10.0 * np.eye(len(corners))
    assert distances.min() >= 1.0
    assert len(detect_corners(apartment(), RESOLUTION, CornerSettings(limit=5))) == 5


def test_greys_are_cut_into_three_levels():
    levels = room(blank(60, 80), 10, 20, 30, 40)
    grey = np.select([levels == OCCUPIED, levels == FREE], [20, 230], 150).astype(np.uint8)
    np.testing.assert_array_equal(detect_corners(grey, RESOLUTION).cells, detect_corners(levels, RESOLUTION).cells)


@pytest.mark.parametrize("size", [(1, 1), (2, 30), (3, 3), (1, 8)])
def test_tiny_maps_have_no_corners(size):
    assert len(detect_corners(np.full(size, FREE, np.uint8), RESOLUTION)) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"neighbours": ()}, "neighbours"),
        ({"neighbours": (3,)}, "neighbours"),
        ({"rule": "mod3"}, "rule"),
        ({"separation_m": -1.0}, "separation"),
        ({"limit": -1}, "limit"),
        ({"free_above": 10}, "greys"),
    ],
)
def test_bad_settings_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        CornerSettings(**options)


@pytest.mark.parametrize("grey", range(256))
def test_every_grey_counts_as_the_level_it_is_nearest_to_wherever_it_stands(grey):
    room = np.full((24, 24), FREE, np.uint8)
    room[[4, -5], 4:-4] = room[4:-4, [4, -5]] = OCCUPIED
    levels = np.where(room == OCCUPIED, np.uint8(grey), room)
    expected = 4 if grey < CornerSettings().occupied_below else 0
    assert len(detect_corners(levels, 0.1, CornerSettings(separation_m=0.0, neighbours=(5,)))) == expected


TABLE = {
    0xD8: 45.0,
    0x63: 135.0,
    0x8D: 225.0,
    0x36: 315.0,
    0xF8: 45.0,
    0xE3: 135.0,
    0x8F: 225.0,
    0x3E: 315.0,
    0xFC: 22.5,
    0xF9: 67.5,
    0xF3: 112.5,
    0xE7: 157.5,
    0xCF: 202.5,
    0x9F: 247.5,
    0x3F: 292.5,
    0x7E: 337.5,
}


def angles_of(table):
    return {code: round(math.degrees((int(table[code]) - 1) * STEP), 9) for code in range(256) if table[code]}


def turned_code(code):
    return (code << 2 | code >> 6) & 0xFF


def mirrored_code(code):
    """Swap what lies left and right of the x axis."""
    return sum(1 << (-i % 8) for i in range(8) if code >> i & 1)


def test_the_table_holds_the_sixteen_corners():
    assert angles_of(_orientation_table()) == TABLE


def test_the_table_looks_alike_in_all_directions():
    angles = angles_of(_orientation_table("table", (4, 5, 6, 7)))
    for code, angle in angles.items():
        assert angles[turned_code(code)] == (angle + 90.0) % 360.0
        assert angles[mirrored_code(code)] == -angle % 360.0


@pytest.mark.parametrize(("rule", "counts"), [("table", (4, 4, 8, 8)), ("literal", (4, 12, 16, 8))])
def test_each_number_of_neighbours_can_be_had_alone(rule, counts):
    assert tuple(np.count_nonzero(_orientation_table(rule, (r,))) for r in (4, 5, 6, 7)) == counts
    assert np.count_nonzero(_orientation_table(rule, (5, 6))) == counts[1] + counts[2]


def test_the_literal_rule_favours_one_diagonal():
    codes = set(angles_of(_orientation_table("literal", (5,))))
    assert {turned_code(code) for code in codes} != codes

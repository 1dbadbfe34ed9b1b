"""The seen area against its definition, cell by cell: fans between neighbouring beams, cut at the nearer
range at edges."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.scan_geometry import ScanGeometry, beam_directions
from lidarium.mapping.grids.scan_polygon import (
    GRAZING,
    _Outline,
    _row_of,
    _toggle_between,
    _toggle_bit,
    _toggle_edge,
    _toggle_edges,
    fill_scan_polygon,
    scan_ends,
    window_rows,
    window_words,
)


def fill(ranges, geometry, heading, x, y, reach):
    """Bits of the window as a mask (rows, columns), with the rows that may hold bits."""
    directions = np.empty((4, geometry.beams))
    beam_directions(heading, geometry.unit_vectors, directions)
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    lengths, ends = np.asarray(ranges, np.float64), np.empty((2, geometry.beams))
    scan_ends(lengths, directions, x, y, ends)
    box = fill_scan_polygon(lengths, directions, ends, x, y, geometry.angle_increment, geometry.is_full_circle, bits)
    return np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little").astype(bool), box[:2], directions


def outline(ranges, geometry, directions, x, y):
    """Corners of the seen polygon, as the module describes it: where no surface can join two ends, the fan
    ends at the nearer range."""
    beams = len(ranges)
    corners = [] if geometry.is_full_circle else [(x, y)]
    for k in range(beams):
        after = (k + 1) % beams
        corners.append((x + ranges[k] * directions[0, k], y + ranges[k] * directions[1, k]))
        near, longer = min(ranges[k], ranges[after]), k if ranges[k] > ranges[after] else after
        is_edge = abs(ranges[k] - ranges[after]) > 1.0 + GRAZING * geometry.angle_increment * near
        if is_edge and (geometry.is_full_circle or after):
            corners.append((x + near * directions[0, longer], y + near * directions[1, longer]))
    return np.array(corners)


def inside_by_rows(shape, corners):
    """Which cell centres lie inside by the even-odd rule, and which lie on the outline as far as rounding
    can tell."""
    (ax, ay), (bx, by) = corners.T, np.roll(corners, -1, axis=0).T
    inside, unsure = np.zeros(shape, bool), np.zeros(shape, bool)
    centres = np.arange(shape[1]) + 0.5
    for row in range(shape[0]):
        y = row + 0.5
        crosses = (ay < y) != (by < y)
        at = np.sort(ax[crosses] + (y - ay[crosses]) * (bx[crosses] - ax[crosses]) / (by[crosses] - ay[crosses]))
        inside[row] = np.searchsorted(at, centres, side="right") % 2 == 1
        unsure[row] = np.searchsorted(at, centres + 1e-7) != np.searchsorted(at, centres - 1e-7)
    return inside, unsure


def room_ranges(geometry, heading, generator, reach):
    """Ranges in a random room with pillars: walls as lines, no return beyond the reach."""
    angles = heading + geometry.angles
    near = np.full(geometry.beams, math.inf)
    for _ in range(int(generator.integers(2, 7))):
        normal, distance = generator.uniform(-math.pi, math.pi), generator.uniform(2.0, 1.3 * reach)
        facing = np.cos(angles - normal)
        near = np.minimum(near, np.where(facing > 1e-9, distance / np.maximum(facing, 1e-9), math.inf))
    for _ in range(int(generator.integers(0, 6))):
        centre, width = generator.integers(0, geometry.beams), generator.integers(1, 9)
        near[max(centre - width, 0) : centre + width] = generator.uniform(1.0, reach)
    return np.minimum(near, reach)


CASES = [
    (727, math.radians(240.0), 112.0),
    (180, 2.0 * math.pi, 60.0),
    (40, math.radians(90.0), 40.0),
    (9, 2.0 * math.pi, 20.0),
]


@pytest.mark.parametrize(("beams", "view", "reach"), CASES)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_the_seen_area_is_the_polygon_of_its_definition_cell_by_cell(beams, view, reach, seed):
    generator = np.random.default_rng(seed)
    geometry = ScanGeometry(beams=beams, field_of_view=view, range_max=reach)
    heading = generator.uniform(-math.pi, math.pi)
    ranges = room_ranges(geometry, heading, generator, reach)
    x, y = (
        int(reach) + 3 + generator.uniform(0.0, 1.0) + generator.integers(0, 64),
        int(reach) + 3 + generator.uniform(0.0, 1.0),
    )
    seen, _, directions = fill(ranges, geometry, heading, x, y, reach)
    inside, unsure = inside_by_rows(seen.shape, outline(ranges, geometry, directions, x, y))
    assert unsure.sum() < 30
    assert np.array_equal(seen[~unsure], inside[~unsure])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_the_rows_told_hold_all_bits(seed):
    generator = np.random.default_rng(seed)
    geometry = ScanGeometry(beams=120, field_of_view=generator.choice([1.0, 4.0, 2.0 * math.pi]), range_max=30.0)
    ranges = generator.uniform(0.0, 30.0, 120)
    seen, (low, high), _ = fill(ranges, geometry, generator.uniform(-4.0, 4.0), 40.3, 33.6, 30.0)
    assert not seen[:low].any()
    assert not seen[high:].any()


def test_nothing_is_claimed_behind_an_edge():
    geometry = ScanGeometry(beams=91, field_of_view=math.radians(90.0), range_max=60.0)
    ranges = np.full(91, 50.0)
    ranges[:45] = 10.0
    seen, _, _ = fill(ranges, geometry, 0.0, 70.5, 70.5, 60.0)
    # The edge lies between the beams at -1 and 0 degrees; everything below belongs to the near surface.
    below = [
        (70 + int(r * math.sin(math.radians(-1.5))), 70 + int(r * math.cos(math.radians(-1.5)))) for r in range(14, 48)
    ]
    assert not any(seen[row, column] for row, column in below if row < 70)
    assert seen[70 + 5, 70 + 40]


def test_a_surface_seen_at_ten_degrees_is_seen_whole():
    """The end points of neighbouring beams on a wall along the corridor belong together."""
    geometry = ScanGeometry(beams=727, field_of_view=math.radians(240.0), range_max=112.0)
    angles = geometry.angles
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(np.abs(angles) < math.pi / 2, 12.0 / np.maximum(np.abs(np.sin(angles)), 1e-12), 112.0),
            112.0,
        )
    ranges[np.abs(angles) >= math.pi / 2] = 1.0
    seen, _, _ = fill(ranges, geometry, 0.0, 120.5, 120.5, 112.0)
    along = int(12.0 / math.tan(math.radians(10.0)))
    assert seen[120 - 11 : 120 + 12, 120 + 20 : 120 + along].all()


@pytest.mark.parametrize("beams", [1, 2])
def test_a_scan_without_area_sees_nothing(beams):
    geometry = ScanGeometry(beams=beams, field_of_view=0.5, range_max=30.0)
    ranges = np.full(beams, 20.0 if beams == 1 else 0.0)
    seen, _, _ = fill(ranges, geometry, 0.2, 40.0, 40.0, 30.0)
    assert not seen.any()


def test_beams_that_say_nothing_leave_a_gap():
    geometry = ScanGeometry(beams=91, field_of_view=math.radians(90.0), range_max=40.0)
    ranges = np.full(91, 30.0)
    ranges[40:51] = 0.0
    seen, _, _ = fill(ranges, geometry, 0.0, 50.5, 50.5, 40.0)
    assert not seen[50, 52:85].any()
    assert seen[50 + 12, 50 + 20]
    assert seen[50 - 12, 50 + 20]


ROWS, WIDTH, PLACE = 128, 128, 62.3
TURN = 0.01
"""Of the laser, so that no beam runs along an axis [rad]."""


def outline_of(lengths, steepness=1.0):
    """An outline of beams all around a laser in the middle of a window."""
    angles = ScanGeometry(beams=len(lengths), field_of_view=2.0 * math.pi).angles + TURN
    unit = np.stack([np.cos(angles), np.sin(angles)])
    directions = np.concatenate([unit, 1.0 / unit])
    lengths = np.asarray(lengths, np.float64)
    return _Outline(lengths, directions, PLACE + lengths * unit, PLACE, PLACE, steepness)


def toggled(outline, at_once):
    words = np.zeros((ROWS, WIDTH // 64), np.uint64)
    if at_once:
        rows = np.array([_row_of(y) for y in outline.ends[1].tolist()], np.int32)
        _toggle_edges(words.ctypes.data, WIDTH, outline, rows)
    else:
        for k in range(len(outline.lengths) - 1):
            _toggle_between(words.ctypes.data, WIDTH, outline, k, k + 1)
    return words


@pytest.mark.parametrize("seed", range(6))
def test_all_edges_at_once_toggle_what_they_do_one_by_one(seed):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(20, 400))
    lengths = 20.0 + 15.0 * np.sin(np.arange(count) * 0.05) + generator.uniform(-2.0, 2.0, count)
    lengths[generator.random(count) < 0.1] = 50.0
    outline = outline_of(lengths, generator.choice([0.05, 1.0]))
    once = toggled(outline, True)
    assert once.any()
    np.testing.assert_array_equal(once, toggled(outline, False))


def test_between_a_near_and_a_far_end_the_outline_goes_along_the_far_beam():
    # Beams from -pi on; those ahead are far, with an edge to their right and left.
    lengths = np.full(64, 10.0)
    lengths[24:40] = 40.0
    outline = outline_of(lengths, 0.1)
    words = toggled(outline, True)
    last = np.zeros_like(words)
    _toggle_between(last.ctypes.data, WIDTH, outline, 63, 0)
    inside = np.logical_xor.accumulate(
        np.unpackbits((words ^ last).view(np.uint8), bitorder="little").reshape(ROWS, WIDTH), axis=1
    )
    rows, columns = np.nonzero(inside)
    x, y = columns + 0.5 - PLACE, rows + 0.5 - PLACE
    beam = np.mod(np.arctan2(y, x) + math.pi - TURN, 2.0 * math.pi) / (2.0 * math.pi / 64)
    # Nothing is claimed behind the near ends, up to the far beams themselves.
    beyond = np.hypot(x, y) > 10.5
    assert ((beam[beyond] > 24.0 - 0.05) & (beam[beyond] < 39.0 + 0.05)).all()
    assert beyond.sum() > 500


EDGE_ROWS = 24


def bits_of(words):
    return np.unpackbits(words.view(np.uint8), bitorder="little").reshape(EDGE_ROWS, WIDTH).astype(bool)


def toggled_by(*edges):
    words = np.zeros((EDGE_ROWS, WIDTH // 64), np.uint64)
    for from_x, from_y, to_x, to_y in edges:
        _toggle_edge(words.ctypes.data, WIDTH, from_x, from_y, to_x, to_y, _row_of(from_y), _row_of(to_y))
    return bits_of(words)


def test_a_bit_is_toggled_back_and_forth():
    words = np.zeros((EDGE_ROWS, WIDTH // 64), np.uint64)
    for expected in (True, False):
        _toggle_bit(words.ctypes.data, 3 * WIDTH + 70)
        assert bits_of(words)[3, 70] == expected
        assert bits_of(words).sum() == expected


def test_an_edge_toggles_the_first_cell_centre_to_its_right_in_each_row_that_it_crosses():
    generator = np.random.default_rng(2)
    for from_x, from_y, to_x, to_y in generator.uniform((1, 0, 1, 0), (120, 23, 120, 23), (80, 4)).tolist():
        found = toggled_by((from_x, from_y, to_x, to_y))
        expected = np.zeros_like(found)
        for row in range(EDGE_ROWS):
            middle = row + 0.5
            if min(from_y, to_y) < middle <= max(from_y, to_y):
                x = from_x + (middle - from_y) * (to_x - from_x) / (to_y - from_y)
                expected[row, int(np.ceil(x - 0.5))] = True
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("corners", [[(10, 3), (90, 5), (40, 20)], [(5.5, 2.5), (60.5, 2.5), (60.5, 15), (5.5, 15)]])
def test_edges_of_a_polygon_toggle_its_inside_row_by_row(corners):
    # A cell whose centre lies on an edge is not right of it.
    edges = [(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True) if a[1] != b[1]]
    inside = np.logical_xor.accumulate(toggled_by(*edges), axis=1)
    for row in range(EDGE_ROWS):
        for column in range(WIDTH):
            x, y = column + 0.5, row + 0.5
            met = [edge for edge in edges if min(edge[1], edge[3]) < y <= max(edge[1], edge[3])]
            crossed = [ax + (y - ay) * (bx - ax) / (by - ay) < x for ax, ay, bx, by in met]
            assert inside[row, column] == (sum(crossed) % 2 == 1)


def test_corners_count_once_and_flat_edges_toggle_nothing():
    assert _row_of(3.49) == 3
    assert _row_of(3.5) == 4
    assert not toggled_by((3.0, 4.6, 90.0, 5.4)).any()

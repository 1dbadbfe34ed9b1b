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
    box = fill_scan_polygon(
        lengths, directions, ends, x, y, geometry.angle_increment, geometry.is_full_circle, bits
    )
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
        at = np.sort(
            ax[crosses] + (y - ay[crosses]) * (bx[crosses] - ax[crosses]) / (by[crosses] - ay[crosses])
        )
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
    geometry = ScanGeometry(
        beams=120, field_of_view=generator.choice([1.0, 4.0, 2.0 * math.pi]), range_max=30.0
    )
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
        (70 + int(r * math.sin(math.radians(-1.5))), 70 + int(r * math.cos(math.radians(-1.5))))
        for r in range(14, 48)
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

"""Maps from scans: exact where the scan is, bounded, growing without moving, and each cell once a scan."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.grids.occupancy import (
    FREE,
    LOG_ODDS_UNIT,
    OCCUPIED,
    UNKNOWN,
    OccupancyGrid,
    OccupancySettings,
)
from lidarium.mapping.grids.scan_geometry import ScanGeometry

RESOLUTION = 0.05


def rooms(generator, rows=70, columns=90):
    solid = np.zeros((rows, columns), bool)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = True, True, True, True
    for _ in range(6):
        row, column = generator.integers(2, rows - 4), generator.integers(2, columns - 4)
        height, width = (int(generator.integers(2, 30)), int(generator.integers(1, 4)))[:: generator.choice([-1, 1])]
        solid[row : row + height, column : column + width] = True
    return solid


def exact_ranges(solid, x, y, angles, range_max):
    """Ranges to the nearest solid square along each beam by intersection with all squares [m], inf where
    none is in reach."""
    rows, columns = np.nonzero(solid)
    low, high = (
        np.stack([columns, rows]) - np.array([[x], [y]]) / RESOLUTION,
        np.stack([columns, rows]) + 1 - np.array([[x], [y]]) / RESOLUTION,
    )
    ranges = np.empty(len(angles))
    for k, angle in enumerate(angles):
        with np.errstate(divide="ignore"):
            inverse = 1.0 / np.array([[math.cos(angle)], [math.sin(angle)]])
        first, second = low * inverse, high * inverse
        enter, leave = np.minimum(first, second).max(axis=0), np.maximum(first, second).min(axis=0)
        ranges[k] = np.min(enter[(enter < leave) & (leave > 0.0)], initial=math.inf) * RESOLUTION
    # Rounded up, as a range finder of the world hands them out: the end of a beam lies in the cell that it
    # met.
    return np.where(ranges <= range_max, ranges * (1.0 + 2e-7), math.inf).astype(np.float32)


def cells_on_truth(grid, solid):
    """Crop the map to the cells of the truth, whose cell (0, 0) lies at the origin."""
    row, column = (round(-value / RESOLUTION) for value in grid.origin[::-1])
    levels = grid.levels()
    return levels[row : row + solid.shape[0], column : column + solid.shape[1]]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("view", [math.radians(240.0), 2.0 * math.pi])
def test_a_dense_exact_scan_frees_no_solid_cell_and_occupies_no_free_one(seed, view):
    generator = np.random.default_rng(seed)
    solid = rooms(generator)
    geometry = ScanGeometry(beams=1200, field_of_view=view, range_max=4.0)
    free = np.argwhere(~solid)
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION))
    for _ in range(3):
        row, column = free[generator.integers(len(free))]
        x, y = (
            (column + generator.uniform(0.1, 0.9)) * RESOLUTION,
            (row + generator.uniform(0.1, 0.9)) * RESOLUTION,
        )
        heading = generator.uniform(-math.pi, math.pi)
        grid.integrate((x, y, heading), exact_ranges(solid, x, y, heading + geometry.angles, 4.0), geometry)
        levels = cells_on_truth(grid, solid)
        assert not (levels[solid] == FREE).any()
        assert not (levels[~solid] == OCCUPIED).any()
        assert (levels != UNKNOWN).any()


def test_a_closed_room_is_seen_whole_and_nothing_beyond_its_walls():
    solid = np.zeros((40, 60), bool)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = True, True, True, True
    geometry = ScanGeometry(beams=2000, field_of_view=2.0 * math.pi, range_max=5.0)
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION))
    grid.integrate((1.013, 0.987, 0.1), exact_ranges(solid, 1.013, 0.987, 0.1 + geometry.angles, 5.0), geometry)
    levels = cells_on_truth(grid, solid)
    assert (levels[1:-1, 1:-1] == FREE).all()
    corners = np.zeros_like(solid)
    corners[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert (levels[solid & ~corners] == OCCUPIED).all()
    known = grid.levels() != UNKNOWN
    assert known.sum() == (levels != UNKNOWN).sum()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_each_cell_changes_at_most_once_a_scan_by_hit_or_miss_within_the_bounds(seed):
    generator = np.random.default_rng(seed)
    settings_ = OccupancySettings(resolution=RESOLUTION)
    hit, miss, minimum, maximum = (int(value) for value in settings_.increments)
    grid = OccupancyGrid(settings_)
    geometry = ScanGeometry(beams=60, field_of_view=generator.choice([1.5, 4.0, 2.0 * math.pi]), range_max=1.5)
    pose = (*generator.uniform(-0.5, 0.5, 2), generator.uniform(-3.0, 3.0))
    for _ in range(14):
        ranges = generator.uniform(0.05, 1.6, 60).astype(np.float32)
        ranges[generator.random(60) < 0.2] = np.inf
        ranges[generator.random(60) < 0.1] = np.nan
        grid.contain(-3.0, -3.0, 3.0, 3.0)
        before = grid.log_odds.astype(int)
        row_low, row_high, column_low, column_high = grid.integrate(pose, ranges, geometry)
        after = grid.log_odds.astype(int)
        changed = after != before
        assert np.isin(
            after[changed],
            np.concatenate([np.minimum(before[changed] + hit, maximum), np.maximum(before[changed] - miss, minimum)]),
        ).all()
        raised, lowered = after > before, after < before
        assert (after[raised] == np.minimum(before[raised] + hit, maximum)).all()
        assert (after[lowered] == np.maximum(before[lowered] - miss, minimum)).all()
        assert after.min() >= minimum
        assert after.max() <= maximum
        outside = np.ones_like(changed)
        outside[row_low:row_high, column_low:column_high] = False
        assert not (changed & outside).any()


def test_the_cell_where_a_beam_ends_is_occupied_and_never_freed_by_the_same_scan():
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION))
    geometry = ScanGeometry(beams=9, field_of_view=0.05, range_max=2.0)
    grid.integrate((0.025, 0.025, 0.0), np.full(9, 1.01, np.float32), geometry)
    row, column = (round(-value / RESOLUTION) for value in grid.origin[::-1])
    assert grid.levels()[row, column + 20] == OCCUPIED
    assert grid.levels()[row, column + 10] == FREE
    assert grid.levels()[row, column + 21] == UNKNOWN


def test_values_saturate_at_their_bounds_and_come_back():
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION, minimum=-1.0, maximum=1.0))
    geometry = ScanGeometry(beams=9, field_of_view=0.05, range_max=2.0)
    for _ in range(20):
        grid.integrate((0.025, 0.025, 0.0), np.full(9, 1.01, np.float32), geometry)
    assert grid.log_odds.max() * LOG_ODDS_UNIT == pytest.approx(1.0)
    assert grid.log_odds.min() * LOG_ODDS_UNIT == pytest.approx(-1.0)
    for _ in range(3):
        grid.integrate((0.025, 0.025, 0.0), np.full(9, np.inf, np.float32), geometry)
    row, column = (round(-value / RESOLUTION) for value in grid.origin[::-1])
    assert grid.levels()[row, column + 20] == FREE


@pytest.mark.parametrize(("minimum", "maximum"), [(-6.35, 6.35), (-0.4, 0.85)])
def test_the_widest_and_the_narrowest_bounds_never_wrap_around(minimum, maximum):
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION, minimum=minimum, maximum=maximum))
    geometry = ScanGeometry(beams=60, field_of_view=1.0, range_max=2.0)
    for _ in range(40):
        grid.integrate((0.0, 0.0, 0.0), np.full(60, 1.0, np.float32), geometry)
    assert grid.log_odds.max() == round(maximum / LOG_ODDS_UNIT)
    assert grid.log_odds.min() == round(minimum / LOG_ODDS_UNIT)


def test_no_return_frees_up_to_the_range_and_occupies_nothing():
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION))
    geometry = ScanGeometry(beams=300, field_of_view=2.0 * math.pi, range_max=1.0)
    grid.integrate((0.0, 0.0, 0.0), np.full(300, np.inf), geometry)
    levels = grid.levels()
    assert not (levels == OCCUPIED).any()
    assert (levels == FREE).sum() * RESOLUTION**2 == pytest.approx(math.pi, rel=0.02)


@pytest.mark.parametrize("value", [np.nan, 0.0, -2.0, -1e6, -np.inf])
def test_an_invalid_scan_changes_nothing(value):
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION))
    geometry = ScanGeometry(beams=300, field_of_view=2.0 * math.pi, range_max=1.0)
    grid.integrate((0.0, 0.0, 0.0), np.full(300, value), geometry)
    assert not grid.log_odds.any()


def test_a_hit_beyond_the_range_counts_as_no_return():
    geometry = ScanGeometry(beams=300, field_of_view=2.0 * math.pi, range_max=1.0)
    far, none = (OccupancyGrid(OccupancySettings(resolution=RESOLUTION)) for _ in range(2))
    far.integrate((0.0, 0.0, 0.0), np.full(300, 1.5), geometry)
    none.integrate((0.0, 0.0, 0.0), np.full(300, np.inf), geometry)
    assert np.array_equal(far.log_odds, none.log_odds)


def test_a_grid_that_grew_in_steps_equals_one_made_large_at_once():
    generator = np.random.default_rng(1)
    geometry = ScanGeometry(beams=120, field_of_view=2.0 * math.pi, range_max=1.0)
    grown, large = (
        OccupancyGrid(OccupancySettings(resolution=RESOLUTION)),
        OccupancyGrid(OccupancySettings(resolution=RESOLUTION), (-20.0, -20.0, 20.0, 20.0)),
    )
    shapes = set()
    for _ in range(40):
        pose = (*generator.uniform(-8.0, 8.0, 2), generator.uniform(-3.0, 3.0))
        ranges = generator.uniform(0.2, 1.2, 120)
        grown.integrate(pose, ranges, geometry)
        large.integrate(pose, ranges, geometry)
        shapes.add(grown.log_odds.shape)
    assert len(shapes) > 2
    column, row = (round((a - b) / RESOLUTION) for a, b in zip(grown.origin, large.origin, strict=True))
    rows, columns = np.nonzero(large.log_odds)
    assert np.array_equal(grown.log_odds[rows - row, columns - column], large.log_odds[rows, columns])
    assert np.count_nonzero(grown.log_odds) == len(rows)


@given(x=st.floats(-30.0, 30.0), y=st.floats(-30.0, 30.0), first=st.floats(-3.0, 3.0))
@settings(max_examples=60)
def test_growth_keeps_origins_on_the_lattice_and_every_known_cell_in_its_place(x, y, first):
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION), (first, first, first + 1.0, first + 1.0))
    origin = grid.origin
    grid.log_odds[3, 5] = 7
    place = (origin[0] + 5.5 * RESOLUTION, origin[1] + 3.5 * RESOLUTION)
    grid.contain(x - 0.1, y - 0.1, x + 0.1, y + 0.1)
    column, row = (math.floor((p - o) / RESOLUTION) for p, o in zip(place, grid.origin, strict=True))
    assert grid.log_odds[row, column] == 7
    assert grid.log_odds.shape[1] % 64 == 0
    for value, start in zip(grid.origin, origin, strict=True):
        assert abs((value - start) / RESOLUTION - round((value - start) / RESOLUTION)) < 1e-6
    rows, columns = grid.log_odds.shape
    assert grid.origin[0] <= x - 0.1 + 1e-9
    assert grid.origin[1] <= y - 0.1 + 1e-9
    assert grid.origin[0] + columns * RESOLUTION >= x + 0.1 - 1e-9
    assert grid.origin[1] + rows * RESOLUTION >= y + 0.1 - 1e-9


def test_three_levels_and_probabilities_tell_the_sign_of_the_log_odds():
    grid = OccupancyGrid(OccupancySettings(resolution=RESOLUTION), (0.0, 0.0, 3.2, 0.05))
    grid.log_odds[0, :3] = (-20, 0, 20)
    assert grid.levels()[0, :3].tolist() == [FREE, UNKNOWN, OCCUPIED]
    probability = grid.probability()[0, :3]
    assert probability[1] == 0.5
    assert probability == pytest.approx([1 / (1 + math.e), 0.5, math.e / (1 + math.e)], rel=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": -1.0}, "resolution"),
        ({"resolution": math.nan}, "resolution"),
        ({"hit": 0.0}, "hit"),
        ({"miss": 0.01}, "miss"),
        ({"minimum": -0.1}, "minimum"),
        ({"maximum": 7.0}, "maximum"),
        ({"minimum": -7.0}, "minimum"),
    ],
)
def test_settings_that_cannot_be_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        OccupancySettings(**options)


def test_bad_scans_and_poses_are_refused_before_anything_changes():
    grid, geometry = OccupancyGrid(), ScanGeometry(beams=5)
    with pytest.raises(ValueError, match="pose"):
        grid.integrate((0.0, math.nan, 0.0), np.ones(5), geometry)
    with pytest.raises(ValueError, match=r"ranges have shape \(4,\)"):
        grid.integrate((0.0, 0.0, 0.0), np.ones(4), geometry)
    assert grid.log_odds.size == 0


def test_a_map_beyond_all_bounds_is_refused_with_the_cure():
    with pytest.raises(ValueError, match="coarser resolution"):
        OccupancyGrid(OccupancySettings(resolution=0.01), (0.0, 0.0, 1000.0, 1000.0))

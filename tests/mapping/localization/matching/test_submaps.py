"""Local maps keep what some neighbouring scans agree on."""

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast
from mapped_room import SUBMAPS, odd_room_submap

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, UNSEEN, Submap
from lidarium.mapping.localization.settings import SubmapSettings


@pytest.fixture(scope="module")
def submap():
    """The odd room as seen from places around its middle."""
    return odd_room_submap()


def test_what_moved_fades_and_what_stays_stays():
    submap = Submap(SUBMAPS, 8.0)
    far, near = np.full(GEOMETRY.beams, 3.0, np.float32), np.full(GEOMETRY.beams, 1.0, np.float32)
    submap.insert(np.zeros(3), near, GEOMETRY, 20.0)
    for _ in range(9):
        submap.insert(np.zeros(3), far, GEOMETRY, 20.0)
    grid = submap.finished()

    def highest(distance):
        cells = np.round(np.array([distance, 0.0]) / 0.05).astype(int) - np.array([grid.column, grid.row])
        return int(grid.levels[cells[1] - 2 : cells[1] + 3, cells[0] - 2 : cells[0] + 3].max())

    assert highest(1.0) < 40
    assert highest(3.0) > 100


def test_what_a_submap_has_not_seen_is_unseen_and_what_it_saw_through_free():
    submap = Submap(SUBMAPS, 8.0)
    submap.insert(np.zeros(3), np.full(GEOMETRY.beams, 2.0, np.float32), GEOMETRY, 20.0)
    grid = submap.grid
    assert grid.levels[-grid.row, -grid.column + 20] == FREE_LEVEL
    assert grid.levels[-grid.row, -grid.column + 60] == UNSEEN


def test_a_scan_that_does_not_fit_in_changes_nothing():
    submap = Submap(SUBMAPS, 6.0)
    assert not submap.insert(np.array([40.0, 0.0, 0.0]), np.full(GEOMETRY.beams, 2.0, np.float32), GEOMETRY, 20.0)
    assert submap.scans == 0
    assert not submap.grid.levels.any()
    assert submap.finished().levels.shape == (1, 1)


def test_a_wall_that_is_seen_through_noise_lies_where_it_is():
    walls = np.array([(2.0, -20.0, 2.0, 20.0)], float)
    places = {}
    for behind_share in (0.0, 0.025):
        generator = np.random.default_rng(0)
        submap = Submap(SubmapSettings(resolution=0.035, behind_share=behind_share, behind_m=0.1), 12.0)
        for y in np.linspace(-0.5, 0.5, 30):
            pose = np.array([0.0, y, 0.0])
            submap.insert(
                pose,
                cast(walls, pose) + generator.normal(0.0, 0.04, GEOMETRY.beams).astype(np.float32),
                GEOMETRY,
                20.0,
            )
        grid = submap.finished()
        agreement = np.maximum(grid.levels[-grid.row - 20 : -grid.row + 20].astype(float) - FREE_LEVEL, 0.0).sum(axis=0)
        centres = (np.arange(len(agreement)) + grid.column + 0.5) * grid.resolution
        places[behind_share] = np.average(centres, weights=agreement)
    assert places[0.0] > 2.015
    assert places[0.025] == pytest.approx(2.0, abs=0.005)


ONE_BEAM = ScanGeometry(beams=1, field_of_view=0.1, range_min=0.02, range_max=5.6)


def inserted(ranges, geometry, pose=(0.0, 0.0, 0.0), times=1):
    """Levels of a local map after the same scan so many times, and the cell of the laser."""
    submap = Submap(SubmapSettings(resolution=0.1, behind_share=0.0), 6.0)
    for _ in range(times):
        assert submap.insert(np.array(pose, float), np.asarray(ranges, np.float32), geometry, 20.0)
    return submap.grid.levels, -submap.grid.row


def shared(share):
    return int(1.5 + 254.0 * np.float32(share))


@pytest.mark.parametrize("times", [1, 3])
def test_the_end_of_a_beam_is_shared_out_among_the_four_cells_around_it(times):
    # It ends at (1.03, 0.08) m: between the centres of columns 9 and 10, and of rows 0 and 1.
    levels, zero = inserted([1.03], ONE_BEAM, (0.0, 0.08, 0.0), times)
    corner = levels[zero : zero + 2, zero + 9 : zero + 11]
    expected = [[shared(0.2 * 0.7), shared(0.8 * 0.7)], [shared(0.2 * 0.3), shared(0.8 * 0.3)]]
    np.testing.assert_allclose(corner, expected, atol=1)


def test_ends_on_one_surface_are_joined_and_others_are_not():
    pair = ScanGeometry(beams=2, field_of_view=0.4, range_min=0.02, range_max=5.6)
    levels, zero = inserted([2.0, 2.0], pair)
    ends = 2.0 * np.cos(0.2), 2.0 * np.sin(0.2)
    between = levels[zero - 3 : zero + 3, zero + int(ends[0] / 0.1) - 1 : zero + int(ends[0] / 0.1) + 2]
    assert (between.max(axis=1) > 100).all()
    apart, _ = inserted([2.0, 4.0], pair)
    assert (apart > 1).sum() <= 8


def test_a_beam_without_return_frees_its_way_and_an_invalid_one_says_nothing():
    levels, zero = inserted([np.inf], ONE_BEAM)
    assert (levels <= FREE_LEVEL).all()
    assert not inserted([np.nan], ONE_BEAM)[0][:, zero + 5 :].any()

"""Local maps keep what some neighbouring scans agree on."""

import numpy as np
import pytest
from driven_rooms import GEOMETRY
from mapped_room import SUBMAPS, odd_room_submap

from lidarium.mapping.localization.matching.submaps import FREE_LEVEL, UNSEEN, Submap


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
    assert not submap.insert(
        np.array([40.0, 0.0, 0.0]), np.full(GEOMETRY.beams, 2.0, np.float32), GEOMETRY, 20.0
    )
    assert submap.scans == 0
    assert not submap.grid.levels.any()
    assert submap.finished().levels.shape == (1, 1)

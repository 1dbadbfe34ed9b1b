"""The plane of a floor."""

import numpy as np
import pytest

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.rigid_motions import checked_poses, moved_points


@pytest.mark.parametrize("plane", [FloorPlane(0.6, 0.0, 0.8, 1.5), FloorPlane(0.0, -1.0, 0.0, 2.0)])
def test_levelling_makes_the_floor_level(plane):
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 3))
    np.testing.assert_allclose(
        moved_points(points, plane.levelling())[:, 2], plane.heights(points), atol=1e-12
    )
    checked_poses(plane.levelling())
    checked_poses(FloorPlane(0.0, 0.0, -1.0, 0.0).levelling())


def test_a_floor_has_a_unit_normal():
    with pytest.raises(ValueError, match="unit normal"):
        FloorPlane(0.0, 0.0, 2.0, 0.0)

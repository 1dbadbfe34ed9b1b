"""Rigid motions: inverses, and what is none."""

import numpy as np
import pytest
from furnished_room import pose_at

from lidarium.mapping.geometry.rigid_motions import checked_poses, inverse_of, moved_boxes, moved_points


def test_motions_are_undone_by_their_inverse():
    motions = np.stack([pose_at(1.0, 2.0, 3.0, 0.4, 0.2), pose_at(-1.0, 0.5, 0.0, 2.0)])
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_allclose(moved_points(moved_points(points, motions), inverse_of(motions)), points)
    around = moved_boxes(np.stack([points, points + 1.0], axis=1), motions)
    assert (around[:, 1] - around[:, 0] >= 1.0).all()


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.eye(3), "shape"),
        (2.0 * np.eye(4), "rigid motion"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "rigid motion"),
        (np.full((4, 4), np.nan), "rigid motion"),
        (np.eye(4) + np.eye(4)[[3, 1, 2, 0]] * [[0], [0], [0], [1]], "last row"),
    ],
)
def test_what_is_no_pose_is_refused(pose, message):
    with pytest.raises(ValueError, match=message):
        checked_poses(pose)

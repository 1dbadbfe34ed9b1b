"""Boxes of a sparse map in the plane and in space."""

import cv2
import numpy as np
import pytest

from lidarium.evaluation.drawing.sparse_picture import (
    MARGIN_M,
    _extent,
    _ribbon,
    faces_of_boxes,
    save_sparse_pictures,
)

BOXES = np.array([[(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)], [(5.0, 5.0, 0.0), (6.0, 5.5, 1.0)]])
FREE = np.array([(2.0, 2.0, 0.1), (3.0, 3.0, 0.1)])


def test_faces_of_a_box_are_its_six_sides_seen_from_outside():
    faces = faces_of_boxes(BOXES)
    assert faces.shape == (12, 4, 3)
    for box, six in zip(BOXES, faces.reshape(2, 6, 4, 3), strict=True):
        normals = 0.5 * np.cross(six[:, 2] - six[:, 0], six[:, 3] - six[:, 1])
        width, depth, height = box[1] - box[0]
        areas = sorted(np.linalg.norm(normals, axis=1))
        assert areas == pytest.approx(sorted(2 * [width * depth, width * height, depth * height]))
        outwards = six.mean(axis=1) - box.mean(axis=0)
        assert (np.einsum("ij,ij->i", normals, outwards) > 0.0).all()


def test_what_lies_far_off_does_not_shrink_a_picture():
    free = np.random.default_rng(0).uniform(0.0, 10.0, (2000, 3))
    low, high = _extent(BOXES[:0], np.concatenate([free, [(900.0, -900.0, 0.0)]]))
    assert (low > -MARGIN_M - 0.1).all()
    assert (high < 10.0 + MARGIN_M + 0.1).all()


def test_a_path_is_followed_closely_just_above_the_floor():
    middles = _ribbon(np.array([(0.0, 0.0, 9.0), (1.0, 0.0, 9.0), (1.0, 1.0, 9.0)]), 0.5).mean(axis=1)
    assert np.linalg.norm(np.diff(middles, axis=0), axis=1).max() < 0.041
    assert middles[0] == pytest.approx((0.0, 0.0, 0.52))
    assert middles[-1] == pytest.approx((1.0, 1.0, 0.52))


@pytest.mark.parametrize("boxes", [BOXES, BOXES[:0]])
def test_a_map_has_two_pictures_beside_it(tmp_path, boxes):
    way = np.array([(0.0, 0.0, 0.0), (3.0, 3.0, 0.0)])
    names = save_sparse_pictures(tmp_path / "a.smap", boxes, FREE, way=way)
    assert names == [str(tmp_path / "a.png"), str(tmp_path / "a_3d.png")]
    red, green, _ = np.moveaxis(cv2.imread(names[1])[..., ::-1].astype(int), 2, 0)
    assert (red > 3 * green + 20).any()
    assert cv2.imread(names[0]) is not None


def test_a_map_of_nothing_has_pictures(tmp_path):
    assert len(save_sparse_pictures(tmp_path / "a.smap", BOXES[:0], FREE[:0])) == 2

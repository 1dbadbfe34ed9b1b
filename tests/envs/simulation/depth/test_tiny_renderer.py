"""Depth images agree with those of PyBullet's software renderer."""

import numpy as np
import pytest

from lidarium.benchmarks.speed.peers.bullet import BulletImages
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.faces import faces_of
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.depth.face_drawing import CENTRE_COLUMN, CENTRE_ROW, FaceArrays
from lidarium.envs.simulation.depth.frames import draw_view, place_camera, view_numbers

pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install lidarium[bullet]")

OFFSET = 0.5
"""By how much its samples lie to the left of the centres of pixels, and below them [pixels]."""


def image_at_corners(floor, pose, camera):
    """Our depths where its samples are."""
    view = view_numbers(camera)
    view[CENTRE_COLUMN] += OFFSET
    view[CENTRE_ROW] -= OFFSET
    axes, eye = np.empty((3, 3)), np.empty(3)
    place_camera(np.array(pose), np.zeros(3), camera.mount, axes, eye)
    faces, inverse = faces_of(floor), np.empty((camera.rows, camera.columns), np.float32)
    draw_view(FaceArrays(faces.corners, faces.planes, faces.spheres), axes, eye, view, inverse)
    return 1.0 / inverse


def test_images_agree_after_the_offset_of_its_samples():
    floor, camera = load_floor("apartment"), DepthCamera(columns=160, rows=120, depth_min=0.1, depth_max=8.0)
    bullet = BulletImages(floor, camera)
    gaps = []
    for pose in ((2.5, 4.0, 0.0), (9.6, 3.1, 2.3), (8.4, 6.3, -1.5), (6.8, 4.5, 3.1)):
        ours, theirs = image_at_corners(floor, pose, camera), bullet.image(np.array(pose))
        gaps.append(np.abs(ours - theirs)[ours < 7.9])
    bullet.close()
    gaps = np.concatenate(gaps)
    assert np.median(gaps) < 1e-5
    assert (gaps < 1e-3).mean() > 0.999

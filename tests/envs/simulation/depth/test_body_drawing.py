"""Bodies of robots are upright cylinders, as a walk along the rays of all pixels shows them."""

import math

import numpy as np
import pytest

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.depth.body_drawing import draw_body
from lidarium.envs.simulation.depth.frames import place_camera, view_numbers

CAMERA = DepthCamera(columns=24, rows=18, depth_max=4.0, pitch=0.25)
STEP = 2e-3


def placed(camera, x=0.0, y=0.0, heading=0.0):
    axes, eye = np.empty((3, 3)), np.empty(3)
    place_camera(np.array([x, y, heading]), np.zeros(3), camera.mount, axes, eye)
    return axes, eye


def drawn(centre, radius, height, camera=CAMERA, background=0.0, pose=(0.0, 0.0, 0.0)):
    axes, eye = placed(camera, *pose)
    inverse = np.full((camera.rows, camera.columns), background, np.float32)
    draw_body(np.array(centre), radius, height, axes, eye, view_numbers(camera), inverse)
    return inverse


def depths_by_steps(centre, radius, height, camera=CAMERA):
    """Depth at which each pixel's ray is first within the cylinder, inf where it never is."""
    (axes, eye), pinhole = placed(camera), camera.intrinsics
    v, u = np.mgrid[: camera.rows, : camera.columns]
    rays = np.stack([(u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy, np.ones(u.shape)], -1)
    depths = np.arange(STEP, 6.0, STEP)
    points = eye + depths[:, None, None, None] * (rays @ axes)
    inside = np.hypot(points[..., 0] - centre[0], points[..., 1] - centre[1]) <= radius
    inside &= (points[..., 2] >= centre[2]) & (points[..., 2] <= centre[2] + height)
    return np.where(inside.any(axis=0), depths[inside.argmax(axis=0)], np.inf)


@pytest.mark.parametrize(
    ("centre", "radius", "height"),
    [
        ((1.5, 0.1, 0.0), 0.2, 0.3),
        ((0.7, -0.2, 0.0), 0.25, 0.6),
        ((2.5, 0.8, 0.1), 0.4, 0.2),
        # Beside the camera, so that a part is behind it.
        ((0.2, 0.45, 0.0), 0.4, 0.52),
    ],
)
def test_a_body_has_the_depths_of_a_walk_along_the_rays(centre, radius, height):
    inverse, depths = drawn(centre, radius, height), depths_by_steps(centre, radius, height)
    is_drawn, is_met = inverse > 0.0, np.isfinite(depths)
    assert is_met.any()
    # Rays that graze an edge may be missed between two steps.
    assert (is_drawn != is_met).sum() <= 3
    both = is_drawn & is_met
    assert np.median(np.abs(1.0 / inverse[both] - depths[both])) < STEP
    assert (np.abs(1.0 / inverse[both] - depths[both]) < 2.0 * STEP).mean() > 0.9


def test_the_middle_of_a_body_is_its_radius_nearer_than_its_axis():
    level = DepthCamera(columns=25, rows=19, depth_max=4.0)
    inverse = drawn((2.0, 0.0, 0.0), 0.3, 1.0, level)
    assert inverse[9, 12] == pytest.approx(1.0 / 1.7)
    assert inverse.max() == inverse[9, 12]
    turned = drawn((0.0, 2.0, 0.0), 0.3, 1.0, level, pose=(0.0, 0.0, math.pi / 2))
    assert turned == pytest.approx(inverse, abs=1e-6)


def test_what_is_nearer_stays():
    level = DepthCamera(columns=25, rows=19, depth_max=4.0)
    nearer = drawn((2.0, 0.0, 0.0), 0.3, 1.0, level, background=0.8)
    assert (nearer == np.float32(0.8)).all()
    behind = drawn((2.0, 0.0, 0.0), 0.3, 1.0, level, background=0.3)
    assert behind[9, 12] == pytest.approx(1.0 / 1.7)
    assert behind[9, 0] == np.float32(0.3)


@pytest.mark.parametrize("centre", [(-1.5, 0.0, 0.0), (9.0, 0.0, 0.0), (1.0, 3.0, 0.0), (0.0, 0.0, 0.0)])
def test_bodies_behind_beyond_and_around_the_camera_are_not_seen(centre):
    assert not drawn(centre, 0.3, 1.0).any()


@pytest.mark.parametrize("heading", np.arange(0.0, 2.0 * math.pi, 0.2))
def test_a_body_beside_or_behind_the_camera_is_drawn_where_rays_meet_it(heading):
    near = (0.3 * math.cos(heading), 0.3 * math.sin(heading), 0.0)
    inverse, depths = drawn(near, 0.2, 0.6), depths_by_steps(near, 0.2, 0.6)
    assert ((inverse > 0.0) != np.isfinite(depths)).sum() <= 3

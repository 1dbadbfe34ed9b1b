"""Faces cover the pixels whose rays meet them, at the depths of their planes."""

import numpy as np
import pytest

from lidarium.envs.floors.faces import Faces
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.depth.face_drawing import (
    FaceArrays,
    cover,
    draw_faces,
    inverse_plane,
    is_in_view,
    new_span,
    view_sides,
)
from lidarium.envs.simulation.depth.frames import place_camera, view_numbers
from lidarium.mapping.kernels.simd.faces import PIXELS

CAMERA = DepthCamera(columns=37, rows=29, depth_max=8.0, field_of_view=1.0)
VIEW = view_numbers(CAMERA)


def placed(x=0.0, y=0.0, heading=0.0):
    axes, eye = np.empty((3, 3)), np.empty(3)
    place_camera(np.array([x, y, heading]), np.zeros(3), CAMERA.mount, axes, eye)
    return axes, eye


AXES, EYE = placed()


def rays():
    """Directions of the pixels' rays in the world, of depth 1."""
    pinhole = CAMERA.intrinsics
    v, u = np.mgrid[: CAMERA.rows, : CAMERA.columns]
    optical = np.stack([(u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy, np.ones(u.shape)], -1)
    return optical @ AXES


def faces_of(*corners):
    made = Faces.of_corners(np.array(corners, float), np.zeros(len(corners), np.int32))
    return FaceArrays(made.corners, made.planes, made.spheres)


def drawn_faces(generator, count=1):
    """Parallelograms that look at the camera, some of them partly behind it."""
    faces = []
    while len(faces) < count:
        corner, a, b = generator.uniform((-1, -3, -1), (6, 3, 2)), *generator.uniform(-2.5, 2.5, (2, 3))
        corners = np.array([corner, corner + a, corner + a + b, corner + b])
        facing = np.cross(a, b) @ (EYE - corner)
        if abs(facing) > 0.3:
            faces.append(corners if facing > 0.0 else corners[::-1])
    return faces


def inverse_by_rays(corners):
    """Inverse depths of a parallelogram by its plane and its two sides, 0 where it is not met."""
    a, b = corners[1] - corners[0], corners[3] - corners[0]
    matrix = np.stack(np.broadcast_arrays(-rays(), a, b), axis=-1)
    depth, along, across = np.moveaxis(np.linalg.solve(matrix, (EYE - corners[0])[..., None])[..., 0], -1, 0)
    met = (depth > 0.0) & (along >= 0.0) & (along <= 1.0) & (across >= 0.0) & (across <= 1.0)
    return np.where(met, 1.0 / depth, 0.0)


def covered(corners):
    span = new_span(CAMERA.rows)
    first, last = cover(np.asarray(corners, float), AXES, EYE, VIEW, span)
    pixels = np.zeros((CAMERA.rows, CAMERA.columns), np.bool_)
    for row in range(first, last + 1):
        pixels[row, max(span.columns[0, row], 0) : max(span.columns[1, row] + 1, 0)] = True
    return pixels


def blank(depth=CAMERA.depth_max):
    width = -(-CAMERA.columns // PIXELS) * PIXELS
    return np.full((CAMERA.rows, width), 1.0 / depth, np.float32)


def draw(faces, inverse):
    draw_faces(faces, AXES, EYE, VIEW, new_span(CAMERA.rows), inverse)
    return inverse[:, : CAMERA.columns]


@pytest.mark.parametrize("seed", range(5))
def test_a_face_covers_the_pixels_whose_rays_meet_it(seed):
    total = 0
    for corners in drawn_faces(np.random.default_rng(seed), 20):
        expected = inverse_by_rays(corners)
        if (expected > 1.0 / CAMERA.depth_max).any():
            assert np.array_equal(covered(corners), expected > 0.0)
            total += int((expected > 0.0).sum())
    assert total > 500


@pytest.mark.parametrize("seed", range(5))
def test_the_nearest_face_of_each_pixel_is_drawn(seed):
    corners = drawn_faces(np.random.default_rng(10 + seed), 12)
    expected = np.maximum.reduce([inverse_by_rays(each) for each in corners])
    inverse = draw(faces_of(*corners), blank())
    assert inverse == pytest.approx(np.maximum(expected, 1.0 / CAMERA.depth_max), rel=1e-4)
    assert (inverse > 1.01 / CAMERA.depth_max).mean() > 0.3


def test_the_inverse_depth_of_a_plane_is_linear_over_the_image():
    corners = drawn_faces(np.random.default_rng(3))[0]
    faces = faces_of(corners)
    start, along, across = inverse_plane(faces.planes[0], AXES, EYE, VIEW)
    normal, offset = faces.planes[0, :3], faces.planes[0, 3]
    v, u = np.mgrid[: CAMERA.rows, : CAMERA.columns]
    wanted = (rays() @ normal) / (offset - EYE @ normal)
    assert start + along * u + across * v == pytest.approx(wanted)


# 3 m ahead, counter-clockwise as seen from the camera.
WALL = np.array([[3.0, -1.0, 0.0], [3.0, -1.0, 1.0], [3.0, 1.0, 1.0], [3.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("moved", "order", "is_seen"),
    [
        ((0.0, 0.0, 0.0), 1, True),
        ((0.0, 0.0, 0.0), -1, False),
        ((-6.0, 0.0, 0.0), 1, False),
        ((6.5, 0.0, 0.0), 1, False),
        ((0.0, 7.0, 0.0), 1, False),
        ((0.0, 0.0, 5.0), 1, False),
        ((0.0, 2.2, 0.0), 1, True),
    ],
)
def test_only_faces_that_look_at_the_camera_and_are_in_view_are_drawn(moved, order, is_seen):
    corners = WALL[::order] + np.array(moved)
    seen, sides = faces_of(corners), np.empty((4, 3))
    view_sides(AXES, VIEW, sides)
    assert is_in_view(seen, 0, AXES, EYE, VIEW, sides) == is_seen
    is_drawn = bool((draw(seen, blank()) > 1.0 / CAMERA.depth_max).any())
    assert is_drawn == is_seen


def test_the_sides_of_a_view_are_unit_normals_that_point_inwards():
    for pose in ((0.0, 0.0, 0.0), (1.0, 2.0, 2.2)):
        axes, _ = placed(*pose)
        sides = np.empty((4, 3))
        view_sides(axes, VIEW, sides)
        assert np.linalg.norm(sides, axis=1) == pytest.approx(1.0)
        pinhole = CAMERA.intrinsics
        # The image ends half a pixel beyond the centres of its outer pixels.
        left, right = ((column - pinhole.cx) / pinhole.fx for column in (-0.5, CAMERA.columns - 0.5))
        top, bottom = ((row - pinhole.cy) / pinhole.fy for row in (-0.5, CAMERA.rows - 0.5))
        edges = np.array([[left, 0, 1], [right, 0, 1], [0, top, 1], [0, bottom, 1]]) @ axes
        products = edges @ sides.T
        assert np.diag(products) == pytest.approx(0.0, abs=1e-12)
        assert (products > -1e-12).all()

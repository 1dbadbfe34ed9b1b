"""Faces of floors are closed, convex, and look outwards."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.envs.floors.faces import CEILING, GROUND, SURROUNDINGS, convex_parts, faces_of
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.raster import Raster

SQUARE = np.array([(1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0)])
BENT = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)])
STAR = np.array(
    [
        (2 + (2 if k % 2 else 0.7) * np.cos(k * np.pi / 5), 2 + (2 if k % 2 else 0.7) * np.sin(k * np.pi / 5))
        for k in range(10)
    ]
)


def area_of(ring):
    x, y = ring.T
    return 0.5 * (np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def faces_of_solid(solid):
    faces = faces_of(Floor("room", (-1.0, -1.0, 6.0, 6.0), (solid,)))
    return [np.flatnonzero(faces.owners == 0), faces]


def areas_of(corners):
    return np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1) / 2.0


@pytest.mark.parametrize("ring", [SQUARE, SQUARE[::-1], BENT, BENT[::-1], STAR])
@pytest.mark.parametrize("has_hole", [False, True])
def test_faces_of_a_solid_enclose_its_volume(ring, has_hole):
    hole = np.array([(0.2, 0.2), (0.6, 0.3), (0.4, 0.7)]) + (1.5 * (ring is not BENT and ring[0, 0] != 0.0))
    solid = Solid(ring, 0.5, 1.7, (hole,) if has_hole else ())
    ours, faces = faces_of_solid(solid)
    volume = (areas_of(faces.corners[ours]) * faces.planes[ours, 3]).sum() / 3.0
    expected = (abs(area_of(ring)) - has_hole * abs(area_of(hole))) * 1.2
    assert volume == pytest.approx(expected)
    # The faces of a closed body point in all directions alike.
    assert np.abs((areas_of(faces.corners[ours])[:, None] * faces.planes[ours, :3]).sum(axis=0)).max() < 1e-9


@given(st.lists(st.tuples(st.floats(0.3, 2.0), st.floats(0.2, 1.0)), min_size=3, max_size=12))
def test_parts_of_any_outline_are_convex_and_cover_it(steps):
    angles = np.cumsum([step for _, step in steps])
    angles *= 2.0 * np.pi / (angles[-1] + 0.3)
    ring = np.round(np.array([(r * np.cos(a), r * np.sin(a)) for (r, _), a in zip(steps, angles, strict=True)]), 3)
    parts = convex_parts(Solid(ring))
    assert sum(area_of(part) for part in parts) == pytest.approx(abs(area_of(ring)), abs=1e-6)
    for part in parts:
        edges = np.roll(part, -1, axis=0) - part
        after = np.roll(edges, -1, axis=0)
        assert (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] >= -1e-9).all()


@pytest.mark.parametrize("seed", range(20))
def test_pieces_are_convex_and_cover_what_the_outline_does(seed):
    generator = np.random.default_rng(seed)
    angles = np.sort(generator.uniform(0.0, math.tau, 9))
    ring = generator.uniform(0.5, 2.0, 9)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    hole = 0.05 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) + 0.0
    holes = (hole,) if seed % 2 else ()
    pieces = convex_parts(Solid(ring, holes=holes))
    for _ in range(200):
        point = generator.uniform(-2.0, 2.0, 2)

        def holds(outline, point=point):
            return cv2.pointPolygonTest((outline * 1e3).astype(np.float32), tuple(point * 1e3), False) > 0

        inside = holds(ring) and not any(map(holds, holes))
        near = abs(cv2.pointPolygonTest((ring * 1e3).astype(np.float32), tuple(point * 1e3), True)) < 1.0
        if not near:
            assert sum(map(holds, pieces)) <= 1
            assert any(map(holds, pieces)) == inside or any(
                abs(cv2.pointPolygonTest((piece * 1e3).astype(np.float32), tuple(point * 1e3), True)) < 1.0
                for piece in pieces
            )
    assert sum(map(area_of, pieces)) == pytest.approx(_area_without(ring, holes), rel=1e-6)


def _area_without(ring, holes):
    # A star around the origin: its outline does not cross itself.
    return abs(area_of(ring)) - sum(abs(area_of(hole)) for hole in holes)


def test_what_nobody_sees_has_no_face():
    ours, faces = faces_of_solid(Solid(SQUARE, 0.0, 1.0))
    assert len(ours) == 5  # no underside on the ground
    ours, faces = faces_of_solid(Solid(SQUARE))
    assert len(ours) == 4  # nor a top at the ceiling
    assert faces.corners[ours, :, 2].max() == 2.5
    ours, _ = faces_of_solid(Solid(SQUARE, 3.0, 4.0))
    assert len(ours) == 0


def test_a_room_has_ground_ceiling_and_surroundings_that_look_inwards():
    faces = faces_of(Floor("room", (0.0, 0.0, 4.0, 3.0), ceiling=3.0))
    assert faces.owners.tolist() == [GROUND, CEILING] + [SURROUNDINGS] * 4
    middle = np.array([2.0, 1.5, 1.0])
    assert (faces.planes[:, :3] @ middle > faces.planes[:, 3]).all()
    assert faces.corners[1, :, 2].tolist() == [3.0] * 4


def test_walls_of_an_image_stand_between_free_and_solid_cells():
    solid = np.ones((6, 8), np.uint8)
    solid[1:5, 1:7] = 0
    solid[2:4, 3] = 1
    floor = Floor("image", (0.0, 0.0, 0.8, 0.6), cells=Raster(solid, (0.0, 0.0), 0.1))
    faces = faces_of(floor)
    walls = faces.corners[6:]
    lengths = np.linalg.norm(walls[:, 1, :2] - walls[:, 0, :2], axis=1)
    assert len(walls) == 8
    assert lengths.sum() == pytest.approx(2 * (0.4 + 0.6) + 2 * (0.2 + 0.1))
    # Half a cell in front of each wall is free, half a cell behind it solid.
    middles = walls.mean(axis=1)[:, :2]
    for sign, value in ((0.05, 0), (-0.05, 1)):
        column, row = np.floor((middles + sign * faces.planes[6:, :2]) / 0.1).astype(int).T
        assert (solid[row, column] == value).all()


def test_a_ceiling_that_is_no_height_is_refused():
    with pytest.raises(ValueError, match=r"ceiling at -1\.0 m"):
        Floor("room", (0.0, 0.0, 4.0, 3.0), ceiling=-1.0)

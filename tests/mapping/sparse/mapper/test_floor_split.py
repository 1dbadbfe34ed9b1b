"""Which points are floor, and which stand on it."""

import numpy as np
from furnished_room import room_points

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.mapper.floor_split import is_floor, surface_normals
from lidarium.mapping.sparse.settings import MapperSettings

ROOM = room_points(0.05)


def test_a_table_top_is_no_floor_by_its_normal():
    normals = surface_normals(ROOM)
    assert normals.shape == ROOM.shape
    for split in ("height", "normal", "both"):
        on_floor = is_floor(ROOM, FloorPlane(), MapperSettings(split=split))
        assert not on_floor[(ROOM[:, 2] > 0.6) & (ROOM[:, 2] < 0.8)].any()
        inside = ((ROOM[:, :2] > 0.3) & (ROOM[:, :2] < 1.2)).all(axis=1) & (ROOM[:, 2] == 0.0)
        assert on_floor[inside].all()


def test_a_ramp_is_floor_by_its_normal_alone():
    x, y = np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 1.0, 0.05))
    ramp = np.column_stack([x.ravel(), y.ravel(), np.maximum(x.ravel() - 2.0, 0.0) * 0.2])
    by_height = is_floor(ramp, FloorPlane(), MapperSettings(split="height"))
    by_normal = is_floor(ramp, FloorPlane(), MapperSettings(split="normal"))
    assert by_height.mean() < 0.7
    assert by_normal.mean() > 0.95

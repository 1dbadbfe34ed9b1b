"""A furnished room, as a cloud and as a map."""

import numpy as np
import pytest
from furnished_room import room_points

from lidarium.mapping.point_clouds.ply_files import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.scripts.main import main


@pytest.fixture(scope="session")
def room(tmp_path_factory):
    """A cloud of a furnished room, and its map."""
    folder = tmp_path_factory.mktemp("room")
    write_ply(folder / "room.ply", PointCloud(room_points(0.03).astype(np.float32)))
    assert main(["sparse-map", str(folder / "room.ply"), "--out", str(folder / "maps" / "room.smap")]) == 0
    return folder

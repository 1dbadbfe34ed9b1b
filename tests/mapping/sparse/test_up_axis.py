import numpy as np
import pytest

from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.mapping.sparse.up_axis import check_up


def room():
    """Floor of 6 x 4 m, and two walls of 1.5 m; z up."""
    x, y = np.meshgrid(np.arange(0.0, 6.0, 0.05), np.arange(0.0, 4.0, 0.05))
    floor = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    u, h = np.meshgrid(np.arange(0.0, 6.0, 0.05), np.arange(0.0, 1.5, 0.05))
    back = np.stack([u, 0.0 * u, h], axis=-1).reshape(-1, 3)
    side = back[:, [1, 0, 2]][back[:, 0] < 4.0]
    return np.concatenate([floor, back, side])


def test_the_floor_of_a_room_is_told():
    found = check_up(room(), (0.0, 0.0, 1.0))
    assert found.doubt == ""
    assert found.area_m2 == pytest.approx(24.0, rel=0.15)
    assert found.plane.normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    # From above another floor may be far below the origin.
    assert check_up(room() + np.array([0.0, 0.0, 35.0]), (0.0, 0.0, 1.0)).doubt == ""


def test_another_axis_is_named_if_its_surface_is_larger():
    turned = room()[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert "--levels --up 0,1,0?" in check_up(turned, (0.0, 0.0, 1.0)).doubt
    assert check_up(turned, (0.0, 1.0, 0.0)).doubt == ""


def test_a_cloud_in_a_cameras_frame_is_named():
    # The camera stands 1 m high at the end of the room and looks along it.
    seen = room() - np.array([-1.0, 2.0, 1.0])
    optical = np.stack([-seen[:, 1], -seen[:, 2], seen[:, 0]], axis=1)
    optical = optical[np.abs(optical[:, :2]).max(axis=1) < 0.6 * optical[:, 2]]
    assert "in a camera's frame" in check_up(optical, (0.0, 0.0, 1.0)).doubt
    assert check_up(optical, (0.0, -1.0, 0.0)).doubt == ""


def test_real_clouds_of_other_axes_are_named(shared_cases, shared_data):
    y_up = read_cloud(shared_cases / "cloud-up-axis" / "y_up.obj").points
    assert "--up 0,1,0?" in check_up(y_up, (0.0, 0.0, 1.0)).doubt
    assert check_up(y_up, (0.0, 1.0, 0.0)).doubt == ""
    folder = shared_data / "clouds" / "pcl"
    for name in ("segmentation__mOSD__learn__learn0", "tutorials__pairwise__capture0001"):
        assert "--up 0,-1,0?" in check_up(read_cloud(folder / f"{name}.pcd").points, (0.0, 0.0, 1.0)).doubt
    for name in ("tutorials__room_scan1", "tutorials__room_scan2"):
        assert check_up(read_cloud(folder / f"{name}.pcd").points, (0.0, 0.0, 1.0)).doubt == ""

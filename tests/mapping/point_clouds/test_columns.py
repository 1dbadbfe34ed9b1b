"""Columns of a file that are points, normals and weights."""

import numpy as np
import pytest

from lidarium.mapping.point_clouds.columns import cloud_of_columns, text_columns, wanted_columns


def test_points_come_first_then_whole_normals_and_weights():
    assert wanted_columns(["weight", "z", "rgb", "y", "x"]) == ["x", "y", "z", "weight"]
    assert wanted_columns(["x", "y", "z", "nx", "ny", "nz"]) == ["x", "y", "z", "nx", "ny", "nz"]
    # Two of three are no normal.
    assert wanted_columns(["x", "y", "z", "nx", "ny"]) == ["x", "y", "z"]


def test_what_is_missing_is_named():
    with pytest.raises(ValueError, match="it has no field y, z, but x, intensity"):
        wanted_columns(["x", "intensity"])
    with pytest.raises(ValueError, match="but none"):
        wanted_columns([])


def test_columns_become_a_cloud():
    columns = {name: np.array([k, k + 10.0]) for k, name in enumerate(("x", "y", "z", "nx", "ny", "nz"))}
    columns["nx"][:], columns["ny"][:], columns["nz"][:] = 0.0, 0.0, 1.0
    cloud = cloud_of_columns({**columns, "weight": np.array([2, 3])}, "a.ply")
    np.testing.assert_array_equal(cloud.points, [[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]])
    np.testing.assert_array_equal(cloud.normals, [[0.0, 0.0, 1.0]] * 2)
    np.testing.assert_array_equal(cloud.weights, [2.0, 3.0])
    assert cloud.points.dtype == np.float32


def test_lines_of_numbers_are_read_by_their_places():
    content = b"# remark\n1 2 3\n\n4 5 6 \n  # another\n7 8 9\n"
    np.testing.assert_array_equal(text_columns(content, (2, 0)), [[3, 1], [6, 4], [9, 7]])
    np.testing.assert_array_equal(text_columns(content, (0,), 2), [[1], [4]])


@pytest.mark.parametrize(
    ("content", "rows", "message"),
    [
        (b"# none\n", None, "holds no points"),
        (b"1 2\n", 5, "claims 5 points and holds 1 lines"),
        (b"1 a\n", None, "a"),
    ],
)
def test_lines_that_are_no_such_numbers_are_refused(content, rows, message):
    with pytest.raises(ValueError, match=message):
        text_columns(content, (0, 1), rows)

"""Clouds as text."""

import numpy as np
import pytest

from lidarium.mapping.point_clouds.text_clouds import parse_obj, parse_xyz


def test_vertices_of_an_obj_are_points_and_all_else_is_passed_over():
    content = b"# v 9 9 9\nv 1 2 3\nvn 0 0 1\n\tv\t4 5 6 1.0\nf 1 2 3\nvt 0 0\n"
    np.testing.assert_array_equal(parse_obj(content, "a.obj").points, [[1, 2, 3], [4, 5, 6]])


def test_lines_of_an_xyz_are_points_whatever_follows():
    cloud = parse_xyz(b"1 2 3 255 0 0\n-4.5 5 6e1 1 1 1\n", "a.xyz")
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [-4.5, 5, 60]])


@pytest.mark.parametrize(
    ("parse", "content", "message"),
    [
        (parse_obj, b"f 1 2 3\n", "holds no points"),
        (parse_obj, b"v 1 2\n", "column"),
        (parse_xyz, b"1 2\n", "column"),
        (parse_xyz, b"", "holds no points"),
    ],
)
def test_what_holds_no_points_is_refused(parse, content, message):
    with pytest.raises(ValueError, match=message):
        parse(content, "a")

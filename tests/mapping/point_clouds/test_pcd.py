"""PCD files."""

import numpy as np
from cloud_files import POINTS, packed_body, pcd

from lidarium.mapping.point_clouds.reading import read_cloud


def test_fields_of_a_pcd_may_be_in_any_order_of_any_type_with_padding_between(tmp_path):
    row = np.dtype(
        [("a", "u1", (3,)), ("z", "<f8"), ("l", "<u2"), ("x", "<f4"), ("b", "u1", (2,)), ("y", "<i2")]
    )
    rows = np.zeros(2, row)
    rows["x"], rows["y"], rows["z"] = [0.5, 1.5], [-3, 7], [2.25, 4.5]
    kinds = {
        "fields": "_ z label x _ y",
        "size": "1 8 2 4 1 2",
        "kind": "U F U F U I",
        "count": "3 1 1 1 2 1",
    }
    wanted = [[0.5, -3.0, 2.25], [1.5, 7.0, 4.5]]
    fields = b"".join(rows[name].tobytes() for name in row.names)
    texts = [f"0 0 0 {z} 9 {x} 0 0 {y}\n" for x, y, z in wanted]
    bodies = {
        "ascii": "".join(texts).encode(),
        "binary": rows.tobytes(),
        "binary_compressed": packed_body(fields),
    }
    for form, body in bodies.items():
        (tmp_path / "a.pcd").write_bytes(pcd(form, points=2, body=body, **kinds))
        assert read_cloud(tmp_path / "a.pcd").points.tolist() == wanted


def test_points_that_a_pcd_has_as_nan_are_no_measurements(tmp_path):
    points = np.concatenate([POINTS, np.full((1, 3), np.nan, np.float32)])
    (tmp_path / "a.pcd").write_bytes(pcd("binary", points=4, body=points.tobytes()))
    assert len(read_cloud(tmp_path / "a.pcd")) == 3

"""PLY files."""

from cloud_files import POINTS, lines_of, ply

from lidarium.mapping.point_clouds.reading import read_cloud


def test_points_of_a_ply_may_come_after_other_elements(tmp_path):
    before = "element camera 2\nproperty short a\nproperty uchar b\n"
    (tmp_path / "a.ply").write_bytes(ply("binary_little_endian", bytes(6) + POINTS.tobytes(), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()
    (tmp_path / "a.ply").write_bytes(ply("ascii", b"1 2\n3 4\n" + lines_of(POINTS), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()

"""Columns of a file that are points, normals and weights."""

import struct
import sys
import zlib

import numpy as np
import pytest
from cloud_files import POINTS, lines_of, packed_body, pcd, ply
from scipy.spatial import cKDTree

from lidarium.mapping.point_clouds.cameras import Intrinsics
from lidarium.mapping.point_clouds.cloud_files import _parse_obj, _parse_xyz, read_cloud, write_pcd
from lidarium.mapping.point_clouds.columns import cloud_of_columns, text_columns, wanted_columns
from lidarium.mapping.point_clouds.ply_files import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud


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
    cloud = cloud_of_columns({**columns, "weight": np.array([2, 3])})
    np.testing.assert_array_equal(cloud.points, [[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]])
    np.testing.assert_array_equal(cloud.normals, [[0.0, 0.0, 1.0]] * 2)
    np.testing.assert_array_equal(cloud.weights, [2.0, 3.0])


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


def test_vertices_of_an_obj_are_points_and_all_else_is_passed_over():
    content = b"# v 9 9 9\nv 1 2 3\nvn 0 0 1\n\tv\t4 5 6 1.0\nl 1 2\nvt 0 0\n"
    np.testing.assert_array_equal(_parse_obj(content).points, [[1, 2, 3], [4, 5, 6]])


def test_lines_of_an_xyz_are_points_whatever_follows():
    cloud = _parse_xyz(b"1 2 3 255 0 0\n-4.5 5 6e1 1 1 1\n")
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [-4.5, 5, 60]])


@pytest.mark.parametrize(
    ("content", "remarks"),
    [
        (b"v 1 2 3\nv 4 5 \\\n6\nvp 0.1\nusemtl wood # of an oak\n", ()),
        (b"v 1 2 3\nv4 5 6\n7 8 9\nv 4 5 6\n", ("2 lines are no OBJ and passed over, the first is line 2: damaged?",)),
        (b"v 1 2 3 1 1 1\nv 4 5 6\n", ("1 of 2 vertices have not 3 numbers as most: damaged?",)),
        (b"v 1 2 3\nv 4 5 6\nf 1 2\n", ("1 faces have fewer than three corners and are passed over: damaged?",)),
    ],
)
def test_damaged_lines_of_an_obj_are_told(content, remarks):
    found = _parse_obj(content)
    np.testing.assert_array_equal(found.points, [[1, 2, 3], [4, 5, 6]])
    assert found.remarks == remarks


@pytest.mark.parametrize(
    ("parse", "content", "message"),
    [
        (
            _parse_xyz,
            b"1 2 3 255\n12 3 255\n1 2 3 255 # good\n1 2 3 25 5\n",
            r"2 of its 4 lines .* damaged\? The first is '12 3",
        ),
        (_parse_obj, b"v 1 2 3\nv 12 3\nv\n", "2 of its 3 vertices"),
    ],
)
def test_lines_of_other_lengths_are_refused_with_their_number(parse, content, message):
    with pytest.raises(ValueError, match=message):
        parse(content)


@pytest.mark.parametrize(
    ("parse", "content", "message"),
    [
        (_parse_obj, b"f 1 2 3\n", "holds no points"),
        (_parse_obj, b"v 1 2\n", "column"),
        (_parse_xyz, b"1 2\n", "column"),
        (_parse_xyz, b"", "holds no points"),
    ],
)
def test_what_holds_no_points_is_refused(parse, content, message):
    with pytest.raises(ValueError, match=message):
        parse(content)


def test_lzf_pieces_that_come_again_are_unpacked(tmp_path):
    points = np.zeros((100, 3), np.float32)
    # A zero as it is, then zeros from one byte back: 264, 264, and so on.
    left, packed = 1199, b"\x00\x00"
    while left > 264:
        packed, left = packed + bytes([0xE0, 255, 0]), left - 264
    packed += bytes([0xE0, left - 9, 0])
    body = struct.pack("<II", len(packed), 1200) + packed
    (tmp_path / "a.pcd").write_bytes(pcd("binary_compressed", points=100, body=body))
    assert (read_cloud(tmp_path / "a.pcd").points == points).all()


def test_packed_bytes_of_another_packer_are_refused(tmp_path):
    body = struct.pack("<II", 100, 36) + zlib.compress(POINTS.tobytes()).ljust(100, b"\0")
    (tmp_path / "a.pcd").write_bytes(pcd("binary_compressed", body=body))
    with pytest.raises(ValueError, match="damaged"):
        read_cloud(tmp_path / "a.pcd")


def test_fields_of_a_pcd_may_be_in_any_order_of_any_type_with_padding_between(tmp_path):
    row = np.dtype([("a", "u1", (3,)), ("z", "<f8"), ("l", "<u2"), ("x", "<f4"), ("b", "u1", (2,)), ("y", "<i2")])
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


def test_points_of_a_ply_may_come_after_other_elements(tmp_path):
    before = "element camera 2\nproperty short a\nproperty uchar b\n"
    (tmp_path / "a.ply").write_bytes(ply("binary_little_endian", bytes(6) + POINTS.tobytes(), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()
    (tmp_path / "a.ply").write_bytes(ply("ascii", b"1 2\n3 4\n" + lines_of(POINTS), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()


GOOD = {
    "ascii.pcd": pcd(body=lines_of(POINTS)),
    "binary.pcd": pcd("binary", body=POINTS.tobytes()),
    "packed.pcd": pcd("binary_compressed", body=packed_body(POINTS.T.tobytes())),
    "width.pcd": pcd(body=lines_of(POINTS)).replace(b"POINTS 3\n", b""),
    "ascii.ply": ply("ascii", lines_of(POINTS)),
    "little.ply": ply("binary_little_endian", POINTS.tobytes()),
    "big.ply": ply("binary_big_endian", POINTS.astype(">f4").tobytes()),
    "double.ply": ply("binary_big_endian", POINTS.astype(">f8").tobytes(), "double double double"),
    "a.obj": b"# by hand\no thing\n"
    + b"".join(b"v " + line + b"\n" for line in lines_of(POINTS).split(b"\n")[:-1])
    + b"vn 0 0 1\nl 1 2 3\n",
    "a.xyz": lines_of(POINTS),
    "commas.txt": b"// x, y, z\n" + lines_of(POINTS).replace(b" ", b", "),
    "colours.xyz": b"".join(line + b" 10 20 30\n" for line in lines_of(POINTS).split(b"\n")[:-1]),
}


@pytest.mark.parametrize("name", GOOD)
def test_every_kind_of_file_gives_the_same_points(name, tmp_path):
    (tmp_path / name).write_bytes(GOOD[name])
    cloud = read_cloud(tmp_path / name)
    assert cloud.points.dtype == np.float32
    assert (cloud.points == POINTS).all()
    assert cloud.source.endswith(name)


@pytest.mark.parametrize(("write", "name"), [(write_pcd, "a.pcd"), (write_ply, "a.ply")])
def test_what_is_written_is_read_to_the_bit(write, name, tmp_path):
    cloud = PointCloud(POINTS, np.array([1, 2, 3], np.float32), np.eye(3, dtype=np.float32))
    write(tmp_path / name, cloud)
    again = read_cloud(tmp_path / name)
    assert (again.points == cloud.points).all()
    assert (again.weights == cloud.weights).all()
    assert (again.normals == cloud.normals).all()
    write(tmp_path / name, PointCloud(POINTS))
    assert read_cloud(tmp_path / name).weights is None


BAD = {
    "a.pcd": (b"", "no line DATA"),
    "other.pcd": (GOOD["ascii.ply"], "named as PCD and holds PLY"),
    "fields.pcd": (pcd(fields="a y z", body=lines_of(POINTS)), "no field x"),
    "short.pcd": (pcd("binary", body=POINTS.tobytes()[:-1]), "claims 3 points .* truncated"),
    "claims.pcd": (pcd("binary", points=10**9, body=POINTS.tobytes()), "claims"),
    "huge.pcd": (pcd("binary", points=10**30), "claims .* want fewer"),
    "text.pcd": (pcd(points=4, body=lines_of(POINTS)), "claims 4 points and holds 3"),
    "many.pcd": (pcd(points=10**8, body=lines_of(POINTS)), "claims 100,000,000 points"),
    "none.pcd": (pcd(points=0), "holds no points"),
    "gone.pcd": (pcd(points=1, body=b"nan nan nan\n"), "holds no points"),
    "inf.pcd": (pcd(points=1, body=b"inf 0 0\n"), "1 points of nan or inf"),
    "words.pcd": (pcd(body=b"a b c\n" * 3), "is not a whole PCD file"),
    "form.pcd": (pcd("zipped"), "its DATA is 'zipped'"),
    "type.pcd": (pcd(kind="F F Q", body=lines_of(POINTS)), "type and size Q4"),
    "lengths.pcd": (pcd(kind="F F", body=lines_of(POINTS)), "differ in length"),
    "size.pcd": (pcd("binary_compressed", body=packed_body(POINTS.tobytes(), 40)), "packs 40 bytes"),
    "cut.pcd": (pcd("binary_compressed", body=packed_body(POINTS.tobytes())[:-2]), "truncated"),
    "cut.header.pcd": (pcd("binary_compressed", body=b"1234"), "ends before"),
    "bomb.pcd": (
        pcd("binary_compressed", points=10**7, body=struct.pack("<II", 3, 12 * 10**7) + bytes(3)),
        "more than LZF can pack",
    ),
    "back.pcd": (
        pcd("binary_compressed", body=struct.pack("<II", 4, 36) + b"\x00\x00\xe0\xff"),
        "damaged",
    ),
    "width.pcd": (
        pcd(body=lines_of(POINTS)).replace(b"POINTS 3", b"POINTS 2"),
        "3 points by WIDTH and HEIGHT, and 2 by",
    ),
    "more.ply": (ply("ascii", lines_of(POINTS), count=2), "claims 2 points, and 12 bytes are left"),
    "more.bytes.ply": (ply("binary_big_endian", POINTS.tobytes(), count=1), "claims 1 points, and 24 bytes are left"),
    "header.ply": (b"ply\nformat ascii 1.0\n", "no line end_header"),
    "short.ply": (ply("binary_little_endian", POINTS.tobytes()[:-1]), "claims 3 points .* truncated"),
    "claims.ply": (ply("binary_big_endian", POINTS.tobytes(), count=10**9), "claims"),
    "none.ply": (ply("ascii", b"", count=0), "holds no points"),
    "nan.ply": (ply("ascii", b"nan 0 0\n" + lines_of(POINTS), count=4), "nan or inf"),
    "form.ply": (ply("binary_middle", b""), "no format of"),
    "kind.ply": (ply("ascii", b"", "float float number"), "type number"),
    "lists.ply": (
        ply("binary_little_endian", b"", before="element face 9\nproperty list uchar int i\n"),
        "holds lists",
    ),
    "none.obj": (b"f 1 2 3\n", "holds no points"),
    "words.obj": (b"v 1 2 three\n", "is not a whole OBJ file"),
    "none.xyz": (b"# nothing\n\n", "holds no points"),
    "two.xyz": (b"1 2\n3 4\n", "is not a whole XYZ file"),
    "nan.xyz": (b"1 2 nan\n", "nan or inf"),
    "large.xyz": (b"1 2 1e300\n", "nan or inf"),
    "millimetres.xyz": (b"0 0 0\n6000 1 2\n", "6,000 m.*give scale 0.001"),
    "a.stl": (b"solid\n", "no cloud that is known"),
    "a.npz": (b"PK\x03\x04", "is not a whole NPZ file"),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_whole_cloud_are_refused_with_file_and_cause(name, tmp_path):
    content, words = BAD[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=words) as caught:
        read_cloud(tmp_path / name)
    assert name in str(caught.value)


def test_damaged_files_give_clouds_or_clear_errors(tmp_path):
    generator = np.random.default_rng(0)
    tally = {"read": 0, "refused": 0}
    for turn in range(1200):
        name = sorted(GOOD)[turn % len(GOOD)]
        content = bytearray(GOOD[name])
        for place in generator.integers(0, len(content), generator.integers(1, 4)):
            content[place] = generator.integers(0, 256)
        del content[generator.integers(len(content) // 2, 2 * len(content)) :]
        (tmp_path / name).write_bytes(content)
        try:
            assert np.isfinite(read_cloud(tmp_path / name).points).all()
            tally["read"] += 1
        except ValueError as error:
            tally["refused"] += name in str(error)
    assert sum(tally.values()) == 1200
    assert min(tally.values()) > 100


def test_real_clouds_are_read(shared_data):
    folder = shared_data / "clouds"
    if not folder.is_dir():
        pytest.skip(f"no real clouds at {folder}")
    counts = {
        "pcl/tutorials__room_scan1.pcd": 112_586,
        "open3d/fragment.pcd": 113_662,
        "pcl/tutorials__pairwise__capture0001.pcd": 249_647,
        "redkitchen/redkitchen_fused_2cm.npz": 162_830,
    }
    for name, count in counts.items():
        assert len(read_cloud(folder / name)) == count
    assert read_cloud(folder / "open3d/fragment.pcd").normals is not None


def test_real_depth_images_lie_on_the_fused_cloud_of_their_room(shared_data):
    folder = shared_data / "clouds/redkitchen"
    if not folder.is_dir():
        pytest.skip(f"no real clouds at {folder}")
    name = "frame-000150"
    camera = Intrinsics(585.0, 585.0, 320.0, 240.0)
    path, pose = folder / f"{name}.depth.png", folder / f"{name}.pose.txt"
    frame = read_cloud(path, intrinsics=camera, pose=pose)
    fused = read_cloud(folder / "redkitchen_fused_2cm.npz")
    low, high = fused.points.min(axis=0) - 0.1, fused.points.max(axis=0) + 0.1
    assert ((frame.points >= low) & (frame.points <= high)).all(axis=1).mean() > 0.95


WALL = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 2.5], [0.0, 0.0, 2.5]], np.float32)


def mesh_ply(form, faces, count=2, lists="property list uchar int vertex_indices\n", before=""):
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    points = lines_of(WALL) if order is None else WALL.astype(f"{order}f4").tobytes()
    header = f"ply\nformat {form} 1.0\nelement vertex 4\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    return f"{header}{before}element face {count}\n{lists}end_header\n".encode() + points + faces


MESHES = {
    "wall.obj": b"".join(b"v " + line + b"\n" for line in lines_of(WALL).splitlines()) + b"f 1 2 3\nf 1/1/1 3//2 4/7\n",
    "square.obj": b"".join(b"v " + line + b"\n" for line in lines_of(WALL).splitlines()) + b"f -4 -3 -2 -1\n",
    "ascii.ply": mesh_ply("ascii", b"3 0 1 2\n3 0 2 3\n"),
    "square.ply": mesh_ply("ascii", b"4 0 1 2 3\n", 1),
    "little.ply": mesh_ply("binary_little_endian", struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)),
    "big.ply": mesh_ply("binary_big_endian", struct.pack(">B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)),
    "mixed.ply": mesh_ply(
        "binary_little_endian",
        struct.pack("<fI3HfI4Hf", 1.0, 3, 0, 1, 2, 7.0, 4, 0, 1, 2, 3, 7.0)[:-4],
        lists="property float a\nproperty list uint ushort vertex_index\n",
    ),
    "edges.ply": mesh_ply(
        "binary_little_endian",
        bytes(8) + struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3),
        before="element edge 2\nproperty short a\nproperty short b\n",
    ),
}


@pytest.mark.parametrize("name", MESHES)
def test_faces_have_points_two_centimetres_apart(name, tmp_path):
    (tmp_path / name).write_bytes(MESHES[name])
    cloud = read_cloud(tmp_path / name)
    np.testing.assert_array_equal(cloud.points[:4], WALL)
    np.testing.assert_array_equal(cloud.points[:, 1], 0.0)
    assert cloud.points.min(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert cloud.points.max(axis=0) == pytest.approx([4.0, 0.0, 2.5], abs=1e-6)
    x, z = np.meshgrid(np.linspace(0.0, 4.0, 101), np.linspace(0.0, 2.5, 63))
    distances, _ = cKDTree(cloud.points).query(np.stack([x, 0.0 * x, z], axis=-1))
    assert distances.max() < 0.0145  # half the diagonal of 2 cm
    assert len(cloud) < 3.0 * 4.0 * 2.5 / 0.02**2
    # Of millimetres, too.
    assert len(read_cloud(tmp_path / name, scale=0.1)) < 0.02 * len(cloud)


def test_small_faces_add_nothing_and_huge_ones_stay_within_bounds(tmp_path):
    (tmp_path / "a.ply").write_bytes(MESHES["ascii.ply"])
    assert len(read_cloud(tmp_path / "a.ply", scale=0.002)) == 4
    cloud = read_cloud(tmp_path / "a.ply", scale=200.0)
    assert len(cloud) < 4_100_000
    assert "m apart, since it is large" in cloud.remarks[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            mesh_ply("ascii", b"3 0 1 2\n", 1, "property list float int vertex_indices\n"),
            "a list of float and int, which PLY has not",
        ),
        (mesh_ply("ascii", b"3 0 1 9\n", 1), "name the points 0 to 9; there are 4"),
        (mesh_ply("ascii", b"3 0 1 2\n", 4000), "claims 4,004 elements"),
        (mesh_ply("ascii", b"3 0 1 2\n", 9), "claims 9 faces and holds . lines: truncated"),
        (mesh_ply("binary_little_endian", struct.pack("<B3i", 3, 0, 1, 2), 2), "ends before their last: truncated"),
        (mesh_ply("binary_little_endian", struct.pack("<B", 255), 1), "ends before their last: truncated"),
        (mesh_ply("binary_little_endian", b"", 2**31), "claims 2,147,483,652 elements in"),
        (mesh_ply("ascii", b"", 2**31), "claims 2,147,483,652 elements in"),
        (
            b"ply\nformat ascii 1.0\nelement face 2147483647\nproperty list uchar int vertex_indices\n"
            b"element vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            "truncated|claims",
        ),
    ],
)
def test_faces_that_are_not_there_are_refused(tmp_path, content, message):
    (tmp_path / "a.ply").write_bytes(content)
    with pytest.raises(ValueError, match=message):
        read_cloud(tmp_path / "a.ply")


def test_coordinates_of_a_grid_keep_their_digits(tmp_path):
    generator = np.random.default_rng(0)
    points = generator.uniform(0.0, 5.0, (100, 3)) + np.array([530_000.0, 4_181_000.0, 35.0])
    np.savetxt(tmp_path / "a.xyz", points, "%.4f")
    np.savez(tmp_path / "a.npz", xyz=points)
    for name in ("a.xyz", "a.npz"):
        cloud = read_cloud(tmp_path / name)
        assert cloud.offset.tolist() == [530_000.0, 4_181_000.0, 0.0]
        assert np.abs(cloud.points + cloud.offset - points).max() < 1e-4
        assert "530,000, 4,181,000, 0 is taken off" in cloud.remarks[0]
    np.savez(tmp_path / "a.npz", xyz=points.astype(np.float32))
    assert "in steps of 0.25: digits are lost" in read_cloud(tmp_path / "a.npz").remarks[1]


def test_coordinates_of_another_grid_keep_their_digits(shared_cases):
    grid, local = (read_cloud(shared_cases / "cloud-grid-coordinates" / f"{name}.ply") for name in ("grid", "local"))
    assert np.abs(grid.points + grid.offset - local.points - np.array([530_000.0, 181_000.0, 35.0])).max() < 1e-3
    assert not local.offset.any()
    assert not local.remarks


def test_zeros_of_sensors_are_left_out_and_told(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n" * 3 + "1 2 3\n4 5 6\n")
    cloud = read_cloud(tmp_path / "a.xyz")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert cloud.remarks == ("3 points at the origin are left out, as sensors write them for no return",)
    (tmp_path / "a.xyz").write_text("0 0 0\n1 2 3\n")
    assert len(read_cloud(tmp_path / "a.xyz")) == 2


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("1,5 2,25 -3,0\n4 5 6,5\n", [[1.5, 2.25, -3.0], [4.0, 5.0, 6.5]]),
        ("1,5;2,25;3,125\n", [[1.5, 2.25, 3.125]]),
        ("1,5\t2,25\t3e0\n", [[1.5, 2.25, 3.0]]),
        ("1;2.5;3\n", [[1.0, 2.5, 3.0]]),
        ("1,2.5,3\n", [[1.0, 2.5, 3.0]]),
        ("1, 2, 3\n4,5,6\n", [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        ("1,2,3 255,0,0\n", [[1.0, 2.0, 3.0]]),
    ],
)
def test_commas_part_numbers_or_are_decimal(tmp_path, text, points):
    (tmp_path / "a.xyz").write_text(text)
    cloud = read_cloud(tmp_path / "a.xyz")
    assert cloud.points.tolist() == points
    assert ("decimal" in "".join(cloud.remarks)) == ("1,5" in text)


@pytest.mark.parametrize("text", ["1,5 2.5 3,5\n", "1,05,2,5,3,5\n"])
def test_commas_that_may_be_either_are_refused(tmp_path, text):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(ValueError, match="want decimal points"):
        read_cloud(tmp_path / "a.xyz")


def test_headers_of_cloudcompare_and_pts_are_passed_over(tmp_path):
    rows = "1 2 3 4\n5 6 7 8\n"
    for name, content, expected in (
        ("a.asc", f"//X Y Z Intensity\n{rows}", [[1, 2, 3], [5, 6, 7]]),
        ("b.asc", f"//X Y Z Intensity\n2\n{rows}", [[1, 2, 3], [5, 6, 7]]),
        ("c.pts", f"2\r\n{rows}", [[1, 2, 3], [5, 6, 7]]),
        ("d.csv", "intensity,Z,Y,X\n1,2,3,4\n5,6,7,8\n", [[4, 3, 2], [8, 7, 6]]),
        ("e.txt", f"# made by hand\n{rows}", [[1, 2, 3], [5, 6, 7]]),
    ):
        (tmp_path / name).write_text(content)
        np.testing.assert_array_equal(read_cloud(tmp_path / name).points, expected)
    (tmp_path / "short.pts").write_text(f"3\n{rows}")
    with pytest.raises(ValueError, match="claims 3 points, and 2 lines follow"):
        read_cloud(tmp_path / "short.pts")


def test_arrays_and_laser_scans_are_clouds(tmp_path):
    points = np.random.default_rng(0).normal(size=(5, 4)).astype(np.float32)
    np.save(tmp_path / "a.npy", points)
    (tmp_path / "a.bin").write_bytes(points.tobytes())
    for name in ("a.npy", "a.bin"):
        np.testing.assert_array_equal(read_cloud(tmp_path / name).points, points[:, :3])
    (tmp_path / "b.bin").write_bytes(points.tobytes()[:-3])
    with pytest.raises(ValueError, match="has 77 bytes; want a multiple of 16"):
        read_cloud(tmp_path / "b.bin")
    np.save(tmp_path / "flat.npy", points[:, :2])
    with pytest.raises(ValueError, match="shape"):
        read_cloud(tmp_path / "flat.npy")


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_las_files_keep_the_digits_of_grids_and_leave_out_noise(tmp_path, name):
    laspy = pytest.importorskip("laspy", reason="the extra clouds is not installed")
    points = np.random.default_rng(0).uniform(0.0, 5.0, (200, 3)) + np.array([530_000.0, 181_000.0, 35.0])
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-4), points.min(axis=0)
    las = laspy.LasData(header)
    las.xyz = points
    las.classification = np.where(np.arange(200) < 3, 7, 1).astype(np.uint8)
    las.write(tmp_path / name)
    cloud = read_cloud(tmp_path / name)
    assert len(cloud) == 197
    np.testing.assert_allclose(cloud.points + cloud.offset, points[3:], atol=5e-4)
    assert any("3 points of noise are left out" in remark for remark in cloud.remarks)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:200])
    with pytest.raises(ValueError, match=name):
        read_cloud(tmp_path / name)


def test_scans_of_e57_files_are_moved_by_their_poses(tmp_path):
    pye57 = pytest.importorskip("pye57", reason="the extra clouds is not installed")
    points = np.random.default_rng(0).uniform(0.0, 5.0, (50, 3))
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    columns = {f"cartesian{axis}": points[:, k] for k, axis in enumerate("XYZ")}
    for shift in (0.0, 10.0):
        file.write_scan_raw(columns, rotation=np.array([1.0, 0.0, 0.0, 0.0]), translation=np.array([shift, 0.0, 0.0]))
    file.close()
    found = read_cloud(tmp_path / "a.e57").points
    np.testing.assert_allclose(found, np.concatenate([points, points + np.array([10.0, 0.0, 0.0])]), atol=1e-4)
    (tmp_path / "a.e57").write_bytes((tmp_path / "a.e57").read_bytes()[:60])
    with pytest.raises(ValueError, match=r"a\.e57"):
        read_cloud(tmp_path / "a.e57")


@pytest.mark.parametrize(("name", "package"), [("a.las", "laspy"), ("a.e57", "pye57")])
def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch, name, package):
    (tmp_path / name).write_bytes(b"LASF" if name == "a.las" else b"ASTM-E57")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ValueError, match=rf"need the package {package}: pip install"):
        read_cloud(tmp_path / name)

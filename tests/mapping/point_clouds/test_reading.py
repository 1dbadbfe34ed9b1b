"""Clouds of every kind of file are read as they were written; damaged ones are refused with the cause."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from lidarium.mapping.point_clouds.depth_images import TUM_UNITS, read_depth_image, read_pose
from lidarium.mapping.point_clouds.intrinsics import Intrinsics
from lidarium.mapping.point_clouds.pcd import write_pcd
from lidarium.mapping.point_clouds.ply import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.point_clouds.reading import read_cloud

POINTS = np.array([[1.0, 2.0, 3.0], [-0.5, 0.25, 4.0], [0.0, -8.0, 1.5]], np.float32)
PINHOLE = Intrinsics(100.0, 100.0, 1.0, 0.5)


def pcd(form="ascii", fields="x y z", size="4 4 4", kind="F F F", count=None, points=3, body=b""):
    counts = "" if count is None else f"COUNT {count}\n"
    header = f"VERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\n{counts}WIDTH {points}\nHEIGHT 1\n"
    return f"{header}VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {form}\n".encode() + body


def lines_of(points):
    return "".join(" ".join(map(str, row)) + "\n" for row in np.asarray(points).tolist()).encode()


def literal_lzf(content):
    pieces = [content[start : start + 32] for start in range(0, len(content), 32)]
    return b"".join(bytes([len(piece) - 1]) + piece for piece in pieces)


def packed_body(content, size=None):
    packed = literal_lzf(content)
    return struct.pack("<II", len(packed), len(content) if size is None else size) + packed


def ply(form, rows, kinds="float float float", names="x y z", before="", count=3, after=b""):
    properties = "".join(
        f"property {kind} {name}\n" for kind, name in zip(kinds.split(), names.split(), strict=True)
    )
    header = f"ply\nformat {form} 1.0\ncomment by hand\n{before}element vertex {count}\n{properties}"
    return f"{header}element face 0\nproperty list uchar int i\nend_header\n".encode() + rows + after


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
    + b"vn 0 0 1\nf 1 2 3\n",
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


def test_points_of_a_ply_may_come_after_other_elements(tmp_path):
    before = "element camera 2\nproperty short a\nproperty uchar b\n"
    (tmp_path / "a.ply").write_bytes(ply("binary_little_endian", bytes(6) + POINTS.tobytes(), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()
    (tmp_path / "a.ply").write_bytes(ply("ascii", b"1 2\n3 4\n" + lines_of(POINTS), before=before))
    assert (read_cloud(tmp_path / "a.ply").points == POINTS).all()


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


def test_points_that_a_pcd_has_as_nan_are_no_measurements(tmp_path):
    points = np.concatenate([POINTS, np.full((1, 3), np.nan, np.float32)])
    (tmp_path / "a.pcd").write_bytes(pcd("binary", points=4, body=points.tobytes()))
    assert len(read_cloud(tmp_path / "a.pcd")) == 3


@pytest.mark.parametrize("suffix", ["pgm", "png"])
def test_depth_images_become_points_of_the_map(suffix, tmp_path):
    image = np.array([[0, 1000, 65535], [2000, 0, 0]], np.uint16)
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), image)
    optical = [[0.0, -0.005, 1.0], [-0.02, 0.01, 2.0]]
    assert read_cloud(path, intrinsics=PINHOLE).points == pytest.approx(np.array(optical))
    assert read_depth_image(path, PINHOLE, TUM_UNITS).points[:, 2].tolist() == pytest.approx([0.2, 0.4])
    (tmp_path / "pose.txt").write_text("0 0 1 5\n-1 0 0 0\n0 -1 0 1\n0 0 0 1\n")
    on_map = read_cloud(path, intrinsics=PINHOLE, pose=tmp_path / "pose.txt").points
    assert on_map == pytest.approx(np.array([[6.0, 0.0, 1.005], [7.0, 0.02, 0.99]]), abs=1e-6)


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
    "header.ply": (b"ply\nformat ascii 1.0\n", "no line end_header"),
    "short.ply": (ply("binary_little_endian", POINTS.tobytes()[:-1]), "claims 3 points .* truncated"),
    "claims.ply": (ply("binary_big_endian", POINTS.tobytes(), count=10**9), "claims"),
    "none.ply": (ply("ascii", b"", count=0), "holds no points"),
    "nan.ply": (ply("ascii", b"nan 0 0\n" + lines_of(POINTS)), "nan or inf"),
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


def test_millimetres_are_read_with_their_scale(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n6000 1 2\n")
    assert read_cloud(tmp_path / "a.xyz", scale=0.001).points[1].tolist() == pytest.approx(
        [6.0, 0.001, 0.002]
    )
    with pytest.raises(ValueError, match="scale of"):
        read_cloud(tmp_path / "a.xyz", scale=0.0)


def test_depth_images_of_the_wrong_type_are_refused(tmp_path):
    for name, image in {"a.png": np.ones((2, 2), np.uint8), "b.png": np.ones((2, 2, 3), np.uint16)}.items():
        cv2.imwrite(str(tmp_path / name), image)
        with pytest.raises(ValueError, match="want a depth image, one channel of uint16"):
            read_cloud(tmp_path / name, intrinsics=PINHOLE)
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((2, 2), np.uint16))
    with pytest.raises(ValueError, match=r"c\.png holds no points"):
        read_cloud(tmp_path / "c.png", intrinsics=PINHOLE)
    with pytest.raises(ValueError, match="want the intrinsics"):
        read_cloud(tmp_path / "c.png")


@pytest.mark.parametrize("text", ["1 0 0\n0 1 0\n", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n", "a b c d\n"])
def test_poses_that_are_no_motion_are_refused(text, tmp_path):
    (tmp_path / "pose.txt").write_text(text)
    with pytest.raises(ValueError, match=r"pose\.txt is not a pose"):
        read_pose(tmp_path / "pose.txt")


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


def test_packed_bytes_of_another_packer_are_refused(tmp_path):
    body = struct.pack("<II", 100, 36) + zlib.compress(POINTS.tobytes()).ljust(100, b"\0")
    (tmp_path / "a.pcd").write_bytes(pcd("binary_compressed", body=body))
    with pytest.raises(ValueError, match="damaged"):
        read_cloud(tmp_path / "a.pcd")

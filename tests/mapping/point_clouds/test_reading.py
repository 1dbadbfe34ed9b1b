"""Clouds of every kind of file are read as they were written; damaged ones are refused with the cause."""

import struct

import numpy as np
import pytest
from cloud_files import POINTS, lines_of, packed_body, pcd, ply

from lidarium.mapping.point_clouds.intrinsics import Intrinsics
from lidarium.mapping.point_clouds.pcd import write_pcd
from lidarium.mapping.point_clouds.ply import write_ply
from lidarium.mapping.point_clouds.point_cloud import PointCloud
from lidarium.mapping.point_clouds.reading import read_cloud

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

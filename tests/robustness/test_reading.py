"""Files that would take all memory or all time are refused before they do, with a message to be read."""

import gzip
import io
import json
import os
import struct
import time
import zipfile
import zlib

import cv2
import numpy as np
import pytest
from robustness.samples import PLAN

from lidarium.envs.floors.catalogue.drawn import load_drawn
from lidarium.envs.floors.importers import load_file
from lidarium.evaluation.record import read_record
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import read_suite
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.guarded_reading import (
    MAX_MESSAGE,
    _array_of,
)
from lidarium.mapping.files.images import read_image
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.mapping.files.npz_logs import read_npz_log
from lidarium.mapping.files.spline_files import read_spline_map
from lidarium.mapping.files.trajectories import read_tum
from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.scripts.common import BAD_INPUT
from lidarium.scripts.main import main

HEADER = "image: {}\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
READERS = {
    "a.yaml": load_file,
    "b.yaml": read_ros_map,
    "a.png": lambda path: load_file(path, 0.1),
    "a.json": load_file,
    "a.xml": load_file,
    "a.vectormap.txt": load_file,
    "a.txt": load_file,
    "a.npy": lambda path: load_file(path, 0.1),
    "a.npz": load_file,
    "b.json": load_drawn,
    "log.npz": read_npz_log,
    "a.log": read_carmen_log,
    "a.tum": read_tum,
    "s.json": read_spline_map,
    "s.npz": read_spline_map,
    "suite.toml": read_suite,
    "record.npz": read_record,
    "episodes.jsonl": read_episodes,
    "a.pcd": read_cloud,
    "a.ply": read_cloud,
    "a.obj": read_cloud,
    "a.xyz": read_cloud,
}


HANG_S = 60.0
"""Processor time of a file that never ends, on any machine."""


def refused(read, path, words="want|is not"):
    began = time.process_time()
    with pytest.raises((ValueError, FileNotFoundError), match=words) as caught:
        read(path)
    assert time.process_time() - began < HANG_S
    assert len(str(caught.value)) <= MAX_MESSAGE
    return str(caught.value)


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_a_device_and_a_folder_are_no_files(name, tmp_path):
    os.mkfifo(tmp_path / name)
    assert "pipe or a device" in refused(READERS[name], tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    assert "pipe or a device" in refused(READERS[name], tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    assert "is a folder" in refused(READERS[name], tmp_path / name)


def test_the_picture_of_a_map_may_be_no_device_either(tmp_path):
    (tmp_path / "map.yaml").write_text(HEADER.format("/dev/zero"))
    refused(read_ros_map, tmp_path / "map.yaml", "/dev/zero is a pipe or a device")


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("content", [b"[" * 50_000, b'{"a":' * 50_000, b"x = " + b"[" * 50_000, b"<a>" * 50_000])
def test_deep_nesting_is_told_as_such_or_as_what_it_is_not(name, content, tmp_path):
    (tmp_path / name).write_bytes(content + b"\n\n")
    refused(READERS[name], tmp_path / name, ".")


@pytest.mark.parametrize("name", ["a.xml.gz", "a.vectormap.txt.gz", "a.json.gz", "a.txt.gz"])
def test_a_small_file_that_unpacks_to_gigabytes_is_refused(name, tmp_path):
    packer = zlib.compressobj(1, wbits=31)
    pieces = [packer.compress(b"0" * (1 << 20)) for _ in range(10)]
    (tmp_path / name).write_bytes(b"".join(pieces) + packer.flush())
    refused(load_file, tmp_path / name, "more than .* bytes when unpacked|has no")


def test_a_log_that_unpacks_to_gigabytes_is_refused(tmp_path):
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(b"# a remark\n" * 1_000_000, 1))
    refused(read_carmen_log, tmp_path / "a.log.gz", "more than .* bytes when unpacked")
    (tmp_path / "b.log.gz").write_bytes(gzip.compress(b"FLASER 1 " * 1_000_000, 1))
    refused(read_carmen_log, tmp_path / "b.log.gz", "a line of more than")


def png(width, height):
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunk = b"IHDR" + header
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))


def enlarged(suffix, old, new):
    """Return a small picture whose header states another size."""
    content = cv2.imencode(suffix, np.zeros((40, 60), np.uint8))[1].tobytes()
    assert old in content
    return content.replace(old, new, 1)


@pytest.mark.parametrize(
    "content",
    [
        png(20_000, 20_000) + bytes(4) + b"IDAT" + struct.pack(">I", zlib.crc32(b"IDAT")),
        b"P5\n20000 20000\n255\n",
        enlarged(".bmp", struct.pack("<ii", 60, 40), struct.pack("<ii", 20_000, 20_000)),
        enlarged(".jpg", struct.pack(">HH", 40, 60), struct.pack(">HH", 65_000, 65_000)),
        enlarged(".tif", struct.pack("<HHII", 256, 3, 1, 60), struct.pack("<HHII", 256, 4, 1, 20_000_000)),
    ],
    ids=["png", "pgm", "bmp", "jpg", "tif"],
)
def test_a_picture_whose_header_is_too_large_is_refused_unread(content, tmp_path):
    (tmp_path / "a.png").write_bytes(content)
    refused(read_image, tmp_path / "a.png", "pixels in .* want at most")


def test_a_picture_of_tags_that_all_hold_the_whole_file_is_refused(tmp_path):
    tags = [(256, 4, 1, 60), (257, 4, 1, 40), *((1000 + k, 7, 300_000, 100) for k in range(30_000))]
    table = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    (tmp_path / "a.tif").write_bytes(b"II*\0\x08\0\0\0" + struct.pack("<H", len(tags)) + table + bytes(600_000))
    refused(read_image, tmp_path / "a.tif", "not an image that can be read")


def test_a_picture_whose_chunk_claims_gigabytes_is_refused_unread(tmp_path):
    (tmp_path / "a.png").write_bytes(png(60, 40) + struct.pack(">I", 0xFF000084) + b"IDAT" + bytes(100))
    refused(read_image, tmp_path / "a.png", "not an image that can be read")


def claims(shape, kind="<f8"):
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": kind, "fortran_order": False, "shape": shape})
    return file.getvalue()


@pytest.mark.parametrize("shape", [(100_000, 125_000), (10**18,), (3, -1), (0, 10**30)])
def test_an_array_that_claims_more_than_it_holds_is_refused_unread(shape, tmp_path):
    (tmp_path / "a.npy").write_bytes(claims(shape) + bytes(8))
    refused(lambda path: load_file(path, 0.1), tmp_path / "a.npy", "claims|is not")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("ranges.npy", claims(shape) + bytes(8))
    for read in (load_file, read_npz_log, read_spline_map):
        refused(read, tmp_path / "a.npz", "claims|is not")


def test_arrays_of_objects_are_refused():
    with pytest.raises(ValueError, match="want numbers"):
        _array_of(claims((1,), "|O") + bytes(8))


def test_an_archive_whose_members_unpack_to_gigabytes_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in ("ranges", "angle_min", "angle_increment"):
            archive.writestr(f"{name}.npy", claims((10_000_000,)) + bytes(80_000_000))
    refused(read_npz_log, tmp_path / "a.npz", "there is room for")


def test_a_bomb_of_aliases_is_refused_without_being_shown(tmp_path):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    (tmp_path / "map.yaml").write_text("\n".join(lines) + "\n" + HEADER.format("*a11"))
    refused(read_ros_map, tmp_path / "map.yaml", "alias")


def test_entities_of_xml_that_stand_for_gigabytes_are_refused(tmp_path):
    entities = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 12))
    text = f'<!DOCTYPE f [<!ENTITY e0 "{"x" * 100}">{entities}]><floor><a>&e11;</a></floor>'
    (tmp_path / "a.xml").write_text(text)
    refused(load_file, tmp_path / "a.xml", "not XML")


def test_walls_and_doors_by_the_thousand_are_not_compared_with_each_other(tmp_path):
    (tmp_path / "a.txt").write_text("0 0 60 0 wall\n" * 20_000 + "3 0 9 0 door\n" * 20_000)
    refused(load_file, tmp_path / "a.txt", "want a product")
    plan = {**PLAN, "walls": [[0, 0, 3, 3]] * 20_000, "doors": [[1, 1]] * 20_000}
    (tmp_path / "b.json").write_text(json.dumps(plan, separators=(",", ":")))
    refused(load_drawn, tmp_path / "b.json", "want a product")


@pytest.mark.parametrize("far", [1e6, 1e9, 1e18, 1e300])
def test_an_outline_with_far_corners_is_refused(far, tmp_path):
    texts = {
        "a.vectormap.txt": f"0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n1,1,{far},1\n",
        "a.txt": f"0 0 60 0 wall\n60 0 60 40 wall\n60 40 0 40 wall\n0 40 0 0 wall\n9 9 {far} 9 wall\n3 3 3 4 door\n",
        "a.json": json.dumps({"verts": [[0, 0], [far, 0], [6, 4], [0, 4]]}),
        "b.json": json.dumps({**PLAN, "blocks": [[1, 1, far, 2]]}),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        refused(READERS[name], tmp_path / name, "check its scale|want an annotation|beyond")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("starts = 1.0", "starts"),
        ("starts = { apartment = 3 }", "starts"),
        ("starts = { apartment = [[[1, 2, nan]]] }", "x, y"),
        ("seeds = 100000000000000000000000", "seeds"),
        ("seeds = [99999999999999999999999999]", "seeds"),
        ("policy_settings = true", "policy_settings"),
        ("variants = [1]", "variants"),
        ("stop = 3", "stop"),
        ("stop = { figure = 'c_free', at_least = 'x' }", "at_least"),
        ("draws_starts = 3", "draws_starts"),
        ("image_resolution = true", "image_resolution"),
        ("robots = [1.0]", "robots"),
        ("settings = { lidar = { range_max = 1e300 } }", "range_max"),
    ],
)
def test_a_suite_with_values_of_another_kind_is_refused_by_name(text, words, tmp_path):
    (tmp_path / "suite.toml").write_text(f'policies = ["random_walk"]\nfloors = ["apartment"]\n{text}\n')
    assert "suite.toml" in refused(read_suite, tmp_path / "suite.toml", words)


def test_the_command_line_tells_a_damaged_file_with_the_code_of_bad_input(tmp_path, capsys):
    (tmp_path / "a.npy").write_bytes(claims((10**12,)))
    assert main(["floors", "show", str(tmp_path / "a.npy"), "--resolution", "0.1"]) == BAD_INPUT
    told = capsys.readouterr().err
    assert "a.npy" in told
    assert "Traceback" not in told

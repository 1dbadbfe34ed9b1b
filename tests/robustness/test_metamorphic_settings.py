"""Clouds, settings and sparse maps are the same in every encoding of their text."""

import json

import numpy as np
import pytest
from robustness.test_metamorphic import encodings


def cloud_files():
    from cloud_files import lines_of, pcd, ply

    lines = lines_of([[1.0, 2.0, 3.0], [-0.5, 0.25, 4.0], [0.0, -8.0, 1.5]]).decode()
    vertices = "".join(f"v {line}\n" for line in lines.splitlines())
    yield "a.xyz", lines
    yield "a.obj", vertices + "f 1 2 3\n"
    yield "a.pcd", pcd(body=lines.encode()).decode()
    yield "a.ply", ply("ascii", lines.encode()).decode()


@pytest.mark.parametrize(("name", "text"), list(cloud_files()), ids=lambda each: each[:5])
def test_a_cloud_of_lines_is_the_same_in_every_form(name, text, tmp_path):
    from lidarium.mapping.point_clouds.cloud_files import read_cloud

    (tmp_path / name).write_text(text)
    expected = read_cloud(tmp_path / name).points
    for _, content in encodings(text):
        (tmp_path / name).write_bytes(content)
        np.testing.assert_array_equal(read_cloud(tmp_path / name).points, expected)


def settings_files():
    from robustness.samples import PLAN, SUITE, TRAINING

    from lidarium.envs.floors.catalogue.drawn import load_drawn
    from lidarium.evaluation.suites.suite import read_suite
    from lidarium.mapping.point_clouds.cameras import read_pose
    from lidarium.training.settings import read_training

    yield "suite.toml", SUITE, lambda path: read_suite(path).as_dict()
    yield "training.toml", TRAINING, lambda path: read_training(path).as_dict()
    yield "plan.json", json.dumps(PLAN), lambda path: load_drawn(path).geometry_sha256
    yield "pose.txt", "0 0 1 0.5\n-1 0 0 0.25\n0 -1 0 1.0\n0 0 0 1\n", lambda path: read_pose(path).tolist()


@pytest.mark.parametrize(("name", "text", "read"), list(settings_files()), ids=lambda each: "")
def test_settings_are_the_same_in_every_form(name, text, read, tmp_path):
    (tmp_path / name).write_text(text)
    expected = read(tmp_path / name)
    for _, content in encodings(text):
        (tmp_path / name).write_bytes(content)
        assert read(tmp_path / name) == expected


def test_a_sparse_map_is_the_same_as_numbers_and_as_text(tmp_path):
    from made_sparse_maps import some_map

    from lidarium.mapping.sparse.map_files import read_sparse_map, text_content, write_sparse_map

    write_sparse_map(tmp_path / "a.smap", some_map())
    (tmp_path / "a.txt").write_text(text_content(some_map()))
    (binary, _), (text, _) = (read_sparse_map(tmp_path / name) for name in ("a.smap", "a.txt"))
    order = np.lexsort(binary.free.T), np.lexsort(text.free.round(2).T)
    np.testing.assert_allclose(binary.free[order[0]], text.free[order[1]], atol=0.0051)
    for form, content in encodings((tmp_path / "a.txt").read_text()):
        if form == "empty lines at its end":
            continue  # each line is a code
        (tmp_path / "b.txt").write_bytes(content)
        again, _ = read_sparse_map(tmp_path / "b.txt")
        np.testing.assert_array_equal(again.boxes, text.boxes)
        np.testing.assert_array_equal(again.free, text.free)

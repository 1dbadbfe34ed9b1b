import gzip
import math
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lidarium.evaluation.metrics.poses import absolute_error
from lidarium.evaluation.metrics.relations import (
    BEYOND_S,
    Relations,
    covered,
    read_relations,
    relation_errors,
)
from lidarium.mapping.files.trajectories import write_tum
from lidarium.mapping.geometry.rigid import composed, relative


def some_poses(count=50, seed=0):
    generator = np.random.default_rng(seed)
    return np.stack([*generator.uniform(-5, 5, (2, count)), generator.uniform(-3, 3, count)], axis=1)


def test_a_trajectory_in_any_frame_keeps_its_own_relations():
    poses = some_poses()
    relations = Relations(np.zeros(25), np.ones(25), relative(poses[:25], poses[25:]))
    moved = composed(np.array([3.0, 4.0, 2.0]), poses)
    errors = relation_errors(moved[:25], moved[25:], relations)
    assert errors.relations == 25
    assert max(value for name, value in errors.as_dict().items() if name != "relations") < 1e-9


def test_errors_are_means_of_lengths_and_angles_and_of_their_squares():
    relations = Relations(np.zeros(2), np.ones(2), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, math.pi - 0.05]]))
    begin = np.zeros((2, 3))
    end = np.array([[1.3, 0.4, 0.1], [0.0, 0.0, -math.pi + 0.05]])
    errors = relation_errors(begin, end, relations)
    assert errors.translation_m == pytest.approx(0.25)
    assert errors.translation_sd_m == pytest.approx(0.25)
    assert errors.translation_squared_m2 == pytest.approx(0.125)
    assert errors.translation_squared_sd_m2 == pytest.approx(0.125)
    assert errors.rotation_rad == pytest.approx(0.1)
    assert errors.rotation_sd_rad == pytest.approx(0.0, abs=1e-9)
    assert errors.rotation_squared_rad2 == pytest.approx(0.01)


@pytest.mark.parametrize("name", ["a.relations", "a.relations.gz"])
def test_relations_are_read(tmp_path, name):
    content = b"1.5 2.5 0.1 0.2 0 0 0 0.3\n3.5 2.5 1 2 9 9 9 -0.3\n"
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith("gz") else content)
    relations = read_relations(tmp_path / name)
    assert relations.begin.tolist() == [1.5, 3.5]
    assert relations.end.tolist() == [2.5, 2.5]
    assert relations.motions.tolist() == [[0.1, 0.2, 0.3], [1.0, 2.0, -0.3]]


def test_relations_of_times_beyond_the_log_are_left_out():
    begin, end = np.array([0.0, 9.0, 4.0 - BEYOND_S, 6.0]), np.array([5.0, 6.0, 6.0, 4.0 - 2.0 * BEYOND_S])
    found = covered(Relations(begin, end, np.arange(12.0).reshape(4, 3)), np.array([4.0, 5.0, 8.5]))
    assert found.begin.tolist() == [9.0, 3.0]
    assert found.end.tolist() == [6.0, 6.0]
    assert found.motions.tolist() == [[3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]


def test_relations_on_another_clock_are_refused_with_both_spans():
    relations = Relations(np.array([1000.5]), np.array([1001.0]), np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"1000\.500 to 1001\.000 s, the log of 0\.000 to 20\.000 s"):
        covered(relations, np.array([0.0, 20.0]))


@pytest.mark.parametrize("content", ["", "1 2 3\n", "a b c d e f g h\n"])
def test_what_is_no_file_of_relations_is_refused(tmp_path, content):
    (tmp_path / "bad.relations").write_text(content)
    with pytest.raises(ValueError, match="is not a file of relations"):
        read_relations(tmp_path / "bad.relations")


def test_the_absolute_error_is_that_of_evo(tmp_path):
    program = Path(os.environ.get("LIDARIUM_EVO", "")) / "evo_ape"
    if not os.environ.get("LIDARIUM_EVO") or not program.exists():
        pytest.skip(
            "evo is not there; install it in an environment of its own and set LIDARIUM_EVO to the folder of "
            "its programs"
        )
    true = some_poses()
    believed = composed(np.array([1.0, 2.0, 0.7]), true + np.random.default_rng(1).normal(0.0, 0.1, true.shape))
    for name, poses in (("true", true), ("believed", believed)):
        write_tum(tmp_path / f"{name}.tum", np.arange(len(poses)) * 0.1, poses)
    arguments = [
        str(program),
        "tum",
        str(tmp_path / "true.tum"),
        str(tmp_path / "believed.tum"),
        "--align",
        "--project_to_plane",
        "xy",
    ]
    told = subprocess.run(
        arguments,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "HOME": str(tmp_path)},
    ).stdout
    (found,) = re.findall(r"rmse\s+([0-9.]+)", told)
    assert float(found) == pytest.approx(absolute_error(believed, true), abs=2e-5)

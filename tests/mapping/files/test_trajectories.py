import math

import numpy as np
import pytest

from lidarium.mapping.files.trajectories import at_readings, interpolated, last_before, read_tum, write_tum
from lidarium.mapping.geometry.rigid import composed, relative


def test_trajectories_are_read_as_they_were_written(tmp_path):
    stamps, poses = np.array([0.5, 1234567890.25]), np.array([[1.0, -2.0, 3.0], [0.25, 0.5, -3.0]])
    write_tum(tmp_path / "a" / "trajectory.tum", stamps, poses)
    back = read_tum(tmp_path / "a" / "trajectory.tum")
    assert back[0].tolist() == stamps.tolist()
    assert back[1] == pytest.approx(poses, abs=1e-6)


@pytest.mark.parametrize("text", ["", "# nothing\n", "1 2 3\n", "0 0 0 0 0 0 0 one\n", "0 0 0 0 0 0 0 nan\n"])
def test_what_is_no_trajectory_is_refused(tmp_path, text):
    (tmp_path / "bad.tum").write_text(text)
    with pytest.raises(ValueError, match=r"bad\.tum is not a trajectory"):
        read_tum(tmp_path / "bad.tum")


def test_rotations_are_unit_quaternions_but_for_what_files_round(tmp_path):
    (tmp_path / "rounded.tum").write_text("0 0 0 0 0 0 0.7 0.7\n")
    assert read_tum(tmp_path / "rounded.tum")[1][0, 2] == pytest.approx(0.5 * math.pi)
    for rotation in ("0 0 0 0", "0 0 1.57 0.5", "0 0 0.99 0.9"):
        (tmp_path / "bad.tum").write_text(f"0 0 0 0 0 0 0 1\n1 0 0 0 {rotation}\n")
        with pytest.raises(ValueError, match=rf"bad\.tum has the rotation {rotation} at 1 s; want unit quaternions"):
            read_tum(tmp_path / "bad.tum")


def test_poses_between_stamps_turn_the_short_way():
    poses = np.array([[0.0, 0.0, 3.0], [2.0, 0.0, -3.0]])
    found = interpolated(np.array([0.0, 1.0]), poses, np.array([-1.0, 0.5, 2.0]))
    assert found[[0, 2]] == pytest.approx(poses)
    assert abs(found[1, 2]) == pytest.approx(math.pi)
    assert interpolated(np.array([0.0]), poses[:1], np.array([5.0])) == pytest.approx(poses[:1])


def test_between_known_poses_odometry_tells_the_way():
    true = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, math.pi / 2], [1, 1, math.pi / 2], [1, 2, math.pi / 2]])
    frame = np.array([5.0, -3.0, 1.0])
    found = at_readings(true[[0, 4]], np.array([0, 4]), composed(frame, true))
    assert found == pytest.approx(true, abs=1e-9)
    assert at_readings(true[[1]], np.array([1]), composed(frame, true)) == pytest.approx(true, abs=1e-9)


def test_what_odometry_misses_is_made_up_for_little_by_little():
    readings = np.stack([np.linspace(0.0, 1.2, 5), np.zeros(5), np.zeros(5)], axis=1)
    found = at_readings(np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([0, 4]), readings)
    assert found[:, 0] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    assert relative(found[0], found[-1]) == pytest.approx([1.0, 0.0, 0.0])


def test_the_pose_of_a_time_is_the_last_before_unless_one_is_as_good_as_there():
    stamps, poses = np.array([1.0, 2.0, 2.0, 3.0]), np.array([[1.0, 0, 0], [2, 0, 0], [4, 0, 0], [5, 0, 0]])
    found = last_before(stamps, poses, np.array([0.0, 1.9, 1.996, 2.0, 2.9, 3.5]))
    assert found[:, 0].tolist() == [1.0, 1.0, 3.0, 3.0, 3.0, 5.0]
    assert last_before(stamps[:1], poses[:1], np.array([9.0]))[0, 0] == 1.0

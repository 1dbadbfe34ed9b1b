"""Recordings as arrays."""

import numpy as np
import pytest
from recorded_logs import recording

from lidarium.mapping.files.npz_logs import read_npz_log, write_npz_log


def test_a_recording_is_read_as_it_was_written(tmp_path):
    log = recording()
    write_npz_log(tmp_path / "logs" / "run.npz", log)
    back = read_npz_log(tmp_path / "logs" / "run.npz")
    assert back.geometry.beams == 4
    assert back.geometry.field_of_view == pytest.approx(2.0)
    assert back.geometry.range_min == 0.1
    for name in (
        "stamps",
        "ranges",
        "odometry",
        "laser_pose",
        "corrected",
        "readings_stamps",
        "readings",
        "reading_of_scan",
    ):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name), err_msg=name)
    assert back.beam_interval_s == 1e-4
    assert back.geometry.range_max == 5.0


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("ranges", None, "no array ranges"),
        ("ranges", np.zeros(3), "ranges have shape"),
        ("stamp", np.zeros(5), "stamp has shape"),
        ("stamp", np.full(2, np.nan), "no scan that can be used"),
        ("pose_odom", np.zeros((3, 3)), "pose_odom has shape"),
        ("pose_odom", np.array([["a"] * 3] * 2), "no numbers"),
        ("angle_increment", -0.1, "want steps of more than 0"),
        ("angle_min", np.nan, "angle_min"),
        ("max_range", [1.0, 2.0], "max_range"),
        ("odometry_of_scan", np.array([0, 9]), "odometry_of_scan"),
    ],
)
def test_bad_arrays_are_named(tmp_path, key, value, word):
    write_npz_log(tmp_path / "run.npz", recording())
    with np.load(tmp_path / "run.npz") as archive:
        arrays = dict(archive)
    arrays.pop(key) if value is None else arrays.update({key: np.asarray(value)})
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(ValueError, match=word):
        read_npz_log(tmp_path / "bad.npz")


def test_what_is_no_npz_file_is_refused(tmp_path):
    (tmp_path / "run.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(ValueError, match="not an npz file"):
        read_npz_log(tmp_path / "run.npz")


def test_a_mounting_that_is_not_finite_is_named(tmp_path):
    np.savez(
        tmp_path / "log.npz",
        ranges=np.full((9, 36), 3.0),
        angle_min=-np.pi,
        angle_increment=np.pi / 18,
        laser_pose=[np.nan, 0.0, 0.0],
    )
    with pytest.raises(ValueError, match=r"log\.npz: laser_pose is \[nan, 0\.0, 0\.0\]; want x, y, theta, all finite"):
        read_npz_log(tmp_path / "log.npz")

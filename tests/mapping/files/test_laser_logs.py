"""Stamps that are wild, repeat or restart."""

import math

import numpy as np
import pytest
from recorded_logs import recording

from lidarium.mapping.files.beams import symmetric_scans
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import _continued, _order
from lidarium.mapping.files.npz_logs import read_npz_log
from lidarium.mapping.files.odometry_faults import _without_jumps


@pytest.mark.parametrize("wild", [2e9, -5.0, math.nan])
@pytest.mark.parametrize("at", [0, 7, 19])
def test_one_wild_stamp_costs_one_scan_at_most(wild, at):
    stamps = 100.0 + 0.5 * np.arange(20.0)
    stamps[at] = wild
    clock = _continued(stamps)
    assert clock.restarts == 0
    assert len(clock.kept) >= 19
    assert (np.diff(clock.stamps) >= 0.0).all()
    others = np.delete(np.arange(20), at)
    np.testing.assert_array_equal(clock.stamps[np.isin(clock.kept, others)], stamps[others])


def test_a_clock_that_restarts_is_continued():
    true = 0.5 * np.arange(60.0)
    stamps = true + 1000.0
    stamps[20:] -= 1009.0
    stamps[45:] -= 12.0
    clock = _continued(stamps)
    assert clock.restarts == 2
    np.testing.assert_allclose(clock.stamps - clock.stamps[0], true)


def _disordered():
    draws, stamps = np.random.default_rng(0), 100.0 + 0.5 * np.arange(60.0)
    swapped = np.arange(60)
    swapped[[20, 21, 40, 41]] = [21, 20, 41, 40]
    return {
        "drawn": stamps[draws.permutation(60)],
        "reversed": stamps[::-1],
        "late": stamps[swapped],
        "parts": np.concatenate([stamps[30:], stamps[:30]]),
    }


@pytest.mark.parametrize("how", _disordered())
def test_fine_stamps_out_of_order_are_sorted(how):
    stamps = _disordered()[how]
    order = _order(stamps)
    assert order is not None
    assert (np.diff(stamps[order]) > 0.0).all()


@pytest.mark.parametrize("second", [0.0, 0.1, 0.25, -7000.0, 40.0])
def test_scans_of_two_clocks_are_not_mixed(second):
    stamps = 100.0 + 0.5 * np.arange(60.0)
    assert _order(np.concatenate([stamps, stamps[:40] + second - (0.0 if second < 40.0 else 37.1)])) is None


def test_scans_of_a_file_without_order_are_those_of_one_in_order(tmp_path):
    count, draws = 40, np.random.default_rng(1)
    arrays = {
        "ranges": draws.uniform(1.0, 4.0, (count, 30)).astype(np.float32),
        "stamp": 50.0 + 0.2 * np.arange(count),
        "pose_odom": np.stack([0.1 * np.arange(count), np.zeros(count), np.zeros(count)], axis=1),
    }
    beams = {"angle_min": -1.0, "angle_increment": 2.0 / 29.0, "max_range": 5.0}
    mixed = draws.permutation(count)
    np.savez(tmp_path / "a.npz", **arrays, **beams)
    np.savez(tmp_path / "b.npz", **{name: table[mixed] for name, table in arrays.items()}, **beams)
    ordered, sorted_again = read_npz_log(tmp_path / "a.npz"), read_npz_log(tmp_path / "b.npz")
    np.testing.assert_array_equal(sorted_again.stamps, ordered.stamps)
    np.testing.assert_array_equal(sorted_again.ranges, ordered.ranges)
    np.testing.assert_array_equal(sorted_again.odometry, ordered.odometry)
    assert any("not in the order of time" in remark for remark in sorted_again.remarks)
    assert not ordered.remarks


def test_order_is_all_that_a_clock_without_faults_is_asked_for():
    stamps = np.array([3.0, 3.0, 3.5, 9.0, 4000.0])
    clock = _continued(stamps)
    np.testing.assert_array_equal(clock.stamps, stamps)
    assert clock.restarts == 0


def test_odometry_that_is_set_to_zero_goes_on(tmp_path):
    stamps = 0.5 * np.arange(100.0)
    true = np.stack([0.2 * np.arange(100.0), np.zeros(100), np.zeros(100)], axis=1)
    reset = true.copy()
    reset[60:, 0] -= reset[60, 0]
    mended, jumps = _without_jumps(reset, stamps)
    assert jumps == 1
    np.testing.assert_allclose(mended, true, atol=1e-9)
    for steady in (true, true * 10.0):
        unchanged, jumps = _without_jumps(steady, stamps)
        assert jumps == 0
        assert unchanged is steady


def test_files_that_are_not_there_are_named(tmp_path):
    for reader in (read_carmen_log, read_npz_log):
        with pytest.raises(FileNotFoundError, match=r"gone\.npz"):
            reader(tmp_path / "gone.npz")
        with pytest.raises(ValueError, match="is a folder"):
            reader(tmp_path)


def test_scans_that_look_to_one_side_gain_invalid_beams_on_the_other():
    ranges = np.array([[1.0, 2.0, 3.0]], np.float32)
    wide, geometry, axis, *_ = symmetric_scans(ranges, -math.pi / 2, math.pi / 3, (0.0, 5.0))
    np.testing.assert_array_equal(wide, [[1.0, 2.0, 3.0, np.nan]])
    assert geometry.angles == pytest.approx([-math.pi / 2, -math.pi / 6, math.pi / 6, math.pi / 2])
    assert axis == 0.0
    wide, *_ = symmetric_scans(ranges, -math.pi / 6, math.pi / 3, (0.0, 5.0))
    np.testing.assert_array_equal(wide, [[np.nan, 1.0, 2.0, 3.0]])


def test_a_full_circle_is_turned_so_that_it_begins_behind():
    ranges = np.arange(1.0, 5.0, dtype=np.float32)[None]
    wide, geometry, axis, *_ = symmetric_scans(ranges, 0.0, math.pi / 2, (0.0, 9.0))
    assert axis == 0.0
    assert geometry.is_full_circle
    assert wide[0].tolist() == [3.0, 4.0, 1.0, 2.0]
    assert geometry.angles[2] == pytest.approx(0.0)


def test_a_shorter_laser_sees_that_the_way_is_free():
    log = recording().limited(2.2, clears_without_return=True)
    np.testing.assert_array_equal(log.ranges, [[1.0, math.inf, math.nan, 2.0], [1.5, math.inf, math.inf, math.inf]])
    assert log.geometry.range_max == 2.2
    silent = recording().limited(9.0, clears_without_return=False)
    np.testing.assert_array_equal(silent.ranges, [[1.0, math.nan, math.nan, 2.0], [1.5, 2.5, 3.5, math.nan]])


def test_a_real_log_has_the_odometry_that_others_found_in_it(shared_data):
    folder = shared_data / "laser_logs"
    if not folder.is_dir():
        pytest.skip(f"no logs at {folder}")
    text, parsed = (
        read_carmen_log(folder / "carmen" / "intel-corrected.log.gz"),
        read_npz_log(folder / "npz" / "intel.npz"),
    )
    assert len(text.stamps) == 906
    assert np.abs(text.odometry - parsed.odometry)[:, :2].max() < 1e-6
    np.testing.assert_array_equal(text.ranges[0, :-1] < 9.0, parsed.ranges[0, :-1] < 9.0)


def _drawn_arrays(count):
    draws = np.random.default_rng(2)
    return {
        "ranges": draws.uniform(1.0, 4.0, (count, 30)).astype(np.float32),
        "stamp": 100.0 + 0.1 * np.arange(count),
        "pose_odom": np.column_stack([0.03 * np.arange(count), np.zeros(count), np.zeros(count)]),
        "angle_min": np.array(-1.5),
        "angle_increment": np.array(0.1),
    }


@pytest.mark.parametrize("how", ["parts that overlap", "every scan twice"])
def test_repeated_scans_are_left_out(how, tmp_path):
    arrays = _drawn_arrays(80)
    order = np.repeat(np.arange(80), 2) if how == "every scan twice" else np.append(np.arange(50), np.arange(30, 80))
    repeated = {name: each[order] if each.ndim else each for name, each in arrays.items()}
    np.savez(tmp_path / "once.npz", **arrays)
    np.savez(tmp_path / "again.npz", **repeated)
    once, again = (read_npz_log(tmp_path / f"{name}.npz") for name in ("once", "again"))
    np.testing.assert_array_equal(again.stamps, once.stamps)
    np.testing.assert_array_equal(again.ranges, once.ranges)
    np.testing.assert_array_equal(again.odometry, once.odometry)
    assert again.skipped == {"repeated scans": len(order) - 80}
    assert again.remarks == once.remarks


def test_scans_of_one_stamp_that_differ_are_no_repeats(tmp_path):
    arrays = _drawn_arrays(40)
    arrays["stamp"][1::2] = arrays["stamp"][::2]
    np.savez(tmp_path / "log.npz", **arrays)
    assert "repeated scans" not in read_npz_log(tmp_path / "log.npz").skipped


def test_scans_without_a_stamp_are_counted_apart(tmp_path):
    arrays = _drawn_arrays(40)
    arrays["stamp"][::5] = math.nan
    np.savez(tmp_path / "log.npz", **arrays)
    assert read_npz_log(tmp_path / "log.npz").skipped == {"scans without a stamp": 8}

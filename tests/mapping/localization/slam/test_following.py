"""A recorded run is followed from its first scan to its last."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, driven, odd_room

from lidarium.evaluation.metrics.poses import absolute_error
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.npz_logs import read_npz_log
from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.settings import SlamSettings
from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow

LASER = np.array([0.2, 0.05, 0.3])


@pytest.fixture(scope="module")
def run():
    return driven(odd_room(), [(1.0, 1.0), (3.0, 1.0), (3.0, 2.0)], noise=0.005)


def log_of(run):
    return LaserLog(
        stamps=np.array([one.time_s for one in run.sensings]),
        ranges=np.stack([one.ranges for one in run.sensings]),
        geometry=GEOMETRY,
        odometry=np.stack([one.odometry for one in run.sensings]),
    )


def test_poses_are_those_of_the_run_from_its_start(run):
    found = follow(log_of(run), SlamSettings())
    assert found.poses[0].tolist() == [0.0, 0.0, 0.0]
    assert np.abs(found.poses - run.truth)[:, :2].max() < 0.05
    assert found.online.shape == found.poses.shape == (len(run.sensings), 3)
    assert found.slam.counts.scans == len(run.sensings)


def test_poses_are_of_the_robot_wherever_its_laser_is(run):
    """The same scans are taken as those of a laser in the middle, and of one ahead and aside."""
    scans_alone = replace(log_of(run), odometry=None)
    middle = follow(scans_alone, SlamSettings()).poses
    robot = follow(replace(scans_alone, laser_pose=LASER), SlamSettings()).poses
    np.testing.assert_allclose(composed(robot, LASER), composed(LASER, middle), atol=1e-6)
    np.testing.assert_allclose(robot[0], 0.0, atol=1e-12)


def test_a_turn_of_which_odometry_knows_nothing_is_found_in_both_forms_of_a_log(shared_data):
    """CSAIL: scans a metre apart, headings by odometry up to 22 degrees wrong from one to the next."""
    folder = shared_data / "laser_logs"
    for log in (read_npz_log(folder / "npz/csail.npz"), read_carmen_log(folder / "carmen/csail-corrected.log.gz")):
        near = log.limited(30.0, clears_without_return=False)
        error = absolute_error(follow(near, LOG_SETTINGS).poses, near.corrected)
        assert error < 0.3


def test_scans_pass_by_the_watch_in_order_and_time_is_that_of_the_clock(run):
    seen, ticks = [], iter(range(10_000))

    def watch(numbers):
        for k in numbers:
            seen.append(k)
            yield k

    found = follow(log_of(run), SlamSettings(), watch, lambda: float(next(ticks)))
    assert seen == list(range(len(run.sensings)))
    assert (found.scan_s == 1.0).all()
    assert found.finish_s == 1.0


def test_a_log_without_odometry_is_followed_by_its_scans(run):
    found = follow(replace(log_of(run), odometry=None), SlamSettings())
    assert np.abs(found.poses - run.truth)[:, :2].max() < 0.1


def test_a_log_whose_odometry_is_unknown_for_a_while_is_followed_by_its_scans(run):
    log = log_of(run)
    odometry = log.odometry.copy()
    odometry[8:22] = np.nan
    found = follow(replace(log, odometry=odometry), SlamSettings())
    assert np.abs(found.poses - run.truth)[:, :2].max() < 0.1
    assert found.slam.counts.failures == 0

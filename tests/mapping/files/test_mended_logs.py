"""Logs whose headers, stamps or odometry are wrong in ways that other programs write them."""

import pytest

from lidarium.mapping.files.carmen_logs import read_carmen_log

LOGS = {
    "beam-counts-vary/spinning.log.gz": (401, 0.02),
    "flaser-geometry/fov270_param.log.gz": (401, 0.02),
    "lidar-360-rounded/circle.log.gz": (401, 0.02),
    "odometry-jump/reset.log.gz": (401, 0.05),
    "robotlaser-header/resolution_is_count.log.gz": (401, 0.02),
    "robotlaser-header/upside_down.log.gz": (401, 0.02),
    "wild-stamp/future.log.gz": (400, 0.02),
    "wild-stamp/clock_begins_anew.log.gz": (401, 0.02),
}


@pytest.mark.parametrize("name", LOGS)
def test_logs_of_other_programs_are_followed_over_all_their_scans(shared_cases, name):
    from lidarium.evaluation.metrics.poses import absolute_error
    from lidarium.mapping.files.trajectories import interpolated, read_tum
    from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow

    scans, error = LOGS[name]
    log = read_carmen_log(shared_cases / name).limited(8.0, clears_without_return=False)
    assert len(log.stamps) == scans
    stamps, true = read_tum(shared_cases / name.split("/")[0] / "truth.tum")
    poses = follow(log, LOG_SETTINGS).poses
    assert absolute_error(poses, interpolated(stamps, true, log.stamps)) < error

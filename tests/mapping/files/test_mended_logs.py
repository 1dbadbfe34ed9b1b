"""Logs and bags whose headers, stamps, mounting or odometry are wrong in ways that other programs write them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lidarium.mapping.files.log_files import read_log

LOGS = {
    "bag-beams-vary/first.mcap": (244, 0.01),
    "bag-beams-vary/length.mcap": (244, 0.01),
    "bag-beams-vary/step.mcap": (244, 0.01),
    "bag-forms/packed": (100, 0.01),
    "bag-forms/split": (100, 0.01),
    "bag-forms/sqlite": (100, 0.01),
    "bag-laser-mounting/chain.mcap": (244, 0.02),
    "bag-laser-mounting/plain.mcap": (244, 0.02),
    "bag-laser-mounting/upside_down.mcap": (244, 0.02),
    "bag-no-return-is-range-max/inf.mcap": (244, 0.02),
    "bag-no-return-is-range-max/range_max.mcap": (244, 0.02),
    "beam-counts-vary/spinning.log.gz": (401, 0.02),
    "flaser-geometry/fov270_param.log.gz": (401, 0.02),
    "lidar-360-rounded/circle.log.gz": (401, 0.02),
    "odometry-jump/reset.log.gz": (401, 0.05),
    "odometry-stops/silent_8s.log.gz": (366, 0.05),
    "odometry-stops/stops_at_half.log.gz": (366, 0.05),
    "odometry-stops/whole.log.gz": (366, 0.02),
    "robotlaser-header/resolution_is_count.log.gz": (401, 0.02),
    "robotlaser-header/upside_down.log.gz": (401, 0.02),
    "wild-stamp/future.log.gz": (400, 0.02),
    "wild-stamp/clock_begins_anew.log.gz": (401, 0.02),
}


@pytest.mark.parametrize("name", LOGS)
def test_logs_of_other_programs_are_read_whole_and_followed_over_all_their_way(shared_cases, name):
    from lidarium.evaluation.metrics.poses import absolute_error
    from lidarium.mapping.files.trajectories import interpolated, read_tum
    from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow

    scans, error = LOGS[name]
    log = read_log(shared_cases / name).limited(8.0, clears_without_return=False)
    assert len(log.stamps) == scans
    thinned = (array if array is None else array[::3] for array in (log.stamps, log.ranges, log.odometry))
    log = replace(log, **dict(zip(("stamps", "ranges", "odometry"), thinned, strict=True)))
    stamps, true = read_tum(shared_cases / name.split("/")[0] / "truth.tum")
    followed = follow(log, LOG_SETTINGS)
    known = interpolated(stamps, true, log.stamps)
    assert absolute_error(followed.poses, known) < error
    turns = (followed.poses - followed.poses[0] - known + known[0])[:, 2]
    assert np.abs(np.remainder(turns + math.pi, 2.0 * math.pi) - math.pi).max() < math.radians(1.0)
    assert not followed.slam.doubts.stretches


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bag-laser-mounting/upside_down.mcap", "the laser hangs upside down"),
        ("odometry-jump/reset.log.gz", "odometry jumps 1 times as no robot moves"),
        ("odometry-stops/stops_at_half.log.gz", "from 1036.600 to 1073.000 s"),
        ("robotlaser-header/resolution_is_count.log.gz", "are assumed"),
        ("wild-stamp/clock_begins_anew.log.gz", "clock"),
    ],
)
def test_what_is_mended_is_told(shared_cases, name, words):
    assert any(words in remark for remark in read_log(shared_cases / name).remarks)

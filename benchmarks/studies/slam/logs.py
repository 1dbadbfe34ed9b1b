"""How well and how fast SLAM follows recorded logs of laser scans."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.metrics.poses import absolute_error, best_transform, moved, relative_error
from lidarium.evaluation.metrics.relations import RelationErrors, log_relation_errors, read_relations
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.npz_logs import read_npz_log
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.slam.following import Followed
from lidarium.mapping.localization.slam.localizer import Slam

RELATIONS = {"freiburg-079": "fr079", "intel": "intel"}
OTHERS = ("acapulco", "aces", "belgioioso", "csail", "edmonton", "infinite-corridor", "orebro")
RANGE_M = 30.0


def read(data: Path, name: str) -> tuple[LaserLog, float]:
    """Return a log, and by how much the clock of its relations is ahead [s]."""
    parsed = read_npz_log(data / "npz" / f"{name}.npz")
    if name not in RELATIONS:
        return parsed.limited(RANGE_M, clears_without_return=False), 0.0
    log = read_carmen_log(data / "carmen" / f"{name}-corrected.log.gz")
    return log.limited(RANGE_M, clears_without_return=False), float(parsed.stamps[0] - log.stamps[0])


def relation_cells(data: Path, name: str, log: LaserLog, poses: NDArray[np.float64], shift: float) -> Iterator[str]:
    """Yield the errors of the trajectory and of the log's own corrected poses.

    Both come by both rules for the pose of a relation.
    """
    relations = read_relations(data / "relations" / f"{RELATIONS[name]}.relations.gz")
    assert log.corrected is not None
    # The corrected poses are the laser's, as if it stood in the middle of the robot.
    corrected = composed(log.corrected, relative(log.laser_pose, np.zeros(3)))
    for which in ("before", "between"):
        for found in (poses, corrected, log.corrected):
            yield _errors(log_relation_errors(log, found, relations, shift, which))


def _errors(errors: RelationErrors) -> str:
    translation, rotation = (
        (errors.translation_m, errors.translation_sd_m),
        (errors.rotation_rad, errors.rotation_sd_rad),
    )
    return "{:.4f} ± {:.4f} m, {:.3f} ± {:.3f}°".format(*translation, *(math.degrees(angle) for angle in rotation))


def log_row(name: str, log: LaserLog, followed: Followed[Slam]) -> str:
    """Return a log's line: size, times, closures, agreement with the corrected poses."""
    milliseconds, counts = 1e3 * followed.scan_s, followed.slam.counts
    data_s, cpu_s = float(log.stamps[-1] - log.stamps[0]), float(followed.scan_s.sum() + followed.finish_s)
    steps = np.diff(followed.poses[:, :2], axis=0)
    is_numbered = any("numbered" in reason for reason in log.skipped)
    cells = [
        name,
        f"{len(log.stamps):,}",
        f"{np.hypot(steps[:, 0], steps[:, 1]).sum():.0f}",
        "no clock" if is_numbered else f"{cpu_s / data_s:.4f}",
        *(f"{np.percentile(milliseconds, percent):.2f}" for percent in (50, 95)),
        f"{counts.closures} in {counts.corrections}",
        str(counts.failures),
    ]
    if log.corrected is not None:
        robot = composed(log.corrected, relative(log.laser_pose, np.zeros(3)))
        gaps = moved(followed.poses, best_transform(followed.poses, robot)) - robot
        step = relative_error(followed.poses, robot, 1)
        assert step is not None
        cells += [
            f"{absolute_error(followed.poses, robot):.3f}",
            f"{np.hypot(gaps[:, 0], gaps[:, 1]).max():.2f}",
            f"{step[0]:.3f}",
        ]
    return f"| {' | '.join(cells)} |"

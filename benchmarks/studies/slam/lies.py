"""Logs that lie: lines of odometry removed, turns that odometry does not know."""

import gzip
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.studies.shared.study import Task
from lidarium.benchmarks.studies.slam.logs import RANGE_M
from lidarium.evaluation.metrics.poses import absolute_error
from lidarium.evaluation.report.tables import markdown_table
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow

LOGS = ("acapulco", "aces", "csail", "edmonton", "infinite-corridor", "intel")
"""Logs with odometry of their own and poses to compare with."""

REMOVED, TURN = "every tenth ODOM line removed", "a turn hidden"
TURNS = 4
"""Turns that are hidden in each log, one at a time."""

TURN_DEG, WITHIN_M, MOST_SCANS = (60.0, 90.0), 1.0, 25
"""A turn: by how much, how far the robot has gone meanwhile, and of how many scans at most."""

MOST_RATIO = 1.5
"""Greatest error over that of the whole log."""


@dataclass(frozen=True, slots=True)
class Lie(Task):
    """A log and what is wrong with it."""

    log: str
    what: str
    number: int = 0


def lies() -> list[Lie]:
    """Return all logs with all that is made wrong with them."""
    return [lie for log in LOGS for lie in (Lie(log, REMOVED), *(Lie(log, TURN, number) for number in range(TURNS)))]


def measure(logs: Path | None, lie: Lie) -> dict[str, Any]:
    """Follow a log that lies; return its error besides that of the whole one, and what is said of it."""
    assert logs is not None
    path = logs / "carmen" / f"{lie.log}-corrected.log.gz"
    whole = _error_of_whole(path)
    log: LaserLog | None
    lied_at_s: float | None = None
    if lie.what == TURN:
        log, lied_at_s = _with_hidden_turn(_read(path), lie.number)
    else:
        log = _without_lines(path)
    if log is None:
        return {"log": lie.log, "what": lie.what, "ate_m": None}
    followed = follow(log, LOG_SETTINGS)
    doubts = followed.slam.doubts.stretches
    return {
        "log": lie.log,
        "what": lie.what,
        "whole_m": round(whole, 4),
        "ate_m": round(_error(log, followed.poses), 4),
        "recoveries": followed.slam.counts.recoveries,
        "is_named": lied_at_s is not None and any(d.start_s <= lied_at_s <= d.end_s for d in doubts),
        "doubtful_scans": sum(doubt.scans for doubt in doubts),
        "scans": len(log.stamps),
    }


def _read(path: Path) -> LaserLog:
    return read_carmen_log(path).limited(RANGE_M, clears_without_return=False)


@lru_cache
def _error_of_whole(path: Path) -> float:
    log = _read(path)
    return _error(log, follow(log, LOG_SETTINGS).poses)


def _error(log: LaserLog, poses: NDArray[np.float64]) -> float:
    assert log.corrected is not None
    return absolute_error(poses, composed(log.corrected, relative(log.laser_pose, np.zeros(3))))


def _without_lines(path: Path) -> LaserLog:
    """Return a log without every tenth of its lines of odometry."""
    with gzip.open(path, "rt", encoding="utf-8", errors="replace") as file:
        lines = file.readlines()
    odometry = [number for number, line in enumerate(lines) if line.startswith("ODOM")]
    removed = set(odometry[9::10])
    with TemporaryDirectory() as folder:
        left = Path(folder) / "log.log"
        left.write_text("".join(line for number, line in enumerate(lines) if number not in removed), "utf-8")
        return _read(left)


def _with_hidden_turn(log: LaserLog, number: int) -> tuple[LaserLog | None, float | None]:
    """Return a log without the scans of a turn, which odometry does not know, and when it ends [s].

    None if there is no such turn.
    """
    odometry = log.odometry
    assert odometry is not None
    motions = relative(odometry[:-1], odometry[1:])
    turned = np.concatenate([[0.0], np.cumsum(motions[:, 2])])
    for first in np.random.default_rng(number).permutation(len(odometry) - 40) + 5:
        for last in range(first + 1, min(first + MOST_SCANS, len(odometry) - 1)):
            turn = abs(math.degrees(turned[last] - turned[first]))
            away = relative(odometry[first], odometry[last])
            if TURN_DEG[0] <= turn <= TURN_DEG[1] and np.hypot(away[0], away[1]) < WITHIN_M:
                return _hidden(log, motions, int(first), last), float(log.stamps[last])
    return None, None


def _hidden(log: LaserLog, motions: NDArray[np.float64], first: int, last: int) -> LaserLog:
    """Return a log without the scans between two, whose motion odometry does not know."""
    assert log.odometry is not None
    kept = np.r_[0 : first + 1, last : len(log.stamps)]
    poses = [log.odometry[0]]
    for before, here in itertools.pairwise(kept.tolist()):
        poses.append(composed(poses[-1], motions[before]) if here - before == 1 else poses[-1])
    return replace(
        log,
        stamps=log.stamps[kept],
        ranges=log.ranges[kept],
        odometry=np.array(poses),
        corrected=None if log.corrected is None else log.corrected[kept],
        readings_stamps=np.zeros(0),
        readings=np.zeros((0, 3)),
        reading_of_scan=np.zeros(0, np.int64),
    )


def is_honest(line: dict[str, Any]) -> bool:
    """Whether an error is hardly larger than that of the whole log, or the lie was named as doubtful."""
    return bool(line["ate_m"] <= MOST_RATIO * line["whole_m"] or line["is_named"])


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return a line for each log and each kind of lie."""
    header = (
        "log",
        "what is wrong",
        "ATE of the whole, m",
        "ATE, m",
        "within 1.5 x or named",
        "recovered",
        "doubtful scans",
    )
    rows = []
    for name in LOGS:
        for what in (REMOVED, TURN):
            own = [line for line in lines if (line["log"], line["what"]) == (name, what)]
            own = [line for line in own if line["ate_m"] is not None]
            if own:
                within = [is_honest(line) for line in own]
                rows.append(
                    [
                        name,
                        what,
                        f"{own[0]['whole_m']:.3f}",
                        ", ".join(f"{line['ate_m']:.3f}" for line in own),
                        f"{sum(within)} of {len(own)}",
                        ", ".join(str(line["recoveries"]) for line in own),
                        ", ".join(f"{line['doubtful_scans']} of {line['scans']:,}" for line in own),
                    ]
                )
    return markdown_table(header, rows)

"""How well and how fast SLAM is on recorded logs and on a simulated robot.

One core; CPU time of the scans alone, without reading the log. All logs are followed with the same settings,
those of `lidarium slam`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.benchmarks.studies.slam import lies
from lidarium.benchmarks.studies.slam.logs import OTHERS, RELATIONS, log_row, read, relation_cells
from lidarium.benchmarks.studies.slam.robot import Robot, measured_robot, robot_lines
from lidarium.mapping.localization.slam.following import LOG_SETTINGS, follow

FLOOR, HORIZON_S = "apartment", 900.0
"""Floor of the simulated robot, and how long it explores at most [s]."""

LOGS_FOLDER, LOGS_FILE, ROBOT_FILE = "laser_logs", "logs.jsonl", "robot.jsonl"
LIES_FILE = "lies.jsonl"
WARMED_BY = "aces"
"""The log that is followed before any is measured, so that kernels are compiled."""

RELATIONS_HEADER = (
    "log",
    "lidarium",
    "corrected poses, as the robot's",
    "corrected poses, as they stand",
    "lidarium, between scans",
    "corrected, as the robot's, between scans",
    "corrected, as they stand, between scans",
)
SHOWN = 4
"""Columns of the relations that are on the page; the others are in the file."""

LOGS_HEADER = (
    "log",
    "scans",
    "path, m",
    "CPU time / data time",
    "ms per scan, p50",
    "p95",
    "closures",
    "failed matches",
    "agreement, m",
    "most, m",
    "from scan to scan, m",
)

PAGE = """# SLAM

One core. All logs are followed with the settings of `lidarium slam` (ranges to 30 m, cells of 5 cm, every scan that
moved by 2 cm or 1 degree is matched). Odometry is the sum of the motions between the logs' ODOM lines; no pose is
derived from the corrected poses in them.

## Relations

Mean absolute errors ± standard deviations against the hand-checked relations of Kuemmerle et al. (2009), as
`translation, rotation`. Cartographer's are 0.0452 m, 0.538° on Freiburg 79 and 0.0229 m, 0.453° on Intel,
Graph Mapping's 0.056 m, 0.6° and 0.031 m, 1.3° (Hess et al., ICRA 2016), on the original logs with all
scans and stamps.

{relations}

{all_relations}

The logs are output of GridFastSLAM: a scan carries the stamp of the odometry line before it. The stamps of Intel's
relations are those of odometry lines; Freiburg's relations follow a stamp of the log by 0 to 0.16 s. So the pose
at a relation's time is taken at the odometry line with that stamp, or else the last one before, carried there from
the scans around by odometry; of lines with one and the same stamp, the mean is taken. The file also has errors
*between scans*, by interpolation between the scans' stamps, which moves a turning robot by several degrees.
Freiburg's log says that the laser is 0.04 m behind the middle of the robot (`robot_frontlaser_offset`); relations
are between poses of the robot. GridFastSLAM ignored that, so its poses are given both ways.

These rules fit best on these very files, to the corrected poses as well; offsets of the laser from -0.08 to 0.12 m
have their least error at the log's own 0.04 m. Settings were chosen on the same two logs and the agreement with the
others, so the figures are not those of logs never seen.

## Logs

{logs}

*Agreement* is the root mean square distance from the corrected poses after the best rigid motion, *most* the
largest, *from scan to scan* that of single motions. The corrected poses are an estimate, not the truth.
Infinite-corridor, belgioioso and orebro have no usable stamps, so closures act after one scan; orebro has no
odometry, and scans up to a metre and 40 degrees apart.

## Logs that lie

Every tenth line of odometry is removed; or scans during one turn of 60 to 90 degrees are left out, without odometry
of it ({turns} turns of each log, one at a time). Of {count} such logs {honest} end within 1.5 x the error of the
whole log, or name the lie as doubtful. *Recovered* scans were found in another direction than odometry said;
*doubtful* are these, and those that no map is sure of.

{lies}

## A robot

{robot}
"""


@dataclass(frozen=True, slots=True)
class Followed(Task):
    """A log that is followed, or a floor that a robot explores."""

    name: str


def work(folder: Path, data: Path | None, every: int, _workers: int) -> Progress:
    """Follow every N-th log, none without data, and a simulated robot.

    All is done in this process, as scans are timed.
    """
    logs = None if data is None else Path(data) / LOGS_FOLDER
    tasks = [] if logs is None else [Followed(name) for name in (*RELATIONS, *OTHERS)][::every]
    yield from do_missing(folder / LOGS_FILE, "logs", tasks, partial(_follow_log, logs), 1)
    lying = [] if logs is None else lies.lies()[::every]
    yield from do_missing(folder / LIES_FILE, "logs that lie", lying, partial(lies.measure, logs), 1)
    yield from do_missing(folder / ROBOT_FILE, "robot", [Followed(FLOOR)], partial(_follow_robot, logs), 1)


def _follow_log(logs: Path | None, task: Followed) -> dict[str, Any]:
    """Return the lines of a log; relations only if there are some."""
    assert logs is not None
    _warm_up(logs)
    log, shift = read(logs, task.key)
    followed = follow(log, LOG_SETTINGS)
    cells = []
    if task.key in RELATIONS:
        cells = list(relation_cells(logs, task.key, log, followed.poses, shift))
    return {"row": log_row(task.key, log, followed), "relations": cells}


def _follow_robot(logs: Path | None, task: Followed) -> dict[str, Any]:
    """Return the figures of a robot."""
    _warm_up(logs)
    robot = measured_robot(task.key, HORIZON_S)
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in asdict(robot).items()}


@lru_cache
def _warm_up(logs: Path | None) -> None:
    """Let kernels be compiled before anything is measured."""
    if logs is None:
        measured_robot(FLOOR, HORIZON_S)
    else:
        follow(read(logs, WARMED_BY)[0], LOG_SETTINGS)


def header_rows(titles: Sequence[str]) -> str:
    """Return the first two lines of a table."""
    return f"| {' | '.join(titles)} |\n|{'---|' * len(titles)}"


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    return "\n".join([header_rows(titles), *(f"| {' | '.join(row)} |" for row in rows)])


def page(folder: Path) -> str:
    """Return the results as markdown."""
    logs = kept_lines(folder / LOGS_FILE)
    [line] = kept_lines(folder / ROBOT_FILE)
    lying = [each for each in kept_lines(folder / LIES_FILE) if each["ate_m"] is not None]
    match, closure, correction = (
        np.array(line[name], np.float64) for name in ("match_ms", "closure_ms", "correction_ms")
    )
    robot = Robot(match, closure, correction, line["error_m"], line["odometry_m"], line["path_m"])
    relations = [(log["key"], *log["relations"]) for log in logs if log["relations"]]
    return PAGE.format(
        relations=table(RELATIONS_HEADER[:SHOWN], [row[:SHOWN] for row in relations]),
        all_relations=in_file(table(RELATIONS_HEADER, relations)),
        logs=in_file("\n".join([header_rows(LOGS_HEADER), *(log["row"] for log in logs)])),
        turns=lies.TURNS,
        count=len(lying),
        honest=sum(map(lies.is_honest, lying)),
        lies=in_file(lies.table(lying)),
        robot="\n".join(robot_lines(robot, FLOOR)),
    )


STUDY = Study(page, work=work, quick=11)

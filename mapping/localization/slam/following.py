"""A recorded run followed by SLAM from its first scan to its last."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.localizer import KeyScans, Localizer, Sensing
from lidarium.mapping.localization.settings import (
    ClosureSettings,
    CompassSettings,
    GraphSettings,
    MatchingSettings,
    SlamSettings,
    SubmapSettings,
)
from lidarium.mapping.localization.slam.localizer import Slam
from lidarium.mapping.localization.slam.verdict import reasons_to_doubt

LOG_SETTINGS = SlamSettings(
    matching=MatchingSettings(
        distance_m=0.02,
        angle=math.radians(1.0),
        spacing_m=0.08,
        points=250,
        independent_share=1.0,
        deviation=0.25,
        surface_m=0.0,
        unseen=0.5,
        search_turn=0.3,
    ),
    submaps=SubmapSettings(resolution=0.05, path_m=8.0, behind_share=0.0),
    closures=ClosureSettings(least_overlap=0.6, confirmed_beyond_m=0.4, doubts_one_map=False, agree_m=0.3),
    graph=GraphSettings(deviation_m=0.01, deviation_per_metre=0.02, deviation_angle=math.radians(0.3)),
    compass=CompassSettings(deviation_angle=math.radians(0.3), drift=0.2),
)
"""SLAM settings for recorded logs, in which nearly every scan is matched.

Odometry between scans is often worse than in a robot, and time is plenty. Lasers of logs reach far: a local map
of a shorter path holds enough, and more of the local maps serve to recognise places. Few returns then hold as
much information as many, and headings drift less. Where scans are a metre apart, much of each is new, which
must not outweigh what agrees; headings between them are less certain, and odometry may have missed a turn.
Normals are estimated best from the nearest two returns. Built walls deviate more from each other than drawn
walls. Over the paths of logs, robots err by more than walls are thick.
"""


class _LogLocalizer(Localizer, Protocol):
    """A localizer whose past poses are corrected by nodes."""

    @property
    def place(self) -> tuple[int, NDArray[np.float64]]:
        """The last node, and the laser's pose x, y, theta (3,) in its frame."""
        ...

    @property
    def nodes(self) -> NDArray[np.float64]:
        """Poses of all nodes as they are now believed, shape (nodes, 3) [m, rad]."""
        ...

    @property
    def key_scans(self) -> KeyScans:
        """The scans that were mapped, at their poses as believed now."""
        ...

    def finish(self) -> None:
        """Let all closures act that were found so far."""
        ...


LocalizerOfLog = TypeVar("LocalizerOfLog", bound=_LogLocalizer)


@dataclass(frozen=True, eq=False)
class Followed(Generic[LocalizerOfLog]):
    """Result of a log.

    Attributes
    ----------
    slam : Slam or SplineTracker
        The localizer at the end: its map, its graph, its counts.
    poses : (scans, 3) float64
        Pose of the robot at each scan, as believed at the end, in the frame of the map [m, rad]. The first was
        (0, 0, 0) at its time; matched again with the map around it, it may be some millimetres off.
    online : (scans, 3) float64
        The same as was believed at that time.
    scan_s : (scans,) float64
        CPU time of each scan [s].
    finish_s : float
        CPU time after the last one [s].
    reasons_to_doubt : tuple of str
        Why the map is probably wrong; empty if nothing says so.
    """

    slam: LocalizerOfLog
    poses: NDArray[np.float64]
    online: NDArray[np.float64]
    scan_s: NDArray[np.float64]
    finish_s: float
    reasons_to_doubt: tuple[str, ...] = ()


def follow(
    log: LaserLog,
    settings: SlamSettings,
    watch: Callable[[Iterable[int]], Iterable[int]] = iter,
    clock: Callable[[], float] = time.process_time,
) -> Followed[Slam]:
    """Run SLAM over a log.

    Parameters
    ----------
    log : LaserLog
        The log.
    settings : SlamSettings
        How; whether there is odometry and how fast the beams turn is in the log.
    watch : callable
        Passes the scans' numbers on and may print how many there were.
    clock : callable
        CPU time [s].
    """
    interval = (log.beam_interval_s or settings.matching.beam_interval_s) if log.is_in_time else 0.0
    matching = replace(settings.matching, beam_interval_s=interval)
    slam = Slam(
        replace(settings, matching=matching, uses_odometry=settings.uses_odometry and log.odometry is not None),
        log.geometry,
    )
    followed = follow_with(slam, log, watch, clock)
    reasons = reasons_to_doubt(
        followed.poses,
        log.odometry if settings.uses_odometry else None,
        sum(doubt.scans for doubt in slam.doubts.stretches),
        slam.counts.matches + slam.counts.failures,
        slam.counts.restarts,
    )
    return replace(followed, reasons_to_doubt=tuple(reasons))


def follow_with(
    slam: LocalizerOfLog,
    log: LaserLog,
    watch: Callable[[Iterable[int]], Iterable[int]] = iter,
    clock: Callable[[], float] = time.process_time,
    seed: int = 0,
) -> Followed[LocalizerOfLog]:
    """Run a localizer of the log's laser over a log, with draws from ``seed``; see `follow`."""
    slam.reset(log.laser_pose, seed)
    scans = len(log.stamps)
    odometry = np.zeros((scans, 3)) if log.odometry is None else composed(log.odometry, log.laser_pose)
    numbers, positions = np.zeros(scans, np.int64), np.zeros((scans, 3))
    online, scan_s = np.zeros((scans, 3)), np.zeros(scans)
    for k in watch(range(scans)):
        began = clock()
        online[k] = slam.localize(Sensing(float(log.stamps[k]), odometry[k], log.ranges[k]))
        scan_s[k] = clock() - began
        numbers[k], positions[k] = slam.place
    began = clock()
    slam.finish()
    finish_s = clock() - began
    laser = composed(slam.nodes[numbers], positions)
    poses = _of_robot(laser, log.laser_pose)
    return Followed(slam, poses, _of_robot(online, log.laser_pose), scan_s, finish_s)


def run_slam(log: LaserLog, settings: SlamSettings | None = None, range_m: float = 30.0) -> Followed[Slam]:
    """Make a map and a trajectory of a recorded log, as the command ``lidarium slam`` does.

    Parameters
    ----------
    log : LaserLog
        The log, such as from `read_log`.
    settings : SlamSettings, optional
        Settings of SLAM; by default those for recorded logs, with map cells of 0.05 m.
    range_m : float, optional
        Maximum range that is used [m], 30 by default. Beams without return do not clear the map.

    Returns
    -------
    Followed
        ``poses`` (scans, 3) of the robot in the frame of the first scan [m, rad], ``slam``, with its map, and
        ``reasons_to_doubt``: why the map is probably wrong, empty if nothing says so.

    Raises
    ------
    ValueError
        If no scan has a return within the range.

    Examples
    --------
    >>> import lidarium, numpy as np, tempfile
    >>> folder = tempfile.mkdtemp()
    >>> np.savez(f"{folder}/log.npz", ranges=np.full((9, 360), 3.0), angle_min=-np.pi,
    ...          angle_increment=np.pi / 180, max_range=10.0)
    >>> lidarium.run_slam(lidarium.read_log(f"{folder}/log.npz")).poses.shape
    (9, 3)
    """
    followed = follow(log.limited(range_m, False), settings or LOG_SETTINGS)
    if not len(followed.slam.key_scans.poses):
        raise ValueError(f"the log holds no scan with a return within {range_m} m; want a larger range_m")
    return followed


def _of_robot(laser: NDArray[np.float64], laser_pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the robot's poses, given the laser's."""
    return composed(laser, relative(laser_pose, np.zeros(3)))

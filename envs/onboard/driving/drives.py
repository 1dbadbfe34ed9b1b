"""The state of the robots' drives, in arrays over all rows.

It includes the questions that kernels and others ask of it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.path_following import (
    ARRIVED,
    BLOCKED,
    DRIVING,
    IDLE,
    MAX_POINTS,
    Courses,
    follow_paths,
)
from lidarium.envs.onboard.driving.safety_stop import Bodies, Sensed
from lidarium.envs.onboard.radio.messages import DriveState
from lidarium.mapping.kernels.compilation import Array, kernel

STATE_IDLE, STATE_DRIVING, STATE_ARRIVED, STATE_BLOCKED, STATE_NO_PATH, STATE_GIVING_WAY = range(6)
"""Numbers of the members of ``DriveState``, in its order."""

DRIVE_STATES = tuple(DriveState)
"""``DriveState`` by number."""


class Drives(NamedTuple):
    """The drives of all robots; row = episode * robots + robot.

    Attributes
    ----------
    is_ordered : (rows,) bool
        Whether the robot has a target.
    targets, target_headings : (rows, 2), (rows,) float64
        The target in the robot's map frame [m], and the heading to turn to there [rad], nan for any.
    has_path : (rows,) bool
        Whether there is a path to drive.
    is_given : (rows,) bool
        Whether the path was given: if so, it is followed unchanged and not planned.
    paths, room : (rows, points, 2), (rows, points) float64
        Points x, y in the frame of the believed pose [m], and the room around the body on the piece that
        leads to each [m].
    cells : (rows, points, 2) int64
        The cells (row, column) of the points.
    counts, places : (rows,) int64
        Number of points, and the one that the robot drives to now.
    headings : (rows,) float64
        Wanted heading at the end of the path [rad], nan for any.
    states, stood, backing : (rows,) int64
        State of the drive and its counters, see ``follow_paths``.
    passing : (rows,) int64
        The row that a robot has moved aside for, -1 if it has not.
    stations : (rows, 2) float64
        Position of a robot that moved aside, while it was in the way [m].
    since : (rows,) int64
        The step at which it moved aside.
    """

    is_ordered: NDArray[np.bool_]
    targets: NDArray[np.float64]
    target_headings: NDArray[np.float64]
    has_path: NDArray[np.bool_]
    is_given: NDArray[np.bool_]
    paths: NDArray[np.float64]
    room: NDArray[np.float64]
    cells: NDArray[np.int64]
    counts: NDArray[np.int64]
    places: NDArray[np.int64]
    headings: NDArray[np.float64]
    states: NDArray[np.int64]
    stood: NDArray[np.int64]
    backing: NDArray[np.int64]
    passing: NDArray[np.int64]
    stations: NDArray[np.float64]
    since: NDArray[np.int64]


class Following(NamedTuple):
    """Arrays for following the paths of a team.

    Attributes
    ----------
    unit_vectors : (robots, 2, beams) float64
        Directions of the beams of each robot.
    radii : (robots,) float64
        Radius of the bodies [m].
    limits : (4,) float64
        Cruise speed, greatest turn rate, braking and length of a step [m/s, rad/s, m/s2, s].
    knows_teammates : bool
        Whether all teammates' poses are known at once.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        If not all poses are known: from which robots each heard lately, and their poses then [m, rad].
    present : (robots,) uint8
        Which robots are bodies to keep clear of.
    foresight : (K,) float64
        Times at which others are predicted [s].
    safety : (rows, 11) float64
        Gaps to people in sight, and time lost by yielding (``kernels.arrays``).
    """

    unit_vectors: NDArray[np.float64]
    radii: NDArray[np.float64]
    limits: NDArray[np.float64]
    knows_teammates: bool
    contact: NDArray[np.uint8]
    heard: NDArray[np.float64]
    present: NDArray[np.uint8]
    foresight: NDArray[np.float64]
    safety: NDArray[np.float64]


def no_drives(rows: int) -> Drives:
    """Return the drives of robots that have no target."""
    return Drives(
        is_ordered=np.zeros(rows, np.bool_),
        targets=np.zeros((rows, 2)),
        target_headings=np.full(rows, np.nan),
        has_path=np.zeros(rows, np.bool_),
        is_given=np.zeros(rows, np.bool_),
        paths=np.zeros((rows, MAX_POINTS, 2)),
        room=np.zeros((rows, MAX_POINTS)),
        cells=np.zeros((rows, MAX_POINTS, 2), np.int64),
        counts=np.zeros(rows, np.int64),
        places=np.zeros(rows, np.int64),
        headings=np.full(rows, np.nan),
        states=np.full(rows, IDLE, np.int64),
        stood=np.zeros(rows, np.int64),
        backing=np.zeros(rows, np.int64),
        passing=np.full(rows, -1, np.int64),
        stations=np.zeros((rows, 2)),
        since=np.zeros(rows, np.int64),
    )


@kernel(nrt=False)
def drop_path(drives: Drives, row: int) -> None:
    """Forget the path of a robot, which then stops (kernel)."""
    drives.has_path[row], drives.states[row], drives.stood[row], drives.counts[row] = False, IDLE, 0, 0


@kernel(nrt=False)
def drive_state(drives: Drives, row: int) -> int:
    """Return the number of the drive state of a robot (kernel)."""
    if drives.passing[row] >= 0:
        return STATE_GIVING_WAY
    if drives.is_ordered[row] and not drives.has_path[row]:
        return STATE_NO_PATH
    state = drives.states[row]
    if state == DRIVING:
        return STATE_DRIVING
    if state == ARRIVED:
        return STATE_ARRIVED
    return STATE_BLOCKED if state == BLOCKED else STATE_IDLE


@kernel
def drive_states(drives: Drives) -> NDArray[np.int8]:
    """Return the numbers of the drive states of all robots, (rows,) int8 (kernel)."""
    numbers = np.empty(len(drives.states), np.int8)
    for row in range(len(numbers)):
        numbers[row] = drive_state(drives, row)
    return numbers


@kernel(nrt=False)
def is_done(drives: Drives, row: int) -> bool:
    """Whether a robot with a target waits for its next order (kernel)."""
    is_at_rest = drives.states[row] != DRIVING and drives.states[row] != BLOCKED
    return bool(drives.is_ordered[row] and drives.passing[row] < 0 and is_at_rest)


@kernel(nrt=False)
def mark_waiting(drives: Drives, first: int, last: int, waiting: Array) -> None:
    """Note in ``waiting`` which rows wait for their next order (kernel).

    ``waiting`` is (rows,) bool; the rows are ``first`` to ``last``.
    """
    for row in range(first, last):
        waiting[row] = is_done(drives, row)


@kernel(nrt=False)
def any_newly_done(drives: Drives, first: int, last: int, live: Array, waiting: Array) -> bool:
    """Whether a live robot newly waits for its next order (kernel).

    It is of the rows ``first`` to ``last`` and did not wait at ``mark_waiting``.
    """
    newly_done = 0
    for row in range(first, last):
        newly_done += live[row] and not waiting[row] and is_done(drives, row)
    return newly_done > 0


@kernel(nrt=False)
def follow_team(
    drives: Drives,
    following: Following,
    first: int,
    last: int,
    believed: Array,
    velocities: Array,
    ranges: Array,
    scanned: Array,
    commands: Array,
) -> None:
    """Give each robot of a team the speed and turn rate to follow its path.

    The rows are ``first`` to ``last`` (kernel).
    """
    follow_paths(
        Sensed(
            believed[first:last],
            velocities[first:last],
            ranges[first:last],
            scanned[first:last],
            following.contact[first:last],
            following.heard[first:last],
            following.safety[first:last],
        ),
        Courses(
            drives.paths[first:last],
            drives.room[first:last],
            drives.counts[first:last],
            drives.places[first:last],
            drives.headings[first:last],
            drives.states[first:last],
            drives.stood[first:last],
            drives.backing[first:last],
        ),
        Bodies(
            following.unit_vectors,
            following.radii,
            following.limits,
            following.knows_teammates,
            following.present,
            following.foresight,
        ),
        commands[first:last],
    )


@kernel(nrt=False)
def follow_teams(
    drives: Drives,
    following: Following,
    believed: Array,
    velocities: Array,
    ranges: Array,
    scanned: Array,
    commands: Array,
) -> None:
    """Give the robots of all teams the speed and turn rate to follow paths.

    Each follows its own path (kernel).
    """
    robots = len(following.radii)
    for first in range(0, len(believed), robots):
        follow_team(drives, following, first, first + robots, believed, velocities, ranges, scanned, commands)

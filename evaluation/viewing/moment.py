"""The state of a run at one time for a page, without maps: bodies, scans, paths, plans, boxes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.depth.point_cloud import point_cloud
from lidarium.envs.simulation.people.crowd import Crowd, crowd_of
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.truth.beliefs import believed_on_floor
from lidarium.mapping.geometry.rigid import Transform, relative

MOST_TRAIL, MOST_BEAMS, MOST_POINTS = 1500, 360, 6000
"""Maximum number of points of a driven path, of a scan, and of a depth image's cloud."""

NO_POINTS = np.zeros((0, 2))
NO_CLOUD = np.zeros((0, 3), np.float32)
NO_BOXES = np.zeros((0, 2, 3))


@dataclass(frozen=True, slots=True, eq=False)
class RobotMoment:
    """One robot at one time.

    Attributes
    ----------
    pose, believed : (3,) float64
        x, y, theta, true and as it believes, in the floor's frame [m, rad].
    attitude : (3,) float64
        Height above the ground, roll, pitch [m, rad].
    has_ended : bool
        Whether it has left the episode.
    laser : (3,) float64
        Position of its laser, in the floor's frame [m].
    ends : (beams, 3) float64
        End points of its beams, in the floor's frame; those without a return end at the greatest range [m].
    is_hit : (beams,) bool
        Which of them met something.
    trail : (T, 2) float64
        If it has been, in the floor's frame [m].
    plan : (P, 2) float64
        Rest of the path that it drives, placed as ``believed`` [m].
    goal : (2,) float64 or None
        Target of its drive, placed alike [m].
    cloud : (C, 3) float32
        Points of its depth image, in the floor's frame [m].
    boxes : (B, 2, 3) float64
        Low and high corners of its sparse map along the axes of that map [m]; empty if it makes none.
    boxes_pose : (3,) float64
        x, y, theta of these axes in the floor's frame [m, rad].
    """

    pose: NDArray[np.float64]
    believed: NDArray[np.float64]
    attitude: NDArray[np.float64]
    has_ended: bool
    laser: NDArray[np.float64]
    ends: NDArray[np.float64]
    is_hit: NDArray[np.bool_]
    trail: NDArray[np.float64]
    plan: NDArray[np.float64]
    goal: NDArray[np.float64] | None
    cloud: NDArray[np.float32]
    boxes: NDArray[np.float64]
    boxes_pose: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A run at one time.

    Attributes
    ----------
    time_s : float
        When [s].
    robots : list of RobotMoment
        The robots.
    depth : (robots, rows, columns) float32 or None
        Their last depth images [m]; None without cameras. The environment's own.
    crowd : Crowd or None
        People and doors; None without any.
    """

    time_s: float
    robots: list[RobotMoment]
    depth: NDArray[np.float32] | None
    crowd: Crowd | None = None


def moment_of(env: WatchedExploration) -> Moment:
    """Return the drawn state of an environment after a reset, which is not changed.

    Data that a robot would compute only on request, such as a sparse map, is not requested.
    """
    believed, trails = believed_on_floor(env), _trails(env)
    frames = None if env.simulation.camera is None else env.simulation.camera.frames
    robots = [_robot(env, row, believed[row], trails[:, row]) for row in range(env.settings.robots)]
    return Moment(env.scorer.time, robots, frames, crowd_of(env.simulation.population))


def _robot(env: WatchedExploration, row: int, believed: NDArray[np.float64], trail: NDArray[np.float64]) -> RobotMoment:
    world = env.world
    body = body_rotation(world.poses[row], world.attitudes[row])
    place = np.array([*world.poses[row, :2], world.attitudes[row, 0]])
    beams, is_hit = _scan(env, row)
    plan, goal = _plan(env, row)
    boxes, axes = _boxes(env, row)
    return RobotMoment(
        pose=world.poses[row].copy(),
        believed=believed,
        attitude=world.attitudes[row].copy(),
        has_ended=env.possible_agents[row] not in env.agents,
        laser=place + body.apply((0.0, 0.0, env.settings.lidar.height)),
        ends=place + body.apply(beams),
        is_hit=is_hit,
        trail=trail,
        plan=plan,
        goal=goal,
        cloud=_cloud(env, row, place, body),
        boxes=boxes,
        boxes_pose=np.array([*_on_floor(env, row, np.zeros((1, 2)))[0], _turned(env, row) + axes]),
    )


def body_rotation(pose: NDArray[np.float64], attitude: NDArray[np.float64]) -> Rotation:
    """Return how a body is turned that has a pose (3,), and an attitude (3,) as of ``World``."""
    return Rotation.from_euler("xyz", (attitude[1], attitude[2], pose[2]))


def _turned(env: ExplorationEnv, row: int) -> float:
    return 0.0 if env.settings.known_starts else float(env.world.starts[row, 2])


def _on_floor(env: ExplorationEnv, row: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (N, 2) in the frame of a robot's believed pose in the floor's frame, (N, 2) [m]."""
    if env.settings.known_starts:
        return points
    cosine, sine = np.cos(_turned(env, row)), np.sin(_turned(env, row))
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]) + env.world.starts[row, :2])


def from_floor(env: ExplorationEnv, row: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a point (2,) of the floor, where the page shows what a robot believes, in its map frame [m]."""
    offset = env.perception.poses.offset(row)
    if env.settings.known_starts:
        return np.asarray(point - offset)
    cosine, sine = np.cos(_turned(env, row)), np.sin(_turned(env, row))
    return np.asarray((point - env.world.starts[row, :2]) @ np.array([[cosine, -sine], [sine, cosine]]) - offset)


def _trails(env: ExplorationEnv) -> NDArray[np.float64]:
    """Return the past positions of the robots, (T, robots, 2), thinned out."""
    track = env.scorer.track
    shown = track[:: max(-(-len(track) // MOST_TRAIL), 1)]
    return np.stack([*(poses[:, :2] for _, poses in shown), env.world.poses[:, :2]])


def _scan(env: ExplorationEnv, row: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the end points of a robot's beams on it, (beams, 3), and which beams met something."""
    lidar = env.settings.team_lidars[row]
    stride = -(-lidar.beams // MOST_BEAMS)
    ranges = env.simulation.ranges[row, ::stride].astype(np.float64)
    is_hit = np.isfinite(ranges) & (ranges < lidar.range_max)
    lengths = np.clip(np.nan_to_num(ranges, nan=0.0, posinf=lidar.range_max), 0.0, lidar.range_max)
    angles = lidar.angles[::stride]
    ends = np.column_stack([lengths * np.cos(angles), lengths * np.sin(angles), np.full(len(angles), lidar.height)])
    if env.simulation.scan_steps > 1:
        # The robot may have moved since its last scan.
        since = relative(env.beliefs.believed[row], env.beliefs.scanned[row])
        ends[:, :2] = Transform(*since.tolist()).apply(ends[:, :2])
    return ends, is_hit


def _plan(env: WatchedExploration, row: int) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return the rest of the path of a robot, and its target."""
    if env.driver is None or env.possible_agents[row] not in env.agents:
        return NO_POINTS, None
    drives = env.driver.drives
    plan, goal = NO_POINTS, None
    if drives.has_path[row]:
        ahead = drives.paths[row, int(drives.places[row]) : int(drives.counts[row])]
        plan = _on_floor(env, row, np.concatenate([env.beliefs.believed[row, None, :2], ahead]))
    if drives.is_ordered[row]:
        goal = _on_floor(env, row, drives.targets[row, None] + env.perception.poses.offset(row))[0]
    return plan, goal


def _cloud(env: ExplorationEnv, row: int, place: NDArray[np.float64], body: Rotation) -> NDArray[np.float32]:
    sensor = env.simulation.camera
    if sensor is None:
        return NO_CLOUD
    points = point_cloud(sensor.frames[row], sensor.camera)
    shown = points[:: max(-(-len(points) // MOST_POINTS), 1)]
    return np.asarray(place + body.apply(shown), np.float32) if len(shown) else NO_CLOUD


def _boxes(env: ExplorationEnv, row: int) -> tuple[NDArray[np.float64], float]:
    """Return the boxes of a robot's sparse map, and how its axes are turned [rad]."""
    mapper = env.perception.sparse_maps.made.get(row)
    known = None if mapper is None else mapper.map
    if mapper is None or known is None:
        return NO_BOXES, 0.0
    return known.boxes, mapper.axes or 0.0

"""Features of options, of teammates and of the situation, as numbers near 1.

All are relative to the deciding robot: no feature gives its position on the floor.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.tours.planning import Tourist, TourOptions
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.planning.frontiers.views import ViewRules, gains_at
from lidarium.mapping.planning.touring.map_tours import NO_PATH

NEAR_M, AROUND_M = 3.0, 6.0
"""Options within these paths of an option lie near and around it [m]."""

FAR_REACH, FAR_DEPTH = 8.0, 6.0
"""Unknown space counts up to the first from a view, and up to the second behind known space [m]."""

MOST = 4.0
"""No feature is greater than this, or less than the negative of it."""

OPTION_FEATURES: Mapping[str, float] = {
    "path": 10.0,  # length of the path to the view [m]
    "turn": math.pi,  # by how much the robot turns to set out [rad]
    "gain": 5.0,  # unknown area in view [m2]
    "far_gain": 30.0,  # the same, farther and deeper [m2]
    "size": 3.0,  # length of the frontier [m]
    "detour": 5.0,  # by how much tours cost more where it comes first [m]
    "is_first": 1.0,  # whether the robot's tour begins with it
    "place": 10.0,  # its place in the robot's own tour; 0 in another's
    "is_own": 1.0,  # whether it is in the robot's own tour
    "is_kept": 1.0,  # whether the robot drives to it already
    "ahead": 10.0,  # the view along the robot's heading [m]
    "left": 10.0,  # the view to its left [m]
    "cosine": 1.0,  # of the direction to the view from the heading
    "bend": 1.0,  # logarithm of path over straight line
    "gain_ahead": 1.0,  # cosine of what is unknown, seen from the view, from the direction to the view
    "others_path": 10.0,  # shortest path of another robot to it [m]
    "nearer_others": 1.0,  # how many others are nearer to it
    "nearest": 5.0,  # path from it to the nearest other option [m]
    "mean": 20.0,  # mean path from it to all options [m]
    "count_near": 5.0,  # options near it
    "gain_near": 10.0,  # what these show [m2]
    "gain_around": 20.0,  # what options around it show [m2]
    "unknown": 1.0,  # share of its crop that is unknown
    "occupied": 0.25,  # share of its crop that is occupied
    "rim": 5.0,  # how far it lies within the box around all that is known [m]
}
"""Features of an option, and their divisors."""

TEAMMATE_FEATURES: Mapping[str, float] = {
    "ahead": 10.0,  # place along the robot's heading [m]
    "left": 10.0,  # and to its left [m]
    "cosine": 1.0,  # of its heading from the robot's
    "sine": 1.0,
    "has_target": 1.0,  # whether it drives to a frontier that is known
    "target_ahead": 10.0,  # where that is, along the robot's heading [m]
    "target_left": 10.0,  # and to its left [m]
    "has_picked": 1.0,  # whether it has decided just before
}
"""Features of a teammate, and their divisors."""

SITUATION_FEATURES: Mapping[str, float] = {
    "time": 300.0,  # since the start [s]
    "known": 200.0,  # free area that is known [m2]
    "rate": 2.0,  # free area found in the last 20 s, a second [m2/s]
    "options": 10.0,  # how many there are
    "gain": 50.0,  # what all show together [m2]
    "robots": 4.0,  # that tours are planned for
    "own_tour": 50.0,  # length of the robot's tour [m]
    "all_tours": 100.0,  # and of all tours [m]
    "picked": 4.0,  # robots that have decided just before
}
"""Features of the situation, and their divisors."""


def option_features(
    options: TourOptions,
    robot: int,
    costs: NDArray[np.float64],
    tour: list[int],
    views: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> dict[str, NDArray[np.float64]]:
    """Return the features of tours and paths of each option for a robot, by name, (n,) each.

    Parameters
    ----------
    options : TourOptions
        Its options.
    robot : int
        Which robot.
    costs : (n,) float64
        By how much tours cost more if it visits each first [m].
    tour : list of int
        Its own tour.
    views : (n, 2), (n,) float64
        x, y of the views from the corner of the map's first cell [m], and the directions of the space shown [rad].
    """
    pose, paths = options.robots[robot].pose, options.lengths[robot]
    positions, directions = views
    gap = positions - pose[:2]
    straight = np.hypot(gap[:, 0], gap[:, 1])
    bearing = np.arctan2(gap[:, 1], gap[:, 0])
    ahead, left = _in_frame(positions, pose)
    others = np.delete(options.lengths, robot, axis=0)
    apart = options.between + np.where(np.eye(len(positions)) > 0, NO_PATH, 0.0)
    position = np.zeros(len(positions))
    position[tour] = np.arange(len(tour)) + 1.0
    is_near, is_around = options.between <= NEAR_M, options.between <= AROUND_M
    return {
        "path": paths,
        "turn": options.turns[robot],
        "gain": options.gains,
        "detour": costs,
        "is_first": position == 1.0,
        "place": position,
        "is_own": position > 0.0,
        "is_kept": options.is_kept[robot],
        "ahead": ahead,
        "left": left,
        "cosine": np.cos(bearing - pose[2]),
        "bend": np.log((paths + 1.0) / (straight + 1.0)),
        "gain_ahead": np.cos(directions - bearing),
        "others_path": others.min(axis=0) if len(others) else np.full(len(positions), NO_PATH),
        "nearer_others": (others < paths).sum(axis=0),
        "nearest": apart.min(axis=1),
        "mean": np.minimum(options.between, 100.0).mean(axis=1),
        "count_near": is_near.sum(axis=1) - 1.0,
        "gain_near": np.where(is_near, options.gains, 0.0).sum(axis=1),
        "gain_around": np.where(is_around, options.gains, 0.0).sum(axis=1),
    }


def far_gains(
    log_odds: NDArray[np.int8], resolution: float, cells: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distant area that each of n cells shows [m2], and its direction [rad], (n,) each.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map.
    resolution : float
        Side of its cells [m].
    cells : (n, 2) int64
        Cells (row, column).
    reach : float
        How far the laser sees [m].
    """
    rules = ViewRules(reach=min(FAR_REACH, reach), depth=FAR_DEPTH)
    return gains_at(log_odds, resolution, cells, rules)


def teammate_features(
    robots: list[tuple[Tourist, NDArray[np.float64] | None, bool]], pose: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return the features of m teammates, by name, (m,) each.

    Parameters
    ----------
    robots : list of (Tourist, (2,) float64 or None, bool)
        Each teammate, its goal [m], and whether it has decided just before.
    pose : (3,) float64
        Pose of the robot that decides.
    """
    poses = np.array([robot.pose for robot, _, _ in robots]).reshape(-1, 3)
    has_target = np.array([target is not None for _, target, _ in robots], np.float64)
    targets = np.array([pose[:2] if target is None else target for _, target, _ in robots]).reshape(-1, 2)
    ahead, left = _in_frame(poses[:, :2], pose)
    target_ahead, target_left = _in_frame(targets, pose)
    return {
        "ahead": ahead,
        "left": left,
        "cosine": np.cos(poses[:, 2] - pose[2]),
        "sine": np.sin(poses[:, 2] - pose[2]),
        "has_target": has_target,
        "target_ahead": target_ahead,
        "target_left": target_left,
        "has_picked": np.array([picked for _, _, picked in robots], np.float64),
    }


def table_of(values: Mapping[str, NDArray[np.float64]], scales: Mapping[str, float]) -> NDArray[np.float32]:
    """Return features as a table, (n, features) float32.

    They are divided by their scales and bounded by ``MOST``.
    """
    columns = [np.asarray(values[name], np.float64) / scale for name, scale in scales.items()]
    return np.clip(np.stack(columns, axis=-1), -MOST, MOST).astype(np.float32)


def _in_frame(
    places: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places (n, 2) as seen from a pose: ahead and left, (n,) each [m]."""
    gap = places - pose[:2]
    cosine, sine = math.cos(wrapped(float(pose[2]))), math.sin(wrapped(float(pose[2])))
    return gap[:, 0] * cosine + gap[:, 1] * sine, gap[:, 1] * cosine - gap[:, 0] * sine

"""Runs of a robot through rooms of straight walls, for the tests of localization: scans, odometry and
where it truly was."""

import math
from dataclasses import dataclass

import numpy as np

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import Sensing

GEOMETRY = ScanGeometry(beams=241, field_of_view=math.radians(240.0), range_min=0.02, range_max=5.6)


def outline(*corners):
    """Return the walls (n, 4) of a closed polygon."""
    points = np.array(corners, float)
    return np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)


def box(x, y, width, height):
    """Return the walls of an upright rectangle."""
    return outline((x, y), (x + width, y), (x + width, y + height), (x, y + height))


def odd_room():
    """A room without symmetry, 6 m by 5 m, with a niche, a slanted wall and a box."""
    hull = outline((0, 0), (6, 0), (6, 2), (6.8, 2), (6.8, 3), (6, 3), (6, 5), (2, 5), (0, 3.4))
    return np.concatenate([hull, box(3.6, 3.2, 0.7, 0.5)])


def ring():
    """A corridor 1.8 m wide round a block of 7 m by 4 m, with niches by which its sides differ."""
    hull = outline(
        (0, 0),
        (4, 0),
        (4, -0.6),
        (5, -0.6),
        (5, 0),
        (10.6, 0),
        (10.6, 2),
        (11.3, 2),
        (11.3, 3.2),
        (10.6, 3.2),
        (10.6, 7.6),
        (0, 7.6),
    )
    return np.concatenate(
        [
            hull,
            outline((1.8, 1.8), (8.8, 1.8), (8.8, 5.8), (6, 5.8), (6, 5.4), (4.5, 5.4), (4.5, 5.8), (1.8, 5.8)),
        ]
    )


def twins():
    """A corridor with two rooms beside it that look alike, 6 m apart."""
    walls = [(0, 0, 12, 0), (12, 0, 12, 1.6), (0, 0, 0, 1.6)]
    at = 0.0
    for door in (2.6, 8.6):
        walls += [(at, 1.6, door - 0.5, 1.6)]
        left, right = door - 1.6, door + 1.6
        walls += [
            (door - 0.5, 1.6, door - 0.5, 1.8),
            (door + 0.5, 1.6, door + 0.5, 1.8),
            (left, 1.8, door - 0.5, 1.8),
        ]
        walls += [
            (door + 0.5, 1.8, right, 1.8),
            (left, 1.8, left, 5),
            (right, 1.8, right, 5),
            (left, 5, right, 5),
        ]
        at = door + 0.5
    walls += [(at, 1.6, 12, 1.6)]
    return np.concatenate([np.array(walls, float), box(2.0, 3.6, 0.6, 0.4), box(8.0, 3.6, 0.6, 0.4)])


def cast(walls, pose, geometry=GEOMETRY):
    """Return what a laser at x, y, theta sees, shape (beams,); inf for no return."""
    angles = pose[2] + geometry.angles
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    start, along = walls[None, :, :2] - pose[:2], (walls[:, 2:] - walls[:, :2])[None]
    cross = direction[..., 0] * along[..., 1] - direction[..., 1] * along[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / cross
        share = (start[..., 0] * direction[..., 1] - start[..., 1] * direction[..., 0]) / cross
    is_hit = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    ranges = np.where(is_hit, distance, np.inf).min(axis=1)
    ranges[ranges > geometry.range_max] = np.inf
    return ranges.astype(np.float32)


@dataclass
class Run:
    """What a robot sensed, and where it was, in the frame of its start."""

    sensings: list
    truth: np.ndarray


def through(points, speed=0.4, turn_rate=0.8, period=0.2):
    """Return poses every period along straight lines between points, with turns on the spot."""
    pose = np.array([*points[0], math.atan2(points[1][1] - points[0][1], points[1][0] - points[0][0])])
    poses = [pose]
    for target in points[1:]:
        gap = np.array(target, float) - pose[:2]
        turn = math.remainder(math.atan2(gap[1], gap[0]) - pose[2], 2.0 * math.pi)
        turns, steps = (
            math.ceil(abs(turn) / (turn_rate * period)),
            math.ceil(np.hypot(*gap) / (speed * period)),
        )
        poses += [pose + np.array([0.0, 0.0, turn * (k + 1) / turns]) for k in range(turns)]
        pose = poses[-1]
        poses += [pose + np.array([*(gap * (k + 1) / steps), 0.0]) for k in range(steps)]
        pose = poses[-1]
    return np.array(poses)


def driven(walls, points, seed=0, noise=0.01, drift=(0.03, 0.02), period=0.2):
    """Drive from point to point; odometry stretches motions by the drift's first share, and turns by its
    second a metre."""
    generator = np.random.default_rng(seed)
    poses = through(points, period=period)
    odometry, sensings = np.zeros(3), []
    for k, pose in enumerate(poses):
        if k:
            motion = relative(poses[k - 1], pose)
            distance = np.hypot(motion[0], motion[1])
            wrong = np.array(
                [motion[0] * (1.0 + drift[0]), motion[1], motion[2] * (1.0 + drift[0]) + drift[1] * distance]
            )
            odometry = composed(odometry, wrong)
        ranges = cast(walls, pose)
        ranges = ranges + generator.normal(0.0, noise, len(ranges)).astype(np.float32)
        sensings.append(Sensing(k * period, odometry.copy(), ranges))
    return Run(sensings, relative(np.broadcast_to(poses[0], poses.shape), poses))


RING_ROUND = [(0.9, 0.9), (9.7, 0.9), (9.7, 6.7), (0.9, 6.7), (0.9, 0.9), (9.7, 0.9), (9.7, 3.0)]
TWINS_VISITED = [
    (1.0, 0.8),
    (2.6, 0.8),
    (2.6, 3.0),
    (1.9, 3.0),
    (2.6, 3.0),
    (2.6, 0.8),
    (8.6, 0.8),
    (8.6, 3.0),
    (7.9, 3.0),
    (8.6, 3.0),
    (8.6, 0.8),
    (11, 0.8),
]

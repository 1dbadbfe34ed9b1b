"""Scans of rooms given by their walls, for tests of what works on scans alone."""

import itertools
import math

import numpy as np

from lidarium.mapping.geometry.rigid import Transform


def ring(*corners):
    """Return the walls x1, y1, x2, y2 of a closed ring of corners."""
    points = np.array(corners, np.float64)
    return np.hstack([points, np.roll(points, -1, axis=0)])


def scan(walls, pose, geometry, noise=0.0, seed=0):
    """Return the ranges (beams,) float32 from a pose among walls (n, 4); inf where there is no return."""
    x, y, theta = pose
    angles = geometry.angles + theta
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    along, offset = walls[None, :, 2:] - walls[None, :, :2], walls[None, :, :2] - np.array([x, y])
    across = directions[..., 0] * along[..., 1] - directions[..., 1] * along[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (offset[..., 0] * along[..., 1] - offset[..., 1] * along[..., 0]) / across
        shares = (offset[..., 0] * directions[..., 1] - offset[..., 1] * directions[..., 0]) / across
    is_met = (ranges > 0.0) & (shares >= 0.0) & (shares <= 1.0)
    nearest = np.where(is_met, ranges, np.inf).min(axis=1)
    noisy = nearest + noise * np.maximum(1.0, np.where(np.isfinite(nearest), nearest, 1.0)) * np.random.default_rng(
        seed
    ).standard_normal(geometry.beams)
    return np.where(noisy <= geometry.range_max, noisy, np.inf).astype(np.float32)


def biased_odometry(poses, bias, seed=0, slip=0.0):
    """Return odometry (n, 3) along poses (n, 3) whose ways and turns are too long by a share, and slip."""
    generator = np.random.default_rng(seed)
    place, told = Transform(), [np.zeros(3)]
    for before, after in itertools.pairwise(poses):
        motion = Transform(*map(float, before)).inverse() @ Transform(*map(float, after))
        way, draws = math.hypot(motion.x, motion.y), slip * generator.standard_normal(3)
        place = place @ Transform(
            (1.0 + bias) * motion.x + way * draws[0],
            (1.0 + bias) * motion.y + way * draws[1],
            (1.0 + bias) * motion.theta + draws[2] * abs(motion.theta),
        )
        told.append(np.array([place.x, place.y, place.theta]))
    return np.array(told)


def distances_to(walls, points):
    """Return how far points (n, 2) lie from the nearest wall."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    offset = points[:, None] - start
    shares = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(offset - shares[..., None] * along, axis=2).min(axis=1)

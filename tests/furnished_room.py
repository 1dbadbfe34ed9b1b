"""A furnished room as points: walls, floor, a table with legs, a chair."""

import numpy as np

ROOM = (5.0, 4.0)
TABLE_TOP = np.array([[1.5, 1.4, 0.70], [2.9, 2.2, 0.74]])


def box_points(low, high, spacing):
    """Points on the six sides of a box."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    found = []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        sides = [np.linspace(low[k], high[k], max(round((high[k] - low[k]) / spacing), 1) + 1) for k in others]
        first, second = np.meshgrid(*sides, indexing="ij")
        for value in (low[axis], high[axis]):
            side = np.empty((first.size, 3))
            side[:, axis], side[:, others[0]], side[:, others[1]] = value, first.ravel(), second.ravel()
            found.append(side)
    return np.concatenate(found)


def furniture():
    """Boxes of what stands in the room, (M, 2, 3)."""
    legs = [[[x, y, 0.0], [x + 0.05, y + 0.05, 0.7]] for x in (1.5, 2.85) for y in (1.4, 2.15)]
    chair = [[[3.8, 0.8, 0.42], [4.25, 1.25, 0.46]], [[4.21, 0.8, 0.46], [4.25, 1.25, 0.95]]]
    chair += [[[x, y, 0.0], [x + 0.04, y + 0.04, 0.42]] for x in (3.8, 4.21) for y in (0.8, 1.21)]
    return np.array([TABLE_TOP.tolist(), *legs, *chair])


def room_points(spacing=0.025, noise=0.0, seed=0):
    """Points of the whole room, floor at z = 0, walls 2.4 m high with a ceiling."""
    wide, deep = ROOM
    shell = box_points((0, 0, 0), (wide, deep, 2.4), spacing)
    things = [box_points(low, high, spacing) for low, high in furniture()]
    points = np.concatenate([shell, *things])
    return points + np.random.default_rng(seed).normal(0.0, noise, points.shape) if noise else points


def seen_from(points, pose, reach=4.0, half_angle=0.6):
    """Points that a camera looking along its x axis has before it, in its own frame."""
    own = (points - pose[:3, 3]) @ pose[:3, :3]
    angles = np.arctan2(np.hypot(own[:, 1], 0.8 * own[:, 2]), own[:, 0])
    return own[(angles < half_angle) & (np.linalg.norm(own, axis=1) < reach)]


def pose_at(x, y, z=0.8, yaw=0.0, pitch=0.0):
    """Pose of a frame whose x axis looks ahead, by so much downwards."""
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    pose[:3, 3] = (x, y, z)
    return pose

"""Depth images of a floor with boxes, one ray a pixel, for tests of what cameras see of the ground."""

import math

import numpy as np

from lidarium.mapping.point_clouds.cameras import Intrinsics
from lidarium.mapping.sparse.exploring.ground import GroundCamera

FAR_M = 8.0


def looking(pitch=0.35, height=0.5, columns=80, rows=60, range_m=4.0, pan=0.0, **options):
    """A camera on a robot that looks down by ``pitch`` and to the left by ``pan`` [rad]."""
    ahead = np.array([math.cos(pan) * math.cos(pitch), math.sin(pan) * math.cos(pitch), -math.sin(pitch)])
    left = np.array([-math.sin(pan), math.cos(pan), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = -left, -np.cross(ahead, left), ahead
    pose[2, 3] = height
    focal = 0.5 * columns / math.tan(math.radians(29.0))
    intrinsics = Intrinsics(focal, focal, 0.5 * (columns - 1), 0.5 * (rows - 1))
    return GroundCamera(intrinsics=intrinsics, pose=pose, shape=(rows, columns), range_m=range_m, **options)


def depth_image(camera, robot, boxes=()):
    """What the camera of a robot at x, y, theta measures of the floor and of boxes (M, 2, 3)."""
    rows, columns = camera.shape
    pinhole = camera.intrinsics
    v, u = np.mgrid[:rows, :columns]
    rays = np.stack([(u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy, np.ones(u.shape)], axis=-1)
    x, y, theta = robot
    turn = np.array([[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1]])
    rays = rays @ camera.pose[:3, :3].T @ turn.T
    eye = turn @ camera.pose[:3, 3] + (x, y, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], np.inf)
        for low, high in np.asarray(boxes, float).reshape(-1, 2, 3):
            first, last = (low - eye) / rays, (high - eye) / rays
            enter = np.fmin(first, last).max(axis=-1)
            leave = np.fmax(first, last).min(axis=-1)
            depth = np.where((enter <= leave) & (enter > 0.0), np.minimum(depth, enter), depth)
    return np.where(depth < FAR_M, depth, 0.0).astype(np.float32)

"""Scans of robots that lean: rays of PyBullet along the tilted plane of the laser."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.simulation.bullet.bodies import Bodies

LEAN = math.radians(2.0)
"""From this on a scan is taken along the tilted plane [rad]."""

_OWN_BODY = 1e-3
"""How far outside of its own body a ray begins [m]."""


def scan_leaning(bodies: Bodies, robot: int, lidar: Lidar, ranges: NDArray[np.float32]) -> None:
    """Take the scan of a robot that leans.

    Beams meet the floor, the ground and other robots; they begin at the side of the own body.

    Parameters
    ----------
    bodies : Bodies
        All of the episode.
    robot : int
        Whose scan.
    lidar : Lidar
        Its laser.
    ranges : (beams,) float32
        Result: true ranges [m], inf for no return.
    """
    motion, first = bodies.motion(robot), bodies.team[robot].radius + _OWN_BODY
    eye = motion.place + lidar.height * motion.axes[:, 2]
    beams = np.stack([np.cos(lidar.angles), np.sin(lidar.angles)], axis=1) @ motion.axes[:, :2].T
    shares = bodies.rays(eye + first * beams, eye + lidar.range_max * beams)
    ranges[:] = np.where(shares < 1.0, first + shares * (lidar.range_max - first), np.inf)

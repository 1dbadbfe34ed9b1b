"""PyBullet's rayTestBatch as a peer: scans among boxes."""

import importlib
import importlib.util
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

HEIGHT = 0.3


def bullet_scan(
    boxes: NDArray[np.float64], poses: NDArray[np.float64], beams: int, reach: float
) -> Callable[[], object] | None:
    """Return a function that casts the scan of the next pose in one thread.

    None where PyBullet is not installed.

    Parameters
    ----------
    boxes : (B, 4) float64
        The floor [m].
    poses : (N, 3) float64
        Where the scans are taken in turn [m, rad]; their rays are prepared beforehand.
    beams : int
        Beams of a scan, over 240 deg.
    reach : float
        Longest range [m].
    """
    if importlib.util.find_spec("pybullet") is None:
        return None
    pybullet = importlib.import_module("pybullet")

    client = pybullet.connect(pybullet.DIRECT)
    for x_low, y_low, x_high, y_high in boxes:
        half = [(x_high - x_low) / 2, (y_high - y_low) / 2, 0.5]
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
        middle = [(x_low + x_high) / 2, (y_low + y_high) / 2, 0.5]
        pybullet.createMultiBody(0, shape, basePosition=middle, physicsClientId=client)
    angles = np.linspace(-math.radians(120.0), math.radians(120.0), beams)
    rays = []
    for x, y, theta in poses:
        begins = np.tile([x, y, HEIGHT], (beams, 1))
        ends = begins + reach * np.stack(
            [np.cos(angles + theta), np.sin(angles + theta), np.zeros(beams)], axis=1
        )
        # Lists are what rayTestBatch reads fastest.
        rays.append((begins.tolist(), ends.tolist()))
    count = 0

    def scan() -> None:
        nonlocal count
        begins, ends = rays[count % len(rays)]
        count += 1
        pybullet.rayTestBatch(begins, ends, numThreads=1, physicsClientId=client)

    return scan

"""PyBullet's getCameraImage as a peer: depth images of a floor's solids, drawn in software."""

import importlib
import importlib.util
import math
from collections.abc import Callable
from ctypes.util import find_library
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.sensors.cameras import DepthCamera

NEAR = 0.05


def _has_egl() -> bool:
    """Whether EGL can be used; its plug-in ends the process where the system has no EGL."""
    return bool(_egl_library()) and find_library("EGL") is not None


class BulletImages:
    """Depth images of a floor of upright boxes.

    Parameters
    ----------
    floor : Floor
        Its solids have four corners each, at right angles.
    camera : DepthCamera
        The camera.
    is_egl : bool
        Whether EGL draws them, on a GPU where there is one; else TinyRenderer does.
    """

    def __init__(self, floor: Floor, camera: DepthCamera, is_egl: bool = False) -> None:
        self._bullet: Any = importlib.import_module("pybullet")
        self._camera, bullet = camera, self._bullet
        self.client = bullet.connect(bullet.DIRECT)
        self._renderer = bullet.ER_BULLET_HARDWARE_OPENGL if is_egl else bullet.ER_TINY_RENDERER
        if is_egl:
            # It draws nothing that was made before it was loaded.
            bullet.loadPlugin(_egl_library(), "_eglRendererPlugin", physicsClientId=self.client)
        x_min, y_min, x_max, y_max = floor.bounds
        middle, half = ((x_min + x_max) / 2, (y_min + y_max) / 2), ((x_max - x_min) / 2, (y_max - y_min) / 2)
        for height in (-0.05, floor.ceiling + 0.05):
            self._add_box(middle, (*half, 0.05), height, 0.0)
        for solid in floor.solids:
            corners, low, high = solid.polygon, max(solid.z_low, 0.0), min(solid.z_high, floor.ceiling)
            along = corners[1] - corners[0]
            sides = math.hypot(*along) / 2, math.hypot(*(corners[2] - corners[1])) / 2
            place = corners.mean(axis=0)
            self._add_box(place, (*sides, (high - low) / 2), (low + high) / 2, math.atan2(along[1], along[0]))
        vertical = 2.0 * math.atan(camera.rows / camera.columns * math.tan(camera.field_of_view / 2.0))
        self._projection = bullet.computeProjectionMatrixFOV(
            math.degrees(vertical), camera.columns / camera.rows, NEAR, 2.0 * camera.depth_max
        )

    def _add_box(self, place: Any, half: tuple[float, float, float], height: float, yaw: float) -> None:  # noqa: ANN401
        bullet, client = self._bullet, self.client
        shape = bullet.createVisualShape(bullet.GEOM_BOX, halfExtents=list(half), physicsClientId=client)
        turn = bullet.getQuaternionFromEuler([0.0, 0.0, yaw])
        bullet.createMultiBody(
            0,
            baseVisualShapeIndex=shape,
            basePosition=[*map(float, place), height],
            baseOrientation=turn,
            physicsClientId=client,
        )

    def image(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth image of a camera on a robot at x, y, theta, (rows, columns) [m]."""
        camera, (x, y, theta) = self._camera, pose
        view = self._bullet.computeViewMatrix(
            [x, y, camera.height],
            [x + math.cos(theta), y + math.sin(theta), camera.height],
            [0.0, 0.0, 1.0],
        )
        depths = self._bullet.getCameraImage(
            camera.columns,
            camera.rows,
            view,
            self._projection,
            renderer=self._renderer,
            flags=self._bullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self.client,
        )[3]
        far = 2.0 * camera.depth_max
        buffer = np.reshape(depths, (camera.rows, camera.columns))
        return np.asarray(far * NEAR / (far - (far - NEAR) * buffer), np.float64)

    def close(self) -> None:
        """Disconnect."""
        self._bullet.disconnect(self.client)


def _egl_library() -> str:
    """Return the file of PyBullet's plug-in for EGL, empty where there is none."""
    spec = importlib.util.find_spec("eglRenderer")
    return "" if spec is None or spec.origin is None else spec.origin


def bullet_images(
    floor: Floor, camera: DepthCamera, poses: NDArray[np.float64], is_egl: bool = False
) -> Callable[[], object] | None:
    """Return a function that takes the image of the next pose; None where its renderer is not there."""
    if importlib.util.find_spec("pybullet") is None or (is_egl and not _has_egl()):
        return None
    images, count = BulletImages(floor, camera, is_egl), 0

    def take() -> None:
        nonlocal count
        images.image(poses[count % len(poses)])
        count += 1

    return take

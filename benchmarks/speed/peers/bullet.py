"""PyBullet as a peer: its rays, its bodies and its images."""

import importlib
import importlib.util
import math
from collections.abc import Callable
from ctypes.util import find_library
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.bullet.bodies import FloorShapes
from lidarium.envs.simulation.bullet.client import Client
from lidarium.envs.simulation.bullet.robot_text import LEFT, RIGHT, urdf_of

HEIGHT = 0.3


def bullet_scan(
    boxes: NDArray[np.float64], poses: NDArray[np.float64], beams: int, reach: float
) -> Callable[[], object] | None:
    """Return a function that casts the scan of the next pose in one thread.

    None if PyBullet is not installed.

    `boxes` (B, 4) float64: the floor [m]; `poses` (N, 3) float64: where the scans are taken in turn [m, rad]; their
    rays are prepared beforehand.
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
        ends = begins + reach * np.stack([np.cos(angles + theta), np.sin(angles + theta), np.zeros(beams)], axis=1)
        # Lists are what rayTestBatch reads fastest.
        rays.append((begins.tolist(), ends.tolist()))
    count = 0

    def scan() -> None:
        nonlocal count
        begins, ends = rays[count % len(rays)]
        count += 1
        pybullet.rayTestBatch(begins, ends, numThreads=1, physicsClientId=client)

    return scan


SUBSTEPS = 24


class BulletRig:
    """Robots on a floor in PyBullet, put together by its own calls.

    `poses` (robots, 3) float64: where they start [m, rad]; none for the floor alone; `speeds` (2,) of float: of the
    left and the right wheel [m/s].
    """

    def __init__(
        self, floor: Floor, robot: Robot, poses: NDArray[np.float64], speeds: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._client = client = Client()
        bullet = client.bullet
        client.call("setGravity", 0.0, 0.0, -9.81)
        for box in FloorShapes.of(floor).boxes:
            half = [side / 2.0 for side in box.size]
            shape = client.call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
            turn = bullet.getQuaternionFromEuler((0.0, 0.0, box.turn))
            client.call("createMultiBody", 0.0, shape, basePosition=box.centre, baseOrientation=turn)
        client.call("createMultiBody", 0.0, client.call("createCollisionShape", bullet.GEOM_PLANE))
        self._bodies, radius = [], robot.build.wheel_radius
        for x, y, theta in poses.tolist():
            body = client.load_text(urdf_of(robot), flags=bullet.URDF_USE_INERTIA_FROM_FILE)
            place = (x, y, robot.build.mass_height)
            turn = bullet.getQuaternionFromEuler((0.0, 0.0, theta))
            client.call("resetBasePositionAndOrientation", body, place, turn)
            for joint, speed in zip((LEFT, RIGHT), speeds, strict=True):
                motor = {"targetVelocity": speed / radius, "force": robot.build.motor_torque}
                client.call("setJointMotorControl2", body, joint, bullet.VELOCITY_CONTROL, **motor)
            self._bodies.append(body)

    def step(self) -> None:
        """Run the substeps of a step, and nothing else."""
        for _ in range(SUBSTEPS):
            self._client.call("stepSimulation")

    def step_and_scan(self, lidar: Lidar) -> None:
        """Run a step, then take the scan of each robot by ``rayTestBatch`` in one thread."""
        self.step()
        for body in self._bodies:
            (x, y, _), turn = self._client.call("getBasePositionAndOrientation", body)
            theta = self._client.bullet.getEulerFromQuaternion(turn)[2]
            angles = lidar.angles + theta
            beams = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
            eye = np.array([x, y, lidar.height])
            begins, ends = (eye + length * beams for length in (0.2, lidar.range_max))
            self._client.call("rayTestBatch", begins.tolist(), ends.tolist(), numThreads=1)

    def close(self) -> None:
        """End the server."""
        self._client.close()


def circling(robot: Robot) -> tuple[float, float]:
    """Return speeds of the wheels on the spot, so that nothing is touched [m/s]."""
    return robot.wheel_speeds(0.0, math.pi / 4.0)


NEAR = 0.05


def _has_egl() -> bool:
    """Whether EGL can be used; its plug-in ends the process if the system has no EGL."""
    return bool(_egl_library()) and find_library("EGL") is not None


class BulletImages:
    """Depth images of a floor of upright boxes."""

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
            [x, y, camera.height], [x + math.cos(theta), y + math.sin(theta), camera.height], [0.0, 0.0, 1.0]
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
    """Return the file of PyBullet's plug-in for EGL, empty if there is none."""
    spec = importlib.util.find_spec("eglRenderer")
    return "" if spec is None or spec.origin is None else spec.origin


def bullet_images(
    floor: Floor, camera: DepthCamera, poses: NDArray[np.float64], is_egl: bool = False
) -> Callable[[], object] | None:
    """Return a function that takes the image of the next pose; None if its renderer is not there."""
    if importlib.util.find_spec("pybullet") is None or (is_egl and not _has_egl()):
        return None
    images, count = BulletImages(floor, camera, is_egl), 0

    def take() -> None:
        nonlocal count
        images.image(poses[count % len(poses)])
        count += 1

    return take

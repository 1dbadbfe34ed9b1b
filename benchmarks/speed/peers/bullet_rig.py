"""PyBullet as it is mostly used, as a peer: a body for each solid, a call for each substep."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.bullet.client import Client
from lidarium.envs.simulation.bullet.floor_shapes import FloorShapes
from lidarium.envs.simulation.bullet.robot_text import LEFT, RIGHT, urdf_of

SUBSTEPS = 24


class BulletRig:
    """Robots on a floor in PyBullet, put together by its own calls.

    Parameters
    ----------
    floor : Floor
        Where they drive; its solids are boxes.
    robot : Robot
        Each robot.
    poses : (robots, 3) float64
        Where they start [m, rad]; none for the floor alone.
    speeds : (2,) of float
        Of the left and the right wheel [m/s].
    """

    def __init__(
        self,
        floor: Floor,
        robot: Robot,
        poses: NDArray[np.float64],
        speeds: tuple[float, float] = (0.0, 0.0),
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

"""The bodies of an episode in PyBullet: its floor and its robots, on one server."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.faces import convex_parts
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.raster import Raster, rectangles_of
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.bullet.client import Client
from lidarium.envs.simulation.bullet.robot_text import LEFT, RIGHT, urdf_of
from lidarium.envs.simulation.kernels.arrays import LEAF_HEIGHT_M, PERSON_HEIGHT_M
from lidarium.envs.simulation.kernels.contact import LEAF
from lidarium.envs.simulation.people.crowd import Crowd

OUTER_WALL = 1.0
"""Thickness of the walls around the bounds [m]."""

_STRAIGHT = 1e-6
"""Tolerance of the corners of a box [m]."""


@dataclass(frozen=True, slots=True)
class _Box:
    """An upright box.

    Attributes
    ----------
    centre, size : (3,) of float
        Centre and size of the box [m].
    turn : float
        Direction of its first side [rad].
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    turn: float = 0.0


@dataclass(frozen=True, slots=True)
class FloorShapes:
    """The solids of a floor.

    Attributes
    ----------
    boxes : list of _Box
        Upright boxes.
    prisms : list of ((N, 2) float64, float, float)
        Convex outline, lower and upper end of each other piece [m].
    """

    boxes: list[_Box]
    prisms: list[tuple[NDArray[np.float64], float, float]]

    @classmethod
    def of(cls, floor: Floor) -> "FloorShapes":
        """Return the shapes of a floor."""
        boxes, prisms = list(_outer_walls(floor)), []
        if floor.cells is not None:
            boxes += _cell_boxes(floor.cells, floor.ceiling)
        for solid in floor.solids:
            low, high = solid.z_low, min(solid.z_high, floor.ceiling)
            if low >= high:
                continue
            box = _box_of(solid, low, high)
            if box is not None:
                boxes.append(box)
            else:
                prisms += [(piece, low, high) for piece in convex_parts(solid)]
        return cls(boxes, prisms)

    @property
    def urdf(self) -> str:
        """The boxes as the text of a URDF file: one static link."""
        # PyBullet cuts lines of more than some kilobytes.
        shapes = "\n".join(
            f'<collision><origin xyz="{_numbers(box.centre)}" rpy="0 0 {box.turn!r}"/>'
            f'<geometry><box size="{_numbers(box.size)}"/></geometry></collision>'
            for box in self.boxes
        )
        return (
            '<robot name="floor"><link name="floor"><contact><lateral_friction value="1"/></contact>'
            '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
            f"\n{shapes}\n</link></robot>"
        )

    @property
    def obj(self) -> str:
        """The prisms as the text of an OBJ file, an object each; empty without prisms."""
        lines, first = [], 1
        for number, (outline, low, high) in enumerate(self.prisms):
            count = len(outline)
            lines.append(f"o piece_{number}")
            lines += [f"v {x!r} {y!r} {z!r}" for z in (low, high) for x, y in outline.tolist()]
            for end in (first, first + count):
                lines += [f"f {end} {end + k} {end + k + 1}" for k in range(1, count - 1)]
            first += 2 * count
        return "\n".join(lines)


def _outer_walls(floor: Floor) -> Iterator[_Box]:
    x_low, y_low, x_high, y_high = floor.bounds
    width, depth, height = x_high - x_low, y_high - y_low, floor.ceiling
    x, y, thick = 0.5 * (x_low + x_high), 0.5 * (y_low + y_high), OUTER_WALL
    for side in (x_low - 0.5 * thick, x_high + 0.5 * thick):
        yield _Box((side, y, 0.5 * height), (thick, depth + 2.0 * thick, height))
    for side in (y_low - 0.5 * thick, y_high + 0.5 * thick):
        yield _Box((x, side, 0.5 * height), (width, thick, height))


def _box_of(solid: Solid, low: float, high: float) -> _Box | None:
    """Return the box of a solid; None if the solid is not a box."""
    corners = solid.polygon
    if len(corners) != 4 or solid.holes:
        return None
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    length, depth = math.hypot(*first), math.hypot(*second)
    fourth = np.abs(corners[0] + first + second - corners[2]).max()
    if fourth > _STRAIGHT or min(length, depth) == 0.0:
        return None
    if abs(float(first @ second)) > _STRAIGHT * max(length, depth):
        return None
    x, y = corners.mean(axis=0).tolist()
    return _Box((x, y, 0.5 * (low + high)), (length, depth, high - low), math.atan2(first[1], first[0]))


def _cell_boxes(cells: Raster, height: float) -> Iterator[_Box]:
    """Yield boxes that cover the solid cells of a raster."""
    side, (x, y) = cells.resolution, cells.origin
    for row, column, end_row, end_column in rectangles_of(cells.solid != 0).tolist():
        centre = (x + 0.5 * side * (column + end_column), y + 0.5 * side * (row + end_row), 0.5 * height)
        yield _Box(centre, (side * (end_column - column), side * (end_row - row), height))


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))


SUBSTEP = 1.0 / 240.0
"""Length of a substep, at most [s]."""

GRAVITY = 9.81
"""Gravity of the Earth [m/s2]."""

HALF_OPEN, AWAY_M = 0.5, -10.0
"""A leaf that is open by this share is taken away, to this height [m]."""

RAYS_AT_ONCE = 16_000
"""Rays of a call, of which PyBullet takes 16,384 at most."""

_JOINTS = (LEFT, RIGHT)

_FASTEST_WHEEL = 1e6
"""Bound of the turn rate of wheels [rad/s]; that of Bullet, 100, is below what small wheels need."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Position and motion of a body.

    Attributes
    ----------
    place : (3,) float64
        Position of its frame, which lies on the ground between its wheels [m].
    axes : (3, 3) float64
        Its axes x, y, z in the columns.
    velocity, turning : (3,) of float
        Velocity of its centre of mass [m/s], and angular velocity around the axes of the world [rad/s].
    """

    place: NDArray[np.float64]
    axes: NDArray[np.float64]
    velocity: tuple[float, float, float]
    turning: tuple[float, float, float]


class Bodies:
    """The floor and the robots of one episode after another.

    Parameters
    ----------
    team : sequence of Robot
        The robots.
    time_step : float
        Length of a step [s].
    is_shown : bool
        Whether they are shown in a window.

    Attributes
    ----------
    client : Client
        Their server.
    """

    def __init__(self, team: Sequence[Robot], time_step: float, is_shown: bool = False) -> None:
        self.client, self.team, self._time_step = Client(is_shown), team, time_step
        self._substeps = max(math.ceil(time_step / SUBSTEP - 1e-9), 1)
        self._ground, self._robots = -1, [-1] * len(team)
        self._wheel_radii = np.array([robot.build.wheel_radius for robot in team]).reshape(-1, 1)
        self._angles = np.zeros((len(team), 2))
        self._people: list[int] = []
        self._leaves: list[int] = []

    def begin(self, floor: Floor, starts: NDArray[np.float64]) -> None:
        """Put robots at rest at ``starts`` (robots, 3) of a floor; nothing of before is left."""
        client, bullet = self.client, self.client.bullet
        client.call("resetSimulation")
        client.call("setGravity", 0.0, 0.0, -GRAVITY)
        client.call(
            "setPhysicsEngineParameter",
            fixedTimeStep=self._time_step,
            numSubSteps=self._substeps,
            enableFileCaching=0,
            deterministicOverlappingPairs=1,
        )
        self._ground = client.call("createMultiBody", 0.0, client.call("createCollisionShape", bullet.GEOM_PLANE))
        client.call("changeDynamics", self._ground, -1, lateralFriction=1.0)
        shapes = FloorShapes.of(floor)
        client.load_text(shapes.urdf, useFixedBase=True)
        if shapes.prisms:
            client.call("changeDynamics", client.load_pieces(shapes.obj), -1, lateralFriction=1.0)
        for robot in range(len(self.team)):
            self._robots[robot] = client.load_text(urdf_of(self.team[robot]), flags=bullet.URDF_USE_INERTIA_FROM_FILE)
            for link in range(-1, 3):
                client.call(
                    "changeDynamics",
                    self._robots[robot],
                    link,
                    linearDamping=0.0,
                    angularDamping=0.0,
                    maxJointVelocity=_FASTEST_WHEEL,
                )
            self.put(robot, starts[robot])
        # Wheels that hang in the air by a hair would slip in the first step.
        self.step(np.zeros((len(self.team), 2)))

    def add_crowd(self, crowd: Crowd) -> None:
        """Add people, and leaves of doors, as bodies that nothing moves but `move_crowd`."""
        client, bullet = self.client, self.client.bullet
        self._people, self._leaves = [], []
        for radius in crowd.people[:, 2].tolist():
            shape = client.call("createCollisionShape", bullet.GEOM_CYLINDER, radius=radius, height=PERSON_HEIGHT_M)
            self._people.append(client.call("createMultiBody", 0.0, shape))
        for x, y, to_x, to_y in crowd.doors.tolist():
            half = (0.5 * math.hypot(to_x - x, to_y - y), LEAF, 0.5 * LEAF_HEIGHT_M)
            shape = client.call("createCollisionShape", bullet.GEOM_BOX, halfExtents=half)
            self._leaves.append(client.call("createMultiBody", 0.0, shape))
        self.move_crowd(crowd)

    def move_crowd(self, crowd: Crowd) -> None:
        """Put people where they are, and leaves of doors into their openings until they are half open."""
        for body, (x, y, _) in zip(self._people, crowd.people.tolist(), strict=True):
            place, turn = (x, y, 0.5 * PERSON_HEIGHT_M), (0.0, 0.0, 0.0, 1.0)
            self.client.call("resetBasePositionAndOrientation", body, place, turn)
        for body, (x, y, to_x, to_y), share in zip(
            self._leaves, crowd.doors.tolist(), crowd.opened.tolist(), strict=True
        ):
            half = 0.5 * math.atan2(to_y - y, to_x - x)
            height = 0.5 * LEAF_HEIGHT_M if share < HALF_OPEN else AWAY_M
            place = (0.5 * (x + to_x), 0.5 * (y + to_y), height)
            turn = (0.0, 0.0, math.sin(half), math.cos(half))
            self.client.call("resetBasePositionAndOrientation", body, place, turn)

    def put(self, robot: int, pose: NDArray[np.float64]) -> None:
        """Put a robot upright and at rest at x, y, theta [m, rad]."""
        x, y, theta = pose.tolist()
        turn = (0.0, 0.0, math.sin(0.5 * theta), math.cos(0.5 * theta))
        body, height = self._robots[robot], self.team[robot].build.mass_height
        self.client.call("resetBasePositionAndOrientation", body, (x, y, height), turn)
        self.client.call("resetBaseVelocity", body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        for joint in _JOINTS:
            self.client.call("resetJointState", body, joint, 0.0, 0.0)
        self._angles[robot] = 0.0

    def step(self, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Drive for a time step with motors that want speeds (robots, 2) of left and right wheels [m/s].

        Returns the speeds at which the wheels turned on average, (robots, 2) [m/s].
        """
        client, bullet = self.client, self.client.bullet
        for robot, wanted in enumerate((speeds / self._wheel_radii).tolist()):
            # PyBullet allows a motor the impulse of a whole step in each substep.
            torque = self.team[robot].build.motor_torque / self._substeps
            client.call(
                "setJointMotorControlArray",
                self._robots[robot],
                _JOINTS,
                bullet.VELOCITY_CONTROL,
                targetVelocities=wanted,
                forces=(torque, torque),
            )
        client.call("stepSimulation")
        states = [client.call("getJointStates", body, _JOINTS) for body in self._robots]
        angles = np.array([[state[0] for state in pair] for pair in states]).reshape(-1, 2)
        turned, self._angles = angles - self._angles, angles
        return np.asarray(turned * self._wheel_radii / self._time_step)

    def motion(self, robot: int) -> Motion:
        """Return the position and motion of a robot."""
        body, client = self._robots[robot], self.client
        centre, turn = client.call("getBasePositionAndOrientation", body)
        velocity, turning = client.call("getBaseVelocity", body)
        axes = np.array(client.bullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
        place = np.array(centre) - self.team[robot].build.mass_height * axes[:, 2]
        return Motion(place, axes, velocity, turning)

    def touched(self, robot: int) -> list[tuple[float, float]]:
        """Return x, y [m] of all points in which a robot touches anything but the ground."""
        points: list[tuple[Any, ...]] = self.client.call("getContactPoints", bodyA=self._robots[robot])
        found = []
        for _, body, other, _, _, on_body, on_other, _, distance, force, *_ in points:
            if self._ground not in (body, other) and (force > 0.0 or distance < 0.0):
                place = on_body if body == self._robots[robot] else on_other
                found.append((place[0], place[1]))
        return found

    def push(self, robot: int, force: Sequence[float], height: float) -> None:
        """Push a robot by a force [N] at a height above its frame [m] in the next substep."""
        motion = self.motion(robot)
        place = motion.place + height * motion.axes[:, 2]
        bullet = self.client.bullet
        self.client.call("applyExternalForce", self._robots[robot], -1, force, place.tolist(), bullet.WORLD_FRAME)

    def rays(self, begins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shares of rays (N, 3) at which they meet anything, (N,); 1 if they meet nothing."""
        shares: list[float] = []
        for first in range(0, len(begins), RAYS_AT_ONCE):
            some = slice(first, first + RAYS_AT_ONCE)
            hits = self.client.call("rayTestBatch", begins[some].tolist(), ends[some].tolist(), numThreads=1)
            shares += [hit[2] for hit in hits]
        return np.array(shares)

    def close(self) -> None:
        """End the server; closing again does nothing."""
        self.client.close()

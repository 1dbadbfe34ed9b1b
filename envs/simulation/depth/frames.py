"""Depth images of robots: poses of the cameras, true depths, noise."""

import math
from typing import Annotated, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.faces import Faces
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.simulation.depth.body_drawing import draw_body, draw_leaf
from lidarium.envs.simulation.depth.face_drawing import (
    CORNERS,
    DEPTH_MAX,
    DEPTH_MIN,
    FaceArrays,
    draw_faces,
    new_span,
)
from lidarium.envs.simulation.disturbances.noise import GAUSSIAN_TABLE, gaussian_at, mix, stream_key
from lidarium.envs.simulation.disturbances.odometry import HEIGHT, RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    DOOR_NUMBERS,
    LEAF_HEIGHT_M,
    PERSON_HEIGHT_M,
    WALKER_NUMBERS,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
)
from lidarium.envs.simulation.kernels.contact import has_leaf, leaf_of
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.faces import PIXELS
from lidarium.mapping.kernels.views import grid_at, scratch_grid, scratch_vector, vector_at

DEPTH_STREAM = 0x64657074
"""Sets the draws of cameras apart from those of the laser."""

FORWARD, LEFT, UP, PITCH, PAN = range(5)
"""Places in the numbers of a mount."""

NOISE_FLOOR, NOISE_SHARE, DISPARITY_STEP = range(3)
"""Places in the numbers of the noise."""

FACE_CORNERS, FACE_PLANES, FACE_SPHERES, FACE_COUNT = range(4)
"""Columns of ``Cameras.face_rows``."""


class Cameras(NamedTuple):
    """The cameras of all robots for kernels; row = episode * robots + robot.

    Attributes
    ----------
    poses, attitudes : (rows, 3) float64
        x, y, theta of the robots, and the height of their bases, roll, pitch [m, rad].
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot of a team.
    face_rows : (episodes, 4) int64
        Addresses of corners, planes and spheres of each episode's faces, and their number.
    pinhole, mount, noise : (7,), (5,), (3,) float64
        Numbers of the camera.
    seeds, steps : (episodes,) uint64, (episodes,) int64
        Seeds of the noise.
    noise_table : (4096,) float32
        ``GAUSSIAN_TABLE``.
    walkers, doors : (episodes * people, 11), (episodes * doors, 7) float64
        People and doors (``kernels.arrays``); none by default.
    """

    poses: Annotated[Array, np.float64, 2]
    attitudes: Annotated[Array, np.float64, 2]
    bodies: Annotated[Array, np.float64, 2]
    face_rows: Annotated[Array, np.int64, 2]
    pinhole: Annotated[Array, np.float64, 1]
    mount: Annotated[Array, np.float64, 1]
    noise: Annotated[Array, np.float64, 1]
    seeds: Annotated[Array, np.uint64, 1]
    steps: Annotated[Array, np.int64, 1]
    noise_table: Annotated[Array, np.float32, 1]
    walkers: Annotated[Array, np.float64, 2] = np.zeros((0, WALKER_NUMBERS))
    doors: Annotated[Array, np.float64, 2] = np.zeros((0, DOOR_NUMBERS))


def view_numbers(camera: DepthCamera) -> NDArray[np.float64]:
    """Return the parameters of a camera for the drawing kernels, shape (7,)."""
    pinhole = camera.intrinsics
    return np.array(
        [
            pinhole.fx,
            pinhole.cx,
            pinhole.cy,
            camera.depth_min,
            camera.depth_max,
            float(camera.columns),
            float(camera.rows),
        ]
    )


@kernel(nrt=False)
def _rotate(roll: float, pitch: float, yaw: float, rotation: Array) -> None:
    """Write the rotation by roll, pitch and yaw about x, y and z, in this order, into (3, 3)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = -sp, cp * sr, cp * cr


@kernel(nrt=False)
def place_camera(pose: Array, attitude: Array, mount: Array, axes: Array, eye: Array) -> None:
    """Write the optical axes (right, down, ahead) and the optical centre of a robot's camera.

    ``axes`` is (3, 3) in the world, ``eye`` (3,) [m].
    """
    body, own = scratch_grid(3, 3, np.float64), scratch_grid(3, 3, np.float64)
    _rotate(attitude[1], attitude[2], pose[2], body)
    _rotate(0.0, mount[PITCH], mount[PAN], own)
    for k in range(3):
        eye[k] = body[k, 0] * mount[FORWARD] + body[k, 1] * mount[LEFT] + body[k, 2] * mount[UP]
        for axis in range(3):
            # x of the mount is ahead, y to the left and z up; images have x to the right and y down.
            sum_of = body[k, 0] * own[0, axis] + body[k, 1] * own[1, axis] + body[k, 2] * own[2, axis]
            if axis == 0:
                axes[2, k] = sum_of
            else:
                axes[axis - 1, k] = -sum_of
    eye[0] += pose[0]
    eye[1] += pose[1]
    eye[2] += attitude[0]


@kernel(nrt=False)
def _measure_depth(inverse: Array, view: Array, depth: Array) -> None:
    """Write depths of inverse depths; 0 if out of range."""
    nearest, farthest = np.float32(1.0 / max(view[DEPTH_MIN], 1e-9)), np.float32(1.0 / view[DEPTH_MAX])
    one, nothing = np.float32(1.0), np.float32(0.0)
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            value = inverse[row, column]
            is_measured = (value > farthest) & (value <= nearest)
            depth[row, column] = one / value if is_measured else nothing


@kernel(nrt=False)
def _disturb_depth(cameras: Cameras, key: np.uint32, depth: Array) -> None:
    """Add noise to depths and round their inverses."""
    noise, low, high = cameras.noise, cameras.pinhole[DEPTH_MIN], cameras.pinhole[DEPTH_MAX]
    step = noise[DISPARITY_STEP]
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            true_depth = float(depth[row, column])
            if true_depth == 0.0:
                continue
            draw = gaussian_at(key, cameras.noise_table, row * depth.shape[1] + column)
            deviation = noise[NOISE_FLOOR] + noise[NOISE_SHARE] * (true_depth - low) ** 2
            measured = max(true_depth + deviation * draw, 1e-3)
            if step > 0.0:
                measured = 1.0 / (max(math.floor(1.0 / (measured * step) + 0.5), 1.0) * step)
            depth[row, column] = np.float32(min(max(measured, low), high))


@kernel
def draw_view(faces: FaceArrays, axes: Array, eye: Array, view: Array, inverse: Array) -> None:
    """Draw faces into inverse depths that begin at the farthest depth."""
    inverse[:] = np.float32(1.0 / view[DEPTH_MAX])
    draw_faces(faces, axes, eye, view, new_span(inverse.shape[0]), inverse)


@kernel
def _faces_at(row: Array) -> FaceArrays:
    count = row[FACE_COUNT]
    corners = vector_at(row[FACE_CORNERS], count * CORNERS * 3, np.float64).reshape((count, CORNERS, 3))
    return FaceArrays(
        corners,
        grid_at(row[FACE_PLANES], count, 4, np.float64),
        grid_at(row[FACE_SPHERES], count, 4, np.float64),
    )


@kernel(nrt=False)
def _draw_crowd(cameras: Cameras, episode: int, axes: Array, eye: Array, inverse: Array) -> None:
    """Draw the people and the leaves of doors of an episode into inverse depths."""
    episodes, centre = cameras.steps.shape[0], scratch_vector(3, np.float64)
    people, doors = cameras.walkers.shape[0] // episodes, cameras.doors.shape[0] // episodes
    for person in range(episode * people, (episode + 1) * people):
        walker = cameras.walkers[person]
        centre[0], centre[1], centre[2] = walker[WALKER_X], walker[WALKER_Y], 0.0
        draw_body(centre, walker[WALKER_RADIUS], PERSON_HEIGHT_M, axes, eye, cameras.pinhole, inverse)
    for door in range(episode * doors, (episode + 1) * doors):
        if has_leaf(cameras.doors[door]):
            draw_leaf(leaf_of(cameras.doors[door]), LEAF_HEIGHT_M, axes, eye, cameras.pinhole, inverse)


@kernel
def _take_frame(cameras: Cameras, row: int, robots: int, depth: Array) -> None:
    """Take the image of a robot's camera into ``depth`` (rows, columns) float32."""
    episode, first = row // robots, row // robots * robots
    axes, eye = np.empty((3, 3)), np.empty(3)
    place_camera(cameras.poses[row], cameras.attitudes[row], cameras.mount, axes, eye)
    inverse = np.empty((depth.shape[0], (depth.shape[1] + PIXELS - 1) // PIXELS * PIXELS), np.float32)
    draw_view(_faces_at(cameras.face_rows[episode]), axes, eye, cameras.pinhole, inverse)
    centre = np.empty(3)
    for other in range(first, first + robots):
        if other != row:
            centre[0], centre[1] = cameras.poses[other, 0], cameras.poses[other, 1]
            centre[2] = cameras.attitudes[other, 0]
            body = cameras.bodies[other - first]
            draw_body(centre, body[RADIUS], body[HEIGHT], axes, eye, cameras.pinhole, inverse)
    _draw_crowd(cameras, episode, axes, eye, inverse)
    _measure_depth(inverse, cameras.pinhole, depth)
    if cameras.noise[NOISE_FLOOR] > 0.0 or cameras.noise[NOISE_SHARE] > 0.0 or cameras.noise[DISPARITY_STEP] > 0.0:
        key = stream_key(cameras.seeds[episode], row - first, cameras.steps[episode])
        _disturb_depth(cameras, mix(key ^ np.uint32(DEPTH_STREAM)), depth)


def _take_frames(cameras: Cameras, robots: int, takes: Array, frames: Array) -> None:
    """Take the images of the rows that ``takes`` (rows,) names into ``frames`` (rows, rows, columns)."""
    for row in numba.prange(takes.shape[0]):
        if takes[row]:
            _take_frame(cameras, row, robots, frames[row])


def image_of(
    faces: Faces,
    poses: NDArray[np.float64],
    attitudes: NDArray[np.float64],
    bodies: NDArray[np.float64],
    robot: int,
    camera: DepthCamera,
) -> NDArray[np.float32]:
    """Return the depth image of one robot of a team without noise.

    Parameters
    ----------
    poses, attitudes : (robots, 3) float64
        Of the robots, see ``World``.
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each.

    Returns
    -------
    (rows, columns) float32
        Depths [m]; 0 for no measurement.
    """
    arrays = (faces.corners, faces.planes, faces.spheres)
    cameras = Cameras(
        np.ascontiguousarray(poses),
        np.ascontiguousarray(attitudes),
        bodies,
        np.array([[*(array.ctypes.data for array in arrays), len(faces)]], np.int64),
        view_numbers(camera),
        camera.mount,
        np.zeros(3),
        np.zeros(1, np.uint64),
        np.zeros(1, np.int64),
        GAUSSIAN_TABLE,
    )
    frames = np.zeros((len(poses), camera.rows, camera.columns), np.float32)
    take_frames_serial(cameras, len(poses), np.arange(len(poses)) == robot, frames)
    return np.asarray(frames[robot])


take_frames_serial = kernel(_take_frames)
take_frames_parallel = kernel(parallel=True)(_take_frames)

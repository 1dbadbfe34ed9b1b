"""Contact of discs with solid cells and with each other, exact.

A disc is pushed out of a solid along the shortest path, so that it slides along walls.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    DOOR_END_X,
    DOOR_END_Y,
    DOOR_KIND,
    DOOR_NUMBERS,
    DOOR_OPEN,
    DOOR_X,
    DOOR_Y,
    FRAME_RESOLUTION,
    FRAME_X,
    FRAME_Y,
    MET_PERSON,
    NO_DOOR,
    SAFETY_NUMBERS,
    WALKER_NUMBERS,
    WALKER_RADIUS,
    WALKER_X,
    WALKER_Y,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import vector_at

CONTACT_TOLERANCE = 1e-9
"""Gap that is left when a disc is pushed out of contact [m]."""

PRESSED = 1e-6
"""A disc that had to be pushed out by more than this touched something [m]."""

_AT_ONCE = 8
"""Cells of a row that are examined together: most around a body are free."""

CENTRE_BUMPER, SIDE_BUMPER = math.radians(30.0), math.radians(90.0)
"""Bearings of a contact up to which it presses a bumper [rad].

The first is for the centre bumper, the second for the one on the contact's side.
"""


class BodyGrids(NamedTuple):
    """A floor at the height of the bodies.

    Attributes
    ----------
    bound, solid : (rows, columns) uint8
        ``distance_bound``, and 1 if the floor is solid.
    frame : (3,) float64
        Origin x, y [m] and resolution [m/cell] of the raster.
    """

    bound: Array
    solid: Array
    frame: Array


LEAF = 0.02
"""Half the thickness of a door's leaf [m]."""

SHUT_ENOUGH = 0.99
"""A door that is open by more than this share has no leaf in its opening."""


class TeamBodies(NamedTuple):
    """The bodies of one episode's robots, and what else moves around them.

    Attributes
    ----------
    bodies : (robots, 8) float64
        ``Robot.numbers`` of each robot.
    moves : (robots,) uint8
        Whether the robot drives; the others keep their positions.
    poses, velocities : (robots, 3), (robots, 2) float64
        x, y, theta and speed, turn rate.
    bumpers : (robots, 3) int8
        Left, centre, right; 1 if pressed in this step.
    contacts : (robots,) uint8
        Whether the robot touched anything in this step.
    travelled : (robots,) float64
        Length of each robot's path [m].
    collisions : (robots,) int64
        Number of contacts of each robot.
    walkers, doors : (people, 11), (doors, 7) float64
        People and doors; none by default.
    safety : (robots, 11) float64
        Where contacts with people are noted; only needed with people.
    """

    bodies: Array
    moves: Array
    poses: Array
    velocities: Array
    bumpers: Array
    contacts: Array
    travelled: Array
    collisions: Array
    walkers: Array = np.zeros((0, WALKER_NUMBERS))
    doors: Array = np.zeros((0, DOOR_NUMBERS))
    safety: Array = np.zeros((0, SAFETY_NUMBERS))


def distance_bound(solid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a lower bound of the distance to the nearest solid cell.

    It holds from any point of each cell, in whole cells.

    Parameters
    ----------
    solid : (rows, columns) uint8
        1 if the world is solid.

    Returns
    -------
    (rows, columns) uint8
        Floor of the distance between cell centres less a cell's diagonal, within [0, 255].
    """
    centres = cv2.distanceTransform((solid == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)  # within 3e-5
    return np.asarray(np.clip(np.floor(centres - math.sqrt(2.0) - 1e-4), 0, 255), np.uint8)


@kernel(forceinline=True)
def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi]."""
    turned = angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
    return math.pi if turned <= -math.pi else turned


@kernel(nrt=False)
def deepest_wall(solid: Array, x: float, y: float, radius: float) -> tuple[float, float, float]:
    """Find the solid cell that a disc enters deepest; positions and radius in cells."""
    rows, columns = solid.shape
    depth, normal_x, normal_y = 0.0, 0.0, 0.0
    low_row, high_row = max(int(y - radius), 0), min(int(y + radius), rows - 1)
    low_column, high_column = max(int(x - radius), 0), min(int(x + radius), columns - 1)
    size = rows * columns
    for row in range(low_row, high_row + 1):
        gap_y = y - min(max(y, float(row)), row + 1.0)
        if gap_y * gap_y >= (radius - depth) ** 2:
            continue
        column = low_column - 1
        while column < high_column:
            column += 1
            place = row * columns + column
            if place + _AT_ONCE <= size and vector_at(solid.ctypes.data + place, 1, np.uint64)[0] == np.uint64(0):
                column += _AT_ONCE - 1
                continue
            if solid[row, column] == 0:
                continue
            gap_x = x - min(max(x, float(column)), column + 1.0)
            squared = gap_x * gap_x + gap_y * gap_y
            if squared >= (radius - depth) ** 2:
                continue
            distance = math.sqrt(squared)
            depth = radius - distance
            if distance > 0.0:
                normal_x, normal_y = gap_x / distance, gap_y / distance
            else:
                normal_x, normal_y = 0.0, 0.0
    return depth, normal_x, normal_y


@kernel(nrt=False)
def _deepest_robot(team: TeamBodies, robot: int, x: float, y: float) -> tuple[float, float, float]:
    """Find the robot that the disc of ``robot`` at x, y [m] enters deepest."""
    poses, bodies = team.poses, team.bodies
    depth, normal_x, normal_y = 0.0, 0.0, 0.0
    for other in range(poses.shape[0]):
        if other == robot:
            continue
        gap_x, gap_y = x - poses[other, 0], y - poses[other, 1]
        reach = bodies[robot, RADIUS] + bodies[other, RADIUS]
        squared = gap_x * gap_x + gap_y * gap_y
        if squared >= (reach - depth) ** 2:
            continue
        distance = math.sqrt(squared)
        depth = reach - distance
        if distance > 0.0:
            normal_x, normal_y = gap_x / distance, gap_y / distance
    return depth, normal_x, normal_y


@kernel(nrt=False)
def leaf_of(door: Array) -> tuple[float, float, float, float]:
    """Return the ends of the part of a door's leaf that stands in the opening [m]; it slides away to its first end."""
    shut = 1.0 - door[DOOR_OPEN]
    x, y = door[DOOR_X], door[DOOR_Y]
    return x, y, x + shut * (door[DOOR_END_X] - x), y + shut * (door[DOOR_END_Y] - y)


@kernel(forceinline=True, nrt=False)
def has_leaf(door: Array) -> bool:
    """Whether any of a door's leaf stands in its opening."""
    return bool(door[DOOR_KIND] != NO_DOOR and door[DOOR_OPEN] < SHUT_ENOUGH)


@kernel(nrt=False)
def deepest_leaf(doors: Array, x: float, y: float, radius: float) -> tuple[float, float, float]:
    """Find the door's leaf that a disc at x, y [m] enters deepest."""
    depth, normal_x, normal_y = 0.0, 0.0, 0.0
    for door in range(doors.shape[0]):
        if not has_leaf(doors[door]):
            continue
        from_x, from_y, to_x, to_y = leaf_of(doors[door])
        along_x, along_y = to_x - from_x, to_y - from_y
        squared = along_x * along_x + along_y * along_y
        share = min(max(((x - from_x) * along_x + (y - from_y) * along_y) / squared, 0.0), 1.0)
        gap_x, gap_y = x - from_x - share * along_x, y - from_y - share * along_y
        distance = math.sqrt(gap_x * gap_x + gap_y * gap_y)
        if radius + LEAF - distance > depth:
            depth = radius + LEAF - distance
            if distance > 0.0:
                normal_x, normal_y = gap_x / distance, gap_y / distance
    return depth, normal_x, normal_y


@kernel(nrt=False)
def deepest_person(walkers: Array, own: int, x: float, y: float, radius: float) -> tuple[float, float, float]:
    """Find the person, other than number ``own``, that a disc at x, y [m] enters deepest."""
    depth, normal_x, normal_y = 0.0, 0.0, 0.0
    for other in range(walkers.shape[0]):
        gap_x, gap_y = x - walkers[other, WALKER_X], y - walkers[other, WALKER_Y]
        reach = radius + walkers[other, WALKER_RADIUS]
        squared = gap_x * gap_x + gap_y * gap_y
        if other == own or squared >= (reach - depth) ** 2:
            continue
        distance = math.sqrt(squared)
        depth = reach - distance
        if distance > 0.0:
            normal_x, normal_y = gap_x / distance, gap_y / distance
    return depth, normal_x, normal_y


@kernel(nrt=False)
def is_free_of_contact(grids: BodyGrids, team: TeamBodies, robot: int, x: float, y: float, margin: float) -> bool:
    """Whether nothing is within ``margin`` [m] of the disc at x, y, by bounds alone."""
    bound, frame, poses, bodies = grids.bound, grids.frame, team.poses, team.bodies
    resolution = frame[FRAME_RESOLUTION]
    radius = bodies[robot, RADIUS] + margin
    column, row = int((x - frame[FRAME_X]) / resolution), int((y - frame[FRAME_Y]) / resolution)
    if row < 0 or row >= bound.shape[0] or column < 0 or column >= bound.shape[1]:
        return False
    if bound[row, column] * resolution <= radius:
        return False
    for other in range(poses.shape[0]):
        reach = radius + bodies[other, RADIUS]
        if other != robot and (x - poses[other, 0]) ** 2 + (y - poses[other, 1]) ** 2 <= reach * reach:
            return False
    if team.walkers.shape[0] > 0 and deepest_person(team.walkers, -1, x, y, radius)[0] > 0.0:
        return False
    return not (team.doors.shape[0] > 0 and deepest_leaf(team.doors, x, y, radius)[0] > 0.0)


@kernel(nrt=False)
def push_out(
    grids: BodyGrids, team: TeamBodies, robot: int, x: float, y: float, heading: float
) -> tuple[float, float, bool, bool]:
    """Push the disc out of walls, robots, people and doors.

    Returns x, y [m], whether it touched, and whether it is free now; presses the bumpers on the sides of contact.
    """
    frame, bumpers = grids.frame, team.bumpers[robot]
    resolution = frame[FRAME_RESOLUTION]
    radius = team.bodies[robot, RADIUS]
    touched = False
    for _ in range(8):
        cell_x, cell_y = (x - frame[FRAME_X]) / resolution, (y - frame[FRAME_Y]) / resolution
        depth, normal_x, normal_y = deepest_wall(grids.solid, cell_x, cell_y, radius / resolution)
        depth *= resolution
        robot_depth, robot_x, robot_y = _deepest_robot(team, robot, x, y)
        if robot_depth > depth:
            depth, normal_x, normal_y = robot_depth, robot_x, robot_y
        is_person = False
        if team.walkers.shape[0] > 0:
            person_depth, person_x, person_y = deepest_person(team.walkers, -1, x, y, radius)
            if person_depth > depth:
                depth, normal_x, normal_y, is_person = person_depth, person_x, person_y, True
        if team.doors.shape[0] > 0:
            leaf_depth, leaf_x, leaf_y = deepest_leaf(team.doors, x, y, radius)
            if leaf_depth > depth:
                depth, normal_x, normal_y, is_person = leaf_depth, leaf_x, leaf_y, False
        if depth <= 0.0:
            return x, y, touched, True
        if depth > PRESSED:
            touched = True
            if is_person:
                team.safety[robot, MET_PERSON] = 1.0
            side = wrapped(math.atan2(-normal_y, -normal_x) - heading)
            if abs(side) <= CENTRE_BUMPER:
                bumpers[1] = 1
            elif abs(side) <= SIDE_BUMPER:
                bumpers[0 if side > 0.0 else 2] = 1
        if normal_x == 0.0 and normal_y == 0.0:
            return x, y, touched, False
        x += normal_x * (depth + CONTACT_TOLERANCE)
        y += normal_y * (depth + CONTACT_TOLERANCE)
    return x, y, touched, False

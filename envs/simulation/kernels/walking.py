"""How people walk, in kernels: each towards a place, round the others, robots and walls.

The rule is optimal reciprocal collision avoidance (ORCA): van den Berg, Guy, Lin, Manocha, "Reciprocal n-body
collision avoidance", Robotics Research 2011; the linear programs follow its published algorithm. Of two people each
takes half of the avoidance, of a person and a robot the person takes all. A wall is a half-plane too: the nearest one.
Whatever the rule says, no person ends a step inside a wall, another person, a robot or a door's leaf.
"""

import math

import numpy as np

from lidarium.envs.simulation.disturbances.noise import mix, stream_key
from lidarium.envs.simulation.disturbances.odometry import RADIUS
from lidarium.envs.simulation.kernels.arrays import (
    BY_PERSON,
    CLOSEST,
    CLOSEST_SPEED,
    ENDED,
    FRAME_RESOLUTION,
    FRAME_X,
    FRAME_Y,
    IS_NEAR,
    NEAR_M,
    NEAR_MISSES,
    NEAR_SPEED,
    NEAR_STEPS,
    TIME_STEP,
    WALKER_DRAWS,
    WALKER_PLACE,
    WALKER_RADIUS,
    WALKER_SPEED,
    WALKER_STUCK,
    WALKER_TOUCHED,
    WALKER_VX,
    WALKER_VY,
    WALKER_WAIT,
    WALKER_X,
    WALKER_Y,
    WALKWAY_BOUND,
    WALKWAY_CELL,
    WALKWAY_CLEARANCE,
    WALKWAY_COLUMNS,
    WALKWAY_COUNT,
    WALKWAY_HEADINGS,
    WALKWAY_PLACES,
    WALKWAY_ROWS,
    WALKWAY_SOLID,
    WorldArrays,
    doors_of,
    walkers_of,
)
from lidarium.envs.simulation.kernels.contact import (
    CONTACT_TOLERANCE,
    PRESSED,
    deepest_leaf,
    deepest_person,
    deepest_wall,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at, scratch_grid, vector_at

NO_WAY = 255
"""Heading of cells without a way."""

HEADINGS = 255
"""Number of headings in a turn."""

HORIZON_S = 2.0
"""People avoid what they would meet within this time [s]."""

WALL_HORIZON_S = 0.4
"""They approach a wall no faster than to meet it after this time [s]."""

SIGHT_M = 3.5
"""They avoid others within this distance, centre to centre [m]."""

MOST_AVOIDED = 24
"""Maximum number of others that a person avoids at once."""

PERSONAL_M, ROBOT_M = 0.05, 0.15
"""Gap that people keep to each other and to robots if they can [m]."""

ACCELERATION = 4.0
"""Greatest change of a person's velocity [m/s2]."""

ARRIVED_M = 0.6
"""A place is reached within this distance [m]."""

LONGEST_STAY_S = 8.0
"""People stay at a place for up to this time [s]."""

GIVE_WAY = 0.3
"""People take robots to drive ahead at this speed, or faster [m/s]."""

PATIENCE_S, LEAST_PROGRESS = 2.0, 0.15
"""Who is slower than this share of the own speed for so long turns back and goes elsewhere [s, 1]."""

TRIES = 4
"""How often a person is pushed out of contact before the step is undone."""

_STREAM = 4096
"""First number of the streams of people; those of robots' noise are below 64."""

_EPSILON = 1e-5


@kernel(forceinline=True, nrt=False)
def _draw(seed: int, person: int, draws: int, what: int) -> float:
    """Return a number in [0, 1) by counter."""
    key = mix(np.uint32(stream_key(seed, _STREAM + person, draws) ^ np.uint32(0x9E3779B9 * (what + 1) & 0xFFFFFFFF)))
    return float(key) / 4294967296.0


@kernel(nrt=False)
def _choose_place(walker: Array, seed: int, person: int, places: int) -> None:
    """Let a person go to another place."""
    walker[WALKER_DRAWS] += 1.0
    draw = int(_draw(seed, person, int(walker[WALKER_DRAWS]), 0) * (places - 1)) if places > 1 else 0
    walker[WALKER_PLACE] = float((int(walker[WALKER_PLACE]) + 1 + draw) % places)
    walker[WALKER_STUCK] = 0.0


@kernel(forceinline=True, nrt=False)
def _heading_to(walkway: Array, frame: Array, place: int, x: float, y: float) -> int:
    """Return the heading of the way from x, y [m] to a place, in parts of a turn, or ``NO_WAY``."""
    side = frame[FRAME_RESOLUTION] * walkway[WALKWAY_CELL]
    rows, columns = walkway[WALKWAY_ROWS] // walkway[WALKWAY_CELL], walkway[WALKWAY_COLUMNS] // walkway[WALKWAY_CELL]
    row = min(max(int((y - frame[FRAME_Y]) / side), 0), rows - 1)
    column = min(max(int((x - frame[FRAME_X]) / side), 0), columns - 1)
    field = grid_at(walkway[WALKWAY_HEADINGS] + place * rows * columns, rows, columns, np.uint8)
    return int(field[row, column])


@kernel(nrt=False)
def _turn_back(world: WorldArrays, episode: int, robots: int, person: int) -> None:
    """Let a person who cannot get on go to a place whose way leads off from the nearest robot or other person."""
    walkers, walkway, frame = walkers_of(world, episode), world.walkways[episode], world.frames[episode]
    walker = walkers[person]
    x, y, nearest, away_x, away_y = walker[WALKER_X], walker[WALKER_Y], np.inf, 0.0, 0.0
    for row in range(episode * robots, (episode + 1) * robots):
        gap_x, gap_y = x - world.poses[row, 0], y - world.poses[row, 1]
        if gap_x * gap_x + gap_y * gap_y < nearest:
            nearest, away_x, away_y = gap_x * gap_x + gap_y * gap_y, gap_x, gap_y
    for other in range(walkers.shape[0]):
        gap_x, gap_y = x - walkers[other, WALKER_X], y - walkers[other, WALKER_Y]
        if other != person and gap_x * gap_x + gap_y * gap_y < nearest:
            nearest, away_x, away_y = gap_x * gap_x + gap_y * gap_y, gap_x, gap_y
    places = walkway[WALKWAY_COUNT]
    _choose_place(walker, world.seeds[episode], person, places)
    first = int(walker[WALKER_PLACE])
    for k in range(places):
        place = (first + k) % places
        heading = _heading_to(walkway, frame, place, x, y)
        angle = heading * (2.0 * math.pi / HEADINGS)
        if heading != NO_WAY and away_x * math.cos(angle) + away_y * math.sin(angle) > 0.0:
            walker[WALKER_PLACE] = float(place)
            return


@kernel(nrt=False)
def _wanted_velocity(
    walker: Array, walkway: Array, frame: Array, seed: int, person: int, step_s: float
) -> tuple[float, float]:
    """Return the velocity that a person would walk at alone [m/s]; take the next place at the one wanted."""
    places = walkway[WALKWAY_COUNT]
    goals = grid_at(walkway[WALKWAY_PLACES], places, 2, np.float64)
    if walker[WALKER_WAIT] > 0.0:
        walker[WALKER_WAIT] -= 1.0
        return 0.0, 0.0
    place, x, y, speed = int(walker[WALKER_PLACE]), walker[WALKER_X], walker[WALKER_Y], walker[WALKER_SPEED]
    gap_x, gap_y = goals[place, 0] - x, goals[place, 1] - y
    apart = math.hypot(gap_x, gap_y)
    if apart < ARRIVED_M:
        stay = _draw(seed, person, int(walker[WALKER_DRAWS]), 1) * LONGEST_STAY_S
        walker[WALKER_WAIT] = math.floor(stay / step_s)
        _choose_place(walker, seed, person, places)
        return 0.0, 0.0
    side = frame[FRAME_RESOLUTION] * walkway[WALKWAY_CELL]
    rows, columns = walkway[WALKWAY_ROWS] // walkway[WALKWAY_CELL], walkway[WALKWAY_COLUMNS] // walkway[WALKWAY_CELL]
    row = min(max(int((y - frame[FRAME_Y]) / side), 0), rows - 1)
    column = min(max(int((x - frame[FRAME_X]) / side), 0), columns - 1)
    field = grid_at(walkway[WALKWAY_HEADINGS] + place * rows * columns, rows, columns, np.uint8)
    heading = int(field[row, column])
    # Beside the ways, pushed close to a wall: the nearest cell around that has one.
    for reach in range(1, 5):
        if heading != NO_WAY:
            break
        nearest = 1e9
        for i in range(max(row - reach, 0), min(row + reach + 1, rows)):
            for j in range(max(column - reach, 0), min(column + reach + 1, columns)):
                off_x, off_y = frame[FRAME_X] + (j + 0.5) * side - x, frame[FRAME_Y] + (i + 0.5) * side - y
                if field[i, j] != NO_WAY and off_x * off_x + off_y * off_y < nearest:
                    nearest = off_x * off_x + off_y * off_y
                    angle = math.atan2(off_y, off_x) + 2.0 * math.pi
                    heading = int(np.rint(angle / (2.0 * math.pi) * HEADINGS)) % HEADINGS
    if heading == NO_WAY:
        return gap_x / apart * speed, gap_y / apart * speed
    angle = heading * (2.0 * math.pi / HEADINGS)
    return speed * math.cos(angle), speed * math.sin(angle)


@kernel(nrt=False)
def _along_line(
    lines: Array, k: int, radius: float, x: float, y: float, is_direction: bool
) -> tuple[bool, float, float]:
    """Return the best velocity on line ``k`` that the lines before it allow (one-dimensional program).

    A line is (point x, y, direction x, y); velocities left of it are allowed.
    """
    point_x, point_y, along_x, along_y = lines[k, 0], lines[k, 1], lines[k, 2], lines[k, 3]
    dot = point_x * along_x + point_y * along_y
    discriminant = dot * dot + radius * radius - point_x * point_x - point_y * point_y
    if discriminant < 0.0:
        return False, x, y
    root = math.sqrt(discriminant)
    low, high = -dot - root, -dot + root
    for other in range(k):
        denominator = along_x * lines[other, 3] - along_y * lines[other, 2]
        numerator = lines[other, 2] * (point_y - lines[other, 1]) - lines[other, 3] * (point_x - lines[other, 0])
        if abs(denominator) <= _EPSILON:
            if numerator < 0.0:
                return False, x, y
            continue
        at = numerator / denominator
        if denominator >= 0.0:
            high = min(high, at)
        else:
            low = max(low, at)
        if low > high:
            return False, x, y
    if is_direction:
        at = high if x * along_x + y * along_y > 0.0 else low
    else:
        at = min(max(along_x * (x - point_x) + along_y * (y - point_y), low), high)
    return True, point_x + at * along_x, point_y + at * along_y


@kernel(nrt=False)
def _within_lines(
    lines: Array, count: int, radius: float, x: float, y: float, is_direction: bool
) -> tuple[int, float, float]:
    """Return the allowed velocity nearest to x, y (two-dimensional program), and the first line that fails."""
    if is_direction:
        found_x, found_y = x * radius, y * radius
    else:
        length = math.hypot(x, y)
        scale = radius / length if length > radius else 1.0
        found_x, found_y = x * scale, y * scale
    for k in range(count):
        if lines[k, 2] * (lines[k, 1] - found_y) - lines[k, 3] * (lines[k, 0] - found_x) > 0.0:
            is_found, new_x, new_y = _along_line(lines, k, radius, x, y, is_direction)
            if not is_found:
                return k, found_x, found_y
            found_x, found_y = new_x, new_y
    return count, found_x, found_y


@kernel(nrt=False)
def _least_intrusion(
    lines: Array, walls: int, count: int, begin: int, radius: float, x: float, y: float
) -> tuple[float, float]:
    """Return the velocity that violates the lines of others least, those of walls not (three-dimensional program)."""
    other_lines = scratch_grid(MOST_AVOIDED + 2, 4, np.float64)
    distance = 0.0
    for k in range(begin, count):
        if lines[k, 2] * (lines[k, 1] - y) - lines[k, 3] * (lines[k, 0] - x) <= distance:
            continue
        for wall in range(walls):
            for axis in range(4):
                other_lines[wall, axis] = lines[wall, axis]
        made = walls
        for other in range(walls, k):
            determinant = lines[k, 2] * lines[other, 3] - lines[k, 3] * lines[other, 2]
            if abs(determinant) <= _EPSILON:
                if lines[k, 2] * lines[other, 2] + lines[k, 3] * lines[other, 3] > 0.0:
                    continue
                other_lines[made, 0] = 0.5 * (lines[k, 0] + lines[other, 0])
                other_lines[made, 1] = 0.5 * (lines[k, 1] + lines[other, 1])
            else:
                off_x, off_y = lines[k, 0] - lines[other, 0], lines[k, 1] - lines[other, 1]
                at = (lines[other, 2] * off_y - lines[other, 3] * off_x) / determinant
                other_lines[made, 0] = lines[k, 0] + at * lines[k, 2]
                other_lines[made, 1] = lines[k, 1] + at * lines[k, 3]
            along_x, along_y = lines[other, 2] - lines[k, 2], lines[other, 3] - lines[k, 3]
            length = math.hypot(along_x, along_y)
            if length <= _EPSILON:
                continue
            other_lines[made, 2], other_lines[made, 3] = along_x / length, along_y / length
            made += 1
        failed, new_x, new_y = _within_lines(other_lines, made, radius, -lines[k, 3], lines[k, 2], True)
        if failed == made:
            x, y = new_x, new_y
        distance = lines[k, 2] * (lines[k, 1] - y) - lines[k, 3] * (lines[k, 0] - x)
    return x, y


@kernel(nrt=False)
def _avoid(
    line: Array, walker: Array, x: float, y: float, vx: float, vy: float, reach: float, share: float, step_s: float
) -> None:
    """Write the half-plane of velocities that avoid a disc at x, y with velocity vx, vy.

    ``reach`` is the sum of the radii [m], ``share`` the part of the avoidance that this person takes.
    """
    gap_x, gap_y = x - walker[WALKER_X], y - walker[WALKER_Y]
    own_x, own_y = walker[WALKER_VX] - vx, walker[WALKER_VY] - vy
    squared = gap_x * gap_x + gap_y * gap_y
    if squared > reach * reach:
        from_x, from_y = own_x - gap_x / HORIZON_S, own_y - gap_y / HORIZON_S
        length = math.hypot(from_x, from_y)
        dot = from_x * gap_x + from_y * gap_y
        if dot < 0.0 and dot * dot > reach * reach * length * length:
            # Nearest is the round end of the velocity obstacle.
            unit_x, unit_y = from_x / length, from_y / length
            line[2], line[3] = unit_y, -unit_x
            push = reach / HORIZON_S - length
            push_x, push_y = push * unit_x, push * unit_y
        else:
            leg = math.sqrt(squared - reach * reach)
            if gap_x * from_y - gap_y * from_x > 0.0:
                line[2] = (gap_x * leg - gap_y * reach) / squared
                line[3] = (gap_x * reach + gap_y * leg) / squared
            else:
                line[2] = -(gap_x * leg + gap_y * reach) / squared
                line[3] = -(-gap_x * reach + gap_y * leg) / squared
            dot = own_x * line[2] + own_y * line[3]
            push_x, push_y = dot * line[2] - own_x, dot * line[3] - own_y
    else:
        # Already too near: apart within a step.
        from_x, from_y = own_x - gap_x / step_s, own_y - gap_y / step_s
        length = max(math.hypot(from_x, from_y), _EPSILON)
        unit_x, unit_y = from_x / length, from_y / length
        line[2], line[3] = unit_y, -unit_x
        push = reach / step_s - length
        push_x, push_y = push * unit_x, push * unit_y
    line[0], line[1] = walker[WALKER_VX] + share * push_x, walker[WALKER_VY] + share * push_y


@kernel(nrt=False)
def _keep_off_wall(line: Array, walker: Array, walkway: Array, frame: Array) -> bool:
    """Write the half-plane of velocities that do not run into the nearest wall; False if it is far."""
    side = frame[FRAME_RESOLUTION] * walkway[WALKWAY_CELL]
    rows, columns = walkway[WALKWAY_ROWS] // walkway[WALKWAY_CELL], walkway[WALKWAY_COLUMNS] // walkway[WALKWAY_CELL]
    clearance = grid_at(walkway[WALKWAY_CLEARANCE], rows, columns, np.float32)
    # Bilinear between the centres of four cells.
    x, y = (walker[WALKER_X] - frame[FRAME_X]) / side - 0.5, (walker[WALKER_Y] - frame[FRAME_Y]) / side - 0.5
    column, row = min(max(int(x), 0), columns - 2), min(max(int(y), 0), rows - 2)
    right, up = x - column, y - row
    a, b = float(clearance[row, column]), float(clearance[row, column + 1])
    c, d = float(clearance[row + 1, column]), float(clearance[row + 1, column + 1])
    here = (a * (1.0 - right) + b * right) * (1.0 - up) + (c * (1.0 - right) + d * right) * up
    gap = here - walker[WALKER_RADIUS]
    if gap > walker[WALKER_SPEED] * WALL_HORIZON_S:
        return False
    slope_x = (b - a) * (1.0 - up) + (d - c) * up
    slope_y = (c - a) * (1.0 - right) + (d - b) * right
    length = math.hypot(slope_x, slope_y)
    if length < 1e-6:
        return False
    normal_x, normal_y = slope_x / length, slope_y / length
    # Allowed: velocity . normal >= -gap / horizon, which is left of the direction along the wall.
    least = -max(gap, 0.0) / WALL_HORIZON_S
    line[0], line[1], line[2], line[3] = least * normal_x, least * normal_y, normal_y, -normal_x
    return True


@kernel(nrt=False)
def _choose_velocity(
    world: WorldArrays, episode: int, robots: int, person: int, wanted_x: float, wanted_y: float, lines: Array
) -> tuple[float, float]:
    """Return the velocity of a person among others [m/s]."""
    walkers, walkway, frame = walkers_of(world, episode), world.walkways[episode], world.frames[episode]
    walker, first, step_s = walkers[person], episode * robots, world.sensor[0, TIME_STEP]
    x, y, count = walker[WALKER_X], walker[WALKER_Y], 0
    if _keep_off_wall(lines[0], walker, walkway, frame):
        count = 1
    walls = count
    for robot in range(robots):
        pose = world.poses[first + robot]
        if count < MOST_AVOIDED and (pose[0] - x) ** 2 + (pose[1] - y) ** 2 < SIGHT_M * SIGHT_M:
            # People give way to a robot before them that stands, as if it came on: it waits for them to do so.
            speed = world.velocities[first + robot, 0]
            if world.moves[first + robot] != 0 and not world.flags[first + robot] & ENDED:
                speed = max(speed, GIVE_WAY)
            reach = walker[WALKER_RADIUS] + world.bodies[robot, RADIUS] + ROBOT_M
            ahead_x, ahead_y = speed * math.cos(pose[2]), speed * math.sin(pose[2])
            _avoid(lines[count], walker, pose[0], pose[1], ahead_x, ahead_y, reach, 1.0, step_s)
            count += 1
    for other in range(walkers.shape[0]):
        apart = (walkers[other, WALKER_X] - x) ** 2 + (walkers[other, WALKER_Y] - y) ** 2
        if other != person and count < MOST_AVOIDED and apart < SIGHT_M * SIGHT_M:
            reach = walker[WALKER_RADIUS] + walkers[other, WALKER_RADIUS] + PERSONAL_M
            # Who stands takes no part in the avoidance.
            share = 1.0 if walkers[other, WALKER_WAIT] > 0.0 else 0.5
            _avoid(
                lines[count],
                walker,
                walkers[other, WALKER_X],
                walkers[other, WALKER_Y],
                walkers[other, WALKER_VX],
                walkers[other, WALKER_VY],
                reach,
                share,
                step_s,
            )
            count += 1
    limit = walker[WALKER_SPEED]
    failed, vx, vy = _within_lines(lines, count, limit, wanted_x, wanted_y, False)
    if failed < count:
        vx, vy = _least_intrusion(lines, walls, count, failed, limit, vx, vy)
    return vx, vy


@kernel(nrt=False)
def _deepest_robot(
    world: WorldArrays, first: int, robots: int, x: float, y: float, radius: float, ahead: bool
) -> tuple[float, float, float, int]:
    """Find the robot that a disc at x, y [m] enters deepest, and its row.

    With ``ahead`` a robot is as large as the space that it may take in this step.
    """
    depth, normal_x, normal_y, deepest = 0.0, 0.0, 0.0, -1
    step_s = world.sensor[0, TIME_STEP]
    for robot in range(robots):
        row = first + robot
        margin = 0.0
        if ahead and world.moves[row] != 0 and not world.flags[row] & ENDED:
            margin = 0.02 + (abs(world.velocities[row, 0]) + 0.1) * step_s
        gap_x, gap_y = x - world.poses[row, 0], y - world.poses[row, 1]
        distance = math.hypot(gap_x, gap_y)
        entered = radius + world.bodies[robot, RADIUS] + margin - distance
        if entered > depth:
            depth, deepest = entered, row
            normal_x, normal_y = (gap_x / distance, gap_y / distance) if distance > 0.0 else (0.0, 0.0)
    return depth, normal_x, normal_y, deepest


@kernel(nrt=False)
def _step_to(
    world: WorldArrays, episode: int, robots: int, person: int, x: float, y: float
) -> tuple[float, float, bool]:
    """Return where a person gets who steps to x, y [m], pushed out of contact, and whether it is free there."""
    walkers, walkway, frame = walkers_of(world, episode), world.walkways[episode], world.frames[episode]
    doors, radius, resolution = doors_of(world, episode), walkers[person, WALKER_RADIUS], frame[FRAME_RESOLUTION]
    rows, columns = walkway[WALKWAY_ROWS], walkway[WALKWAY_COLUMNS]
    for _ in range(TRIES):
        cell_x, cell_y = (x - frame[FRAME_X]) / resolution, (y - frame[FRAME_Y]) / resolution
        row, column = int(cell_y), int(cell_x)
        if row < 0 or row >= rows or column < 0 or column >= columns:
            return x, y, False
        depth, normal_x, normal_y = 0.0, 0.0, 0.0
        nearest = vector_at(walkway[WALKWAY_BOUND] + row * columns + column, 1, np.uint8)[0]
        if nearest * resolution <= radius:
            solid = grid_at(walkway[WALKWAY_SOLID], rows, columns, np.uint8)
            depth, normal_x, normal_y = deepest_wall(solid, cell_x, cell_y, radius / resolution)
            depth *= resolution
        other, other_x, other_y = deepest_person(walkers, person, x, y, radius)
        if other > depth:
            depth, normal_x, normal_y = other, other_x, other_y
        other, other_x, other_y, _ = _deepest_robot(world, episode * robots, robots, x, y, radius, True)
        if other > depth:
            depth, normal_x, normal_y = other, other_x, other_y
        if doors.shape[0] > 0:
            other, other_x, other_y = deepest_leaf(doors, x, y, radius)
            if other > depth:
                depth, normal_x, normal_y = other, other_x, other_y
        if depth <= 0.0:
            return x, y, True
        if normal_x == 0.0 and normal_y == 0.0:
            return x, y, False
        x += normal_x * (depth + CONTACT_TOLERANCE)
        y += normal_y * (depth + CONTACT_TOLERANCE)
    return x, y, False


@kernel(nrt=False)
def _note_push(world: WorldArrays, walker: Array, first: int, robots: int, x: float, y: float) -> None:
    """Note if a person who steps to x, y [m] walks into a robot: a contact that the person causes, once."""
    depth, _, _, row = _deepest_robot(world, first, robots, x, y, walker[WALKER_RADIUS], False)
    if depth <= PRESSED:
        walker[WALKER_TOUCHED] = 0.0
    elif walker[WALKER_TOUCHED] != row + 1.0:
        walker[WALKER_TOUCHED] = row + 1.0
        world.safety[row, BY_PERSON] += 1.0


@kernel(nrt=False)
def walk_people(world: WorldArrays, episode: int, robots: int) -> None:
    """Move the people of an episode for one step, in their order."""
    walkers, walkway = walkers_of(world, episode), world.walkways[episode]
    frame, seed, step_s = world.frames[episode], world.seeds[episode], world.sensor[0, TIME_STEP]
    lines = scratch_grid(MOST_AVOIDED + 1, 4, np.float64)
    for person in range(walkers.shape[0]):
        walker = walkers[person]
        wanted_x, wanted_y = _wanted_velocity(walker, walkway, frame, seed, person, step_s)
        vx, vy = _choose_velocity(world, episode, robots, person, wanted_x, wanted_y, lines)
        change_x, change_y = vx - walker[WALKER_VX], vy - walker[WALKER_VY]
        change = math.hypot(change_x, change_y)
        if change > ACCELERATION * step_s:
            vx = walker[WALKER_VX] + change_x * (ACCELERATION * step_s / change)
            vy = walker[WALKER_VY] + change_y * (ACCELERATION * step_s / change)
        from_x, from_y = walker[WALKER_X], walker[WALKER_Y]
        _note_push(world, walker, episode * robots, robots, from_x + vx * step_s, from_y + vy * step_s)
        x, y, is_free = _step_to(world, episode, robots, person, from_x + vx * step_s, from_y + vy * step_s)
        # Being pushed is no way to walk faster.
        if not is_free or math.hypot(x - from_x, y - from_y) > 2.0 * walker[WALKER_SPEED] * step_s:
            x, y = from_x, from_y
        walker[WALKER_X], walker[WALKER_Y] = x, y
        walker[WALKER_VX], walker[WALKER_VY] = (x - from_x) / step_s, (y - from_y) / step_s
        is_slow = math.hypot(x - from_x, y - from_y) < LEAST_PROGRESS * walker[WALKER_SPEED] * step_s
        if (wanted_x != 0.0 or wanted_y != 0.0) and is_slow:
            walker[WALKER_STUCK] += 1.0
            if walker[WALKER_STUCK] * step_s >= PATIENCE_S:
                _turn_back(world, episode, robots, person)
        else:
            walker[WALKER_STUCK] = 0.0


@kernel(nrt=False)
def note_people(world: WorldArrays, episode: int, robots: int) -> None:
    """Note how near the robots of an episode are to people after a step."""
    walkers = walkers_of(world, episode)
    for row in range(episode * robots, (episode + 1) * robots):
        if world.flags[row] & ENDED:
            continue
        safety, speed, gap = world.safety[row], abs(world.velocities[row, 0]), np.inf
        for person in range(walkers.shape[0]):
            apart = math.hypot(
                walkers[person, WALKER_X] - world.poses[row, 0], walkers[person, WALKER_Y] - world.poses[row, 1]
            )
            gap = min(gap, apart - walkers[person, WALKER_RADIUS] - world.bodies[row - episode * robots, RADIUS])
        if gap < safety[CLOSEST]:
            safety[CLOSEST], safety[CLOSEST_SPEED] = gap, speed
        if gap < NEAR_M:
            safety[NEAR_STEPS] += 1.0
            safety[NEAR_SPEED] = max(safety[NEAR_SPEED], speed)
            safety[NEAR_MISSES] += 1.0 - safety[IS_NEAR]
            safety[IS_NEAR] = 1.0
        else:
            safety[IS_NEAR] = 0.0

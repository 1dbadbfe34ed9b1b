"""Motion of bodies: differential drives with limits, and contact.

Far from everything a robot drives its arc in one piece. Near contact the arc is cut into short pieces, and
after each the disc is pushed out of solids; if there is no way out the piece is undone. No robot
ever ends a step inside a solid cell or another robot.
"""

import math

import numpy as np

from lidarium.envs.simulation.disturbances.odometry import (
    MAX_ACCELERATION,
    MAX_SPEED,
    MAX_TURN_ACCELERATION,
    MAX_TURN_RATE,
)
from lidarium.envs.simulation.kernels.arrays import (
    BODY_SOLID,
    BOUND,
    BY_ROBOT,
    FLOOR_COLUMNS,
    FLOOR_ROWS,
    FRAME_RESOLUTION,
    MET_PERSON,
    WorldArrays,
    doors_of,
    walkers_of,
)
from lidarium.envs.simulation.kernels.contact import (
    BodyGrids,
    TeamBodies,
    is_free_of_contact,
    push_out,
    wrapped,
)
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at

PIECE = 0.25
"""Longest piece of an arc near contact [cells]."""


@kernel(inline="always")
def body_grids(floor_row: Array, frame: Array) -> BodyGrids:
    """View the grids of a floor, one of ``floor_rows``, at the height of the bodies."""
    rows, columns = floor_row[FLOOR_ROWS], floor_row[FLOOR_COLUMNS]
    return BodyGrids(
        grid_at(floor_row[BOUND], rows, columns, np.uint8),
        grid_at(floor_row[BODY_SOLID], rows, columns, np.uint8),
        frame,
    )


@kernel(inline="always")
def team_of(world: WorldArrays, first: int, last: int) -> TeamBodies:
    """View the bodies of the robots of one episode, rows ``first`` to ``last``."""
    return TeamBodies(
        world.bodies,
        world.moves[first:last],
        world.poses[first:last],
        world.velocities[first:last],
        world.bumpers[first:last],
        world.contacts[first:last],
        world.travelled[first:last],
        world.collisions[first:last],
        walkers_of(world, first // (last - first)),
        doors_of(world, first // (last - first)),
        world.safety[first:last],
    )


@kernel(forceinline=True)
def _along_arc(
    x: float, y: float, heading: float, speed: float, turn_rate: float, duration: float
) -> tuple[float, float, float]:
    """Pose after driving at constant speed and turn rate (exact)."""
    turn = turn_rate * duration
    if abs(turn) < 1e-9:
        middle = heading + 0.5 * turn
        return (
            x + speed * duration * math.cos(middle),
            y + speed * duration * math.sin(middle),
            heading + turn,
        )
    arc = speed / turn_rate
    after = heading + turn
    return (
        x + arc * (math.sin(after) - math.sin(heading)),
        y + arc * (math.cos(heading) - math.cos(after)),
        after,
    )


@kernel(nrt=False)
def move_robots(grids: BodyGrids, team: TeamBodies, commands: Array, duration: float) -> None:
    """Drive the robots of one episode for one step, in their order.

    Each meets the others if they are by then.

    Parameters
    ----------
    commands : (robots, 2) float64
        Wanted speed and turn rate [m/s, rad/s]; cut to the limits of the drive.
    duration : float
        Length of the step [s].
    """
    poses, velocities, bumpers, contacts = team.poses, team.velocities, team.bumpers, team.contacts
    for robot in range(poses.shape[0]):
        bumpers[robot, 0] = bumpers[robot, 1] = bumpers[robot, 2] = 0
        was_in_contact = contacts[robot] != 0
        contacts[robot] = 0
        was_at_person = False
        if team.walkers.shape[0] > 0:
            was_at_person = team.safety[robot, MET_PERSON] != 0.0
            team.safety[robot, MET_PERSON] = 0.0
        if team.moves[robot] == 0:
            velocities[robot, 0] = velocities[robot, 1] = 0.0
            continue
        body = team.bodies[robot]
        wanted_speed = min(max(commands[robot, 0], -body[MAX_SPEED]), body[MAX_SPEED])
        wanted_turn = min(max(commands[robot, 1], -body[MAX_TURN_RATE]), body[MAX_TURN_RATE])
        gain, turn_gain = body[MAX_ACCELERATION] * duration, body[MAX_TURN_ACCELERATION] * duration
        speed = velocities[robot, 0] + min(max(wanted_speed - velocities[robot, 0], -gain), gain)
        turn_rate = velocities[robot, 1] + min(max(wanted_turn - velocities[robot, 1], -turn_gain), turn_gain)
        x, y, heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
        start_x, start_y = x, y
        length = abs(speed) * duration
        if length == 0.0 or is_free_of_contact(grids, team, robot, x, y, length):
            x, y, heading = _along_arc(x, y, heading, speed, turn_rate, duration)
        else:
            pieces = int(math.ceil(length / (PIECE * grids.frame[FRAME_RESOLUTION])))
            for _ in range(pieces):
                next_x, next_y, next_heading = _along_arc(x, y, heading, speed, turn_rate, duration / pieces)
                next_x, next_y, touched, is_free = push_out(grids, team, robot, next_x, next_y, next_heading)
                heading = next_heading
                if touched:
                    contacts[robot] = 1
                if is_free:
                    x, y = next_x, next_y
            if contacts[robot] != 0:
                # The wheels moved only as far as the body did.
                advance = (x - start_x) * math.cos(heading) + (y - start_y) * math.sin(heading)
                speed = min(max(advance / duration, -abs(speed)), abs(speed))
                team.collisions[robot] += 0 if was_in_contact else 1
                if team.walkers.shape[0] > 0 and not was_at_person:
                    team.safety[robot, BY_ROBOT] += team.safety[robot, MET_PERSON]
        team.travelled[robot] += math.hypot(x - start_x, y - start_y)
        poses[robot, 0], poses[robot, 1], poses[robot, 2] = x, y, wrapped(heading)
        velocities[robot, 0], velocities[robot, 1] = speed, turn_rate

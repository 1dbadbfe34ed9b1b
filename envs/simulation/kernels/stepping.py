"""A step in kernels over episodes x robots: bodies move, lasers scan, masks fill, maps follow.

Episodes do not touch each other, and within an episode only the motion and the sharing out need the robots in
their order. So threads may take the robots of an episode, or whole episodes (``envs/engine/running.py``); all
forms run the same functions and agree to the bit.
"""

import math

import numba
import numpy as np

from lidarium.envs.simulation.coverage import share_new_cells
from lidarium.envs.simulation.disturbances.faults import DEAD_ROBOT, has_fault, kidnap, stick_wheels
from lidarium.envs.simulation.disturbances.noise import stream_key
from lidarium.envs.simulation.disturbances.odometry import (
    Encoders,
    disturb_commands,
    read_encoders,
    within_half_turns,
)
from lidarium.envs.simulation.kernels.arrays import (
    DEAD_RECKONING,
    ENDED,
    KNOWN_TEAMMATES,
    MASK_ROWS,
    MASK_WORDS,
    OWN_FRAME,
    OWN_MASK,
    SCAN_STEPS,
    SOME_TEAMMATES,
    TEAM_MASK,
    TIME_STEP,
    TRUE_POSE,
    WorldArrays,
    is_scanning,
    world_at,
)
from lidarium.envs.simulation.kernels.doors import move_doors
from lidarium.envs.simulation.kernels.map_updates import (
    invalidate_teammates,
    perceive_robot,
    sense_and_perceive,
)
from lidarium.envs.simulation.kernels.masks import score_robot
from lidarium.envs.simulation.kernels.motion import body_grids, move_robots, team_of
from lidarium.envs.simulation.kernels.scanning import disturb_robot, scan_scratch, sense_robot
from lidarium.envs.simulation.kernels.walking import note_people, walk_people
from lidarium.envs.simulation.rewards import add_rewards
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at


@kernel(inline="always")
def _believe_truth(pose: Array, start: Array, is_relative: bool, believed: Array) -> None:
    """Localize perfectly: in the floor's axes, or in the frame of the start."""
    if not is_relative:
        believed[0], believed[1], believed[2] = pose[0], pose[1], pose[2]
        return
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    gap_x, gap_y = pose[0] - start[0], pose[1] - start[1]
    believed[0], believed[1] = cosine * gap_x + sine * gap_y, cosine * gap_y - sine * gap_x
    believed[2] = within_half_turns(pose[2] - start[2])


@kernel(inline="always")
def _believe_odometry(odometry: Array, start: Array, is_relative: bool, believed: Array) -> None:
    """Localize by dead reckoning from the start.

    The pose is in the floor's axes, or in the frame of the start.
    """
    if is_relative:
        believed[0], believed[1], believed[2] = odometry[0], odometry[1], odometry[2]
        return
    cosine, sine = math.cos(start[2]), math.sin(start[2])
    believed[0] = start[0] + cosine * odometry[0] - sine * odometry[1]
    believed[1] = start[1] + sine * odometry[0] + cosine * odometry[1]
    believed[2] = within_half_turns(odometry[2] + start[2])


@kernel(nrt=False)
def _drive(world: WorldArrays, episode: int, robots: int, commands: Array) -> None:
    """Apply faults and write the driven speeds for ``commands`` (rows, 2).

    The faults are those of the episode's robots; the result is written to ``world.driven``.
    """
    first, step = episode * robots, world.steps[episode]
    last = first + robots
    for row in range(first, last):
        world.driven[row, 0], world.driven[row, 1] = commands[row, 0], commands[row, 1]
    if world.odometry_model.shape[0] > 0:
        disturb_commands(world.odometry_model, world.noise_table, world.seeds[episode], step, world.driven[first:last])
    for row in range(first, last):
        faults = world.faults[row]
        stick_wheels(
            faults,
            step,
            world.bodies[row - first],
            world.sensor[0, TIME_STEP],
            world.velocities[row],
            world.driven[row],
        )
        if has_fault(faults, DEAD_ROBOT, step) and world.failed[row] == 0:
            world.moves[row], world.failed[row] = 0, 1
        if kidnap(faults, step, row - first, world.bodies, world.poses[first:last]):
            world.velocities[row, 0] = world.velocities[row, 1] = 0.0


@kernel(inline="always")
def _encode(world: WorldArrays, episode: int, robots: int, velocities: Array) -> None:
    """Read the encoders of an episode after its wheels drove at ``velocities`` (rows, 2)."""
    first = episode * robots
    for row in range(first, first + robots):
        read_encoders(
            world.odometry_model,
            world.noise_table,
            stream_key(world.seeds[episode], row - first, world.steps[episode]),
            world.bodies[row - first],
            Encoders(world.wheels[row], world.measured[row], world.odometry[row]),
            velocities[row],
            world.sensor[0, TIME_STEP],
        )


@kernel
def _move_people(table: Array, episode: int, robots: int) -> None:
    """Move the doors and the people of an episode, who see the robots where they are."""
    world = world_at(table)
    if world.doors.shape[0] > 0:
        move_doors(world, episode, robots)
    if world.walkers.shape[0] > 0:
        walk_people(world, episode, robots)


@kernel
def _note_people(table: Array, episode: int, robots: int) -> None:
    """Note how near robots are to people, after both have moved."""
    note_people(world_at(table), episode, robots)


@kernel(inline="always")
def _move(table: Array, world: WorldArrays, episode: int, robots: int, commands: Array, moves_bodies: bool) -> None:
    """Move the bodies of an episode by ``commands`` (rows, 2), and read their encoders."""
    first, last = episode * robots, (episode + 1) * robots
    has_odometry = world.odometry_model.shape[0] > 0
    if moves_bodies:
        if has_odometry or world.faults.shape[1] > 0:
            _drive(world, episode, robots, commands)
            commands = world.driven
        if world.doors.shape[0] > 0 or world.walkers.shape[0] > 0:
            _move_people(table, episode, robots)
        grids = body_grids(world.floor_rows[episode], world.frames[episode])
        move_robots(grids, team_of(world, first, last), commands[first:last], world.sensor[0, TIME_STEP])
        if world.walkers.shape[0] > 0:
            _note_people(table, episode, robots)
    if moves_bodies and has_odometry:
        _encode(world, episode, robots, world.velocities)


@kernel(inline="always")
def _localize(world: WorldArrays, episode: int, robots: int) -> None:
    """Localize the robots with a localizer in the kernels, and clear the changes of the last step.

    If they scan in this step, note where they believe to do so.
    """
    scans = is_scanning(world, episode)
    for row in range(episode * robots, (episode + 1) * robots):
        world.boxes[row] = 0
        is_relative = world.flags[row] & OWN_FRAME != 0
        if world.flags[row] & TRUE_POSE:
            _believe_truth(world.poses[row], world.starts[row], is_relative, world.believed[row])
        elif world.flags[row] & DEAD_RECKONING:
            _believe_odometry(world.odometry[row], world.starts[row], is_relative, world.believed[row])
        if scans:
            for axis in range(3):
                world.scanned[row, axis] = world.believed[row, axis]


@kernel(inline="always")
def _share(world: WorldArrays, episode: int, robots: int) -> None:
    """Credit the episode's robots with cells they saw first, and reward them.

    The step is counted.
    """
    first, last = episode * robots, (episode + 1) * robots
    team = grid_at(
        world.mask_rows[first, TEAM_MASK],
        world.mask_rows[first, MASK_ROWS],
        world.mask_rows[first, MASK_WORDS],
        np.uint64,
    )
    world.team_seen[episode] += share_new_cells(
        world.mask_rows[:, OWN_MASK], team, world.boxes, first, robots, world.gains
    )
    world.steps[episode] += 1
    add_rewards(
        world.gains[first:last],
        world.contacts[first:last],
        world.travelled[first:last],
        world.reward_weights,
        world.rewarded[first:last],
        world.reward_terms[first:last],
        world.rewards[first:last],
    )


@kernel
def _sense_rows(table: Array, rows: tuple[int, int], robots: int, perceives: bool) -> None:
    """Let the robots of the rows from the first up to the last sense, score and (if ``perceives``) map."""
    world = world_at(table)
    scratch = scan_scratch(world)
    for row in range(rows[0], rows[1]):
        if not world.flags[row] & ENDED:
            sense_and_perceive(world, row, row // robots * robots, robots, perceives, scratch)


@kernel(nrt=False)
def step_episode(table: Array, episode: int, robots: int, commands: Array, moves_bodies: bool, perceives: bool) -> None:
    """Run a step of one episode: move, and if robots scan in it, sense, score and (if ``perceives``) map."""
    world = world_at(table)
    _move(table, world, episode, robots, commands, moves_bodies)
    _localize(world, episode, robots)
    if is_scanning(world, episode):
        _sense_rows(table, (episode * robots, (episode + 1) * robots), robots, perceives)
    _share(world, episode, robots)


@kernel
def _move_episode(table: Array, episode: int, robots: int, commands: Array, moves_bodies: bool) -> None:
    world = world_at(table)
    _move(table, world, episode, robots, commands, moves_bodies)
    _localize(world, episode, robots)


@kernel
def _share_episode(table: Array, episode: int, robots: int) -> None:
    _share(world_at(table), episode, robots)


@kernel
def _step_row(table: Array, row: int, robots: int, perceives: bool) -> None:
    """Run both stages for the robot of a row, if it scans in this step and has not ended."""
    if is_scanning(world_at(table), row // robots):
        _sense_rows(table, (row, row + 1), robots, perceives)


@kernel
def _perceive_row(table: Array, row: int, robots: int, runs: Array) -> None:
    world, episode = world_at(table), row // robots
    # The step is counted.
    scanned = world.steps[episode] % int(world.sensor[0, SCAN_STEPS]) == 0
    if runs[episode] and scanned and not world.flags[row] & ENDED:
        perceive_robot(world, row, row // robots * robots, robots, scan_scratch(world))


@kernel
def drive(table: Array, robots: int, commands: Array, runs: Array) -> None:
    """Write into ``driven`` the result of faults and drives for ``commands``.

    ``commands`` is (rows, 2), ``runs`` (episodes,). A kidnapped robot is put elsewhere.
    """
    world = world_at(table)
    for episode in range(runs.shape[0]):
        if runs[episode]:
            _drive(world, episode, robots, commands)


@kernel
def walk(table: Array, robots: int, runs: Array) -> None:
    """Move the people and doors of the episodes with ``runs`` (episodes,)."""
    for episode in range(runs.shape[0]):
        if runs[episode]:
            _move_people(table, episode, robots)


@kernel
def note_approaches(table: Array, robots: int, runs: Array) -> None:
    """Note how near robots of the episodes with ``runs`` (episodes,) are to people, after both have moved."""
    world = world_at(table)
    for episode in range(runs.shape[0]):
        if runs[episode] and world.walkers.shape[0] > 0:
            _note_people(table, episode, robots)


@kernel
def encode(table: Array, robots: int, velocities: Array, runs: Array) -> None:
    """Read the encoders of wheels that drove at ``velocities`` (rows, 2)."""
    world = world_at(table)
    for episode in range(runs.shape[0]):
        if runs[episode]:
            _encode(world, episode, robots, velocities)


@kernel
def sense(table: Array, robots: int, runs: Array) -> None:
    """Take the scans of all robots that scan in this step and have not ended, at their current poses."""
    world = world_at(table)
    scratch = scan_scratch(world)
    for episode in range(runs.shape[0]):
        if not runs[episode] or not is_scanning(world, episode):
            continue
        for row in range(episode * robots, (episode + 1) * robots):
            if not world.flags[row] & ENDED:
                sense_robot(world, row, episode * robots, robots, scratch)


@kernel
def disturb_scan(table: Array, row: int, robots: int) -> None:
    """Make the scan of a row of its true ranges, which the world has put there."""
    world = world_at(table)
    disturb_robot(world, row, row // robots * robots, robots, scan_scratch(world))


@kernel
def move_and_sense(table: Array, robots: int, commands: Array, runs: Array, moves_bodies: bool) -> None:
    """Move the bodies of the episodes with ``runs`` (episodes,), then take the scans that are due."""
    world = world_at(table)
    scratch = scan_scratch(world)
    for episode in range(runs.shape[0]):
        if not runs[episode]:
            continue
        _move(table, world, episode, robots, commands, moves_bodies)
        if not is_scanning(world, episode):
            continue
        for row in range(episode * robots, (episode + 1) * robots):
            if not world.flags[row] & ENDED:
                sense_robot(world, row, episode * robots, robots, scratch)


@kernel
def score_and_localize(table: Array, robots: int, runs: Array) -> None:
    """Localize the robots of the episodes with ``runs``, score the scans of the step, and count it."""
    world = world_at(table)
    scratch = scan_scratch(world)
    for episode in range(runs.shape[0]):
        if not runs[episode]:
            continue
        _localize(world, episode, robots)
        if is_scanning(world, episode):
            for row in range(episode * robots, (episode + 1) * robots):
                if not world.flags[row] & ENDED:
                    score_robot(world, row, episode * robots, robots, scratch)
        _share(world, episode, robots)


@kernel
def render_row(table: Array, row: int, robots: int, poses: Array, ranges: Array) -> None:
    """Update a robot's map from scans (scans, beams) taken at poses (scans, 3).

    Nothing else is updated.
    """
    world = world_at(table)
    flags, pose, scan = world.flags[row], world.believed[row].copy(), world.ranges[row].copy()
    # Teammates' poses at that time are not known any more.
    world.flags[row] = flags & ~(KNOWN_TEAMMATES | SOME_TEAMMATES)
    # Those scans have no beams on doors any more, see ``ranges_without_teammates``.
    marks = world.recognised[row].copy() if world.recognised.shape[0] > 0 else np.zeros(0, np.uint8)
    if world.recognised.shape[0] > 0:
        world.recognised[row, :] = 0
    scratch = scan_scratch(world)
    for k in range(poses.shape[0]):
        world.believed[row, 0], world.believed[row, 1], world.believed[row, 2] = (
            poses[k, 0],
            poses[k, 1],
            poses[k, 2],
        )
        world.ranges[row, :] = ranges[k]
        perceive_robot(world, row, row // robots * robots, robots, scratch)
    world.flags[row] = flags
    if world.recognised.shape[0] > 0:
        world.recognised[row, :] = marks
    world.believed[row, 0], world.believed[row, 1], world.believed[row, 2] = pose[0], pose[1], pose[2]
    world.ranges[row, :] = scan


@kernel
def ranges_without_teammates(table: Array, row: int, robots: int, ranges: Array) -> None:
    """Copy a robot's scan into ``ranges`` (beams,), without teammates and doors that open by themselves.

    Beams that met teammates are made invalid if the robot knows these.
    """
    world = world_at(table)
    ranges[:] = world.ranges[row]
    if world.flags[row] & (KNOWN_TEAMMATES | SOME_TEAMMATES):
        invalidate_teammates(world, row, row // robots * robots, robots, ranges)
    if world.recognised.shape[0] > 0:
        for beam in range(ranges.shape[0]):
            if world.recognised[row, beam] != 0:
                ranges[beam] = np.float32(np.nan)


def _step_serial(table: Array, robots: int, commands: Array, runs: Array, moves_bodies: bool, perceives: bool) -> None:
    """Run a step of the episodes with ``runs`` (episodes,)."""
    for episode in range(runs.shape[0]):
        if runs[episode]:
            step_episode(table, episode, robots, commands, moves_bodies, perceives)


def _step_rows(table: Array, robots: int, commands: Array, runs: Array, moves_bodies: bool, perceives: bool) -> None:
    """Run a step of the episodes with ``runs``; threads take single robots."""
    for episode in range(runs.shape[0]):
        if runs[episode]:
            _move_episode(table, episode, robots, commands, moves_bodies)
    for row in numba.prange(runs.shape[0] * robots):
        if runs[row // robots]:
            _step_row(table, row, robots, perceives)
    for episode in range(runs.shape[0]):
        if runs[episode]:
            _share_episode(table, episode, robots)


def _perceive(table: Array, robots: int, runs: Array) -> None:
    """Run stage two of the episodes with ``runs``."""
    for row in numba.prange(runs.shape[0] * robots):
        _perceive_row(table, row, robots, runs)


step_serial = kernel(_step_serial)
step_rows = kernel(parallel=True)(_step_rows)
perceive_serial = kernel(_perceive)
perceive_parallel = kernel(parallel=True)(_perceive)

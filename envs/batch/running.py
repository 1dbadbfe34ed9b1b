"""The kernel that runs many episodes at once.

Each runs for one step or for a decision of its own length.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.driving.drives import Drives, Following, any_newly_done, follow_team, mark_waiting
from lidarium.envs.observations import Arrays, write_row
from lidarium.envs.outcome.scorer import is_near
from lidarium.envs.simulation.kernels.arrays import WorldArrays, world_at
from lidarium.envs.simulation.kernels.stepping import step_episode
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.work_queue import take_turn

WAITS, LOOKS, STEPS, DECIDES = range(4)
"""Modes of an episode in a call.

It does nothing, takes the start scan, takes one step by the commands, or follows the robots' paths up to the
longest decision.
"""


class Tally(NamedTuple):
    """What ends an episode.

    Attributes
    ----------
    counted : (episodes,) int64
        Size of F.
    goals : (episodes, 2) float64
        Goal in the floor's frame [m], nan for none.
    bounds : (4,) float64
        Steps of the horizon and coverage at which all end (inf for none), radius of the goal [m], and whether
        a contact ends.
    live : (rows,) bool
        Which robots have not ended.
    waiting : (rows,) bool
        Scratch: who waited for an order already when a decision began.
    """

    counted: NDArray[np.int64]
    goals: NDArray[np.float64]
    bounds: NDArray[np.float64]
    live: NDArray[np.bool_]
    waiting: NDArray[np.bool_]


@kernel(borrowing=True)
def _is_interrupted(
    poses: Array,
    contacts: Array,
    failed: Array,
    live: Array,
    goal: Array,
    radius: float,
    stops_on_contact: bool,
) -> bool:
    """Whether something happened to a robot of the episode that ends it.

    It is the goal reached, a collision or a failure.
    """
    for robot in range(live.shape[0]):
        if live[robot] and failed[robot] != 0:
            return True
        if live[robot] and is_near(poses[robot, 0], poses[robot, 1], goal[0], goal[1], radius):
            return True
        if stops_on_contact and contacts[robot] != 0:
            return True
    return False


@kernel(borrowing=True)
def _ends(world: WorldArrays, episode: int, robots: int, drives: Drives, tally: Tally, decides: bool) -> bool:
    """Whether an episode's run ends with the step that was just taken."""
    first, last = episode * robots, (episode + 1) * robots
    coverage = world.team_seen[episode] / max(tally.counted[episode], 1)
    if world.steps[episode] >= tally.bounds[0] or coverage >= tally.bounds[1]:
        return True
    if _is_interrupted(
        world.poses[first:last],
        world.contacts[first:last],
        world.failed[first:last],
        tally.live[first:last],
        tally.goals[episode],
        tally.bounds[2],
        tally.bounds[3] != 0.0,
    ):
        return True
    return bool(decides and any_newly_done(drives, first, last, tally.live, tally.waiting))


@kernel
def begin_decisions(decides: Array, robots: int, drives: Drives, tally: Tally) -> None:
    """Note which robots already wait for an order.

    It applies to the episodes that ``decides`` (episodes,) names.
    """
    for episode in range(decides.shape[0]):
        if decides[episode]:
            mark_waiting(drives, episode * robots, (episode + 1) * robots, tally.waiting)


@kernel
def follow_some(
    decides: Array, robots: int, table: Array, drives: Drives, following: Following, commands: Array
) -> None:
    """Give robots the speeds that follow their paths.

    It applies to the robots of the episodes that ``decides`` (episodes,) names.
    """
    world = world_at(table)
    for episode in range(decides.shape[0]):
        if decides[episode]:
            first, last = episode * robots, (episode + 1) * robots
            follow_team(
                drives, following, first, last, world.believed, world.measured, world.ranges, commands
            )


@kernel
def note_ends(modes: Array, robots: int, table: Array, drives: Drives, tally: Tally) -> None:
    """Let the episodes wait whose run ends with the step that was just taken."""
    world = world_at(table)
    for episode in range(modes.shape[0]):
        if modes[episode] != WAITS and _ends(
            world, episode, robots, drives, tally, modes[episode] == DECIDES
        ):
            modes[episode] = WAITS


@kernel(borrowing=True)
def _run_episode(
    table: Array,
    robots: int,
    episode: int,
    mode: int,
    commands: Array,
    drives: Drives,
    following: Following,
    tally: Tally,
    longest: int,
) -> None:
    """Run one episode for a step, or for a decision of at most ``longest`` steps.

    A decision ends before when the episode is over, when something happens to a robot, or when a robot with a
    target has newly arrived or found no way.
    """
    world = world_at(table)
    first, last = episode * robots, (episode + 1) * robots
    if mode == DECIDES:
        mark_waiting(drives, first, last, tally.waiting)
    for _ in range(longest if mode == DECIDES else 1):
        if mode == DECIDES:
            follow_team(
                drives, following, first, last, world.believed, world.measured, world.ranges, commands
            )
        step_episode(table, episode, robots, commands, mode != LOOKS, True)
        if _ends(world, episode, robots, drives, tally, mode == DECIDES):
            break


def _run_episodes(
    table: Array,
    robots: int,
    modes: Array,
    commands: Array,
    drives: Drives,
    following: Following,
    tally: Tally,
    longest: int,
    seen: Array,
    sources: Array,
    observed: Arrays,
    order: Array,
    turns: Array,
    threads: int,
) -> None:
    """Run the episodes by their ``modes`` (episodes,), on so many threads.

    The observations of ``seen`` rows are written.

    An episode's observations are written right after its run, while its maps are in the thread's cache.
    Threads take the episodes by ``new_turns`` in the ``order`` (episodes,) int64.
    """
    for _ in numba.prange(threads):
        turn = take_turn(turns)
        while turn < order.shape[0]:
            episode = order[turn]
            turn = take_turn(turns)
            if modes[episode] != WAITS:
                _run_episode(
                    table, robots, episode, modes[episode], commands, drives, following, tally, longest
                )
                for row in range(episode * robots, (episode + 1) * robots):
                    if seen[row]:
                        write_row(row, sources, observed)


run_serial = kernel(_run_episodes)
run_parallel = kernel(parallel=True)(_run_episodes)

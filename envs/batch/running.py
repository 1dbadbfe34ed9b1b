"""The kernel that runs many episodes at once.

Each runs for one step or for a decision of its own length.
"""

import numba

from lidarium.envs.driving.drives import Drives, Following, any_newly_done, follow_team, mark_waiting
from lidarium.envs.observation_kernels import Arrays, write_row
from lidarium.envs.outcome.endings import Rules, ending_of
from lidarium.envs.simulation.kernels.arrays import WorldArrays, world_at
from lidarium.envs.simulation.kernels.stepping import step_episode
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.work_queue import take_next

WAITS, LOOKS, STEPS, DECIDES = range(4)
"""Modes of an episode in a call.

It does nothing, takes the start scan, takes one step by the commands, or follows the robots' paths up to the
longest decision.
"""


@kernel(borrowing=True)
def _ends(
    world: WorldArrays, episode: int, robots: int, drives: Drives, rules: Rules, waiting: Array, decides: bool
) -> bool:
    """Whether an episode's run ends with the step that was just taken."""
    first, last = episode * robots, (episode + 1) * robots
    for row in range(first, last):
        if ending_of(world, row, episode, rules) != 0:
            return True
    return bool(decides and any_newly_done(drives, first, last, rules.live, waiting))


@kernel
def begin_decisions(decides: Array, robots: int, drives: Drives, waiting: Array) -> None:
    """Note which robots already wait for an order.

    It applies to the episodes that ``decides`` (episodes,) names.
    """
    for episode in range(decides.shape[0]):
        if decides[episode]:
            mark_waiting(drives, episode * robots, (episode + 1) * robots, waiting)


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
def note_ends(modes: Array, robots: int, table: Array, drives: Drives, rules: Rules, waiting: Array) -> None:
    """Let the episodes wait whose run ends with the step that was just taken."""
    world = world_at(table)
    for episode in range(modes.shape[0]):
        if modes[episode] != WAITS and _ends(
            world, episode, robots, drives, rules, waiting, modes[episode] == DECIDES
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
    rules: Rules,
    waiting: Array,
    longest: int,
) -> None:
    """Run one episode for a step, or for a decision of at most ``longest`` steps.

    A decision ends before when the episode is over, when something happens to a robot, or when a robot with a
    target has newly arrived or found no way.
    """
    world = world_at(table)
    first, last = episode * robots, (episode + 1) * robots
    if mode == DECIDES:
        mark_waiting(drives, first, last, waiting)
    for _ in range(longest if mode == DECIDES else 1):
        if mode == DECIDES:
            follow_team(
                drives, following, first, last, world.believed, world.measured, world.ranges, commands
            )
        step_episode(table, episode, robots, commands, mode != LOOKS, True)
        if _ends(world, episode, robots, drives, rules, waiting, mode == DECIDES):
            break


def _run_episodes(
    table: Array,
    robots: int,
    modes: Array,
    commands: Array,
    drives: Drives,
    following: Following,
    rules: Rules,
    waiting: Array,
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
        turn = take_next(turns)
        while turn < order.shape[0]:
            episode = order[turn]
            turn = take_next(turns)
            if modes[episode] != WAITS:
                _run_episode(
                    table,
                    robots,
                    episode,
                    modes[episode],
                    commands,
                    drives,
                    following,
                    rules,
                    waiting,
                    longest,
                )
                for row in range(episode * robots, (episode + 1) * robots):
                    if seen[row]:
                        write_row(row, sources, observed)


run_serial = kernel(_run_episodes)
run_parallel = kernel(parallel=True)(_run_episodes)

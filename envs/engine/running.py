"""The kernel that runs many episodes at once.

Each runs for one step or for a decision of its own length.
"""

from typing import NamedTuple

import numba

from lidarium.envs.levels.level import DECIDES, SENSES, WAITS
from lidarium.envs.observing.kernels import Arrays, write_row
from lidarium.envs.onboard.driving.drives import Drives, Following, any_newly_done, follow_team, mark_waiting
from lidarium.envs.simulation.endings import Rules, ending_of
from lidarium.envs.simulation.kernels.arrays import WorldArrays, world_at
from lidarium.envs.simulation.kernels.stepping import step_episode
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.work_queue import Work, share_of, take_next


class Run(NamedTuple):
    """A call of a batch: the mode of each episode, and the rows to observe.

    Attributes
    ----------
    table : (arrays, 3) int64
        The table of the world's arrays.
    robots : int
        Size of a team.
    modes : (episodes,) int8
        Mode of each episode.
    commands : (rows, 2) float64
        Speeds and turn rates of episodes that take one step; written in decisions [m/s, rad/s].
    longest : int
        Maximum number of steps of a decision.
    waiting : (rows,) bool
        Scratch: robots whose targets were already done at the start of the decision.
    seen : (rows,) bool
        Rows to observe.
    sources : (arrays, 3) int64
        Sources of the observations, see ``write_row``.
    """

    table: Array
    robots: int
    modes: Array
    commands: Array
    longest: int
    waiting: Array
    seen: Array
    sources: Array


@kernel(nrt=False)
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
                drives, following, first, last, world.believed, world.measured, world.ranges, world.scanned, commands
            )


@kernel
def note_ends(modes: Array, robots: int, table: Array, drives: Drives, rules: Rules, waiting: Array) -> None:
    """Mark the episodes as waiting that end their run with the last step."""
    world = world_at(table)
    for episode in range(modes.shape[0]):
        if modes[episode] != WAITS and _ends(world, episode, robots, drives, rules, waiting, modes[episode] == DECIDES):
            modes[episode] = WAITS


@kernel(nrt=False)
def _run_episode(run: Run, episode: int, drives: Drives, following: Following, rules: Rules) -> None:
    """Run one episode for a step, or for a decision.

    A decision ends before its longest time when the episode is over, when something happens to a robot, or when a
    robot with a target has newly arrived or found no path.
    """
    world, robots, commands = world_at(run.table), run.robots, run.commands
    mode, first, last = run.modes[episode], episode * robots, (episode + 1) * robots
    if mode == DECIDES:
        mark_waiting(drives, first, last, run.waiting)
    for _ in range(run.longest if mode == DECIDES else 1):
        if mode == DECIDES:
            follow_team(
                drives, following, first, last, world.believed, world.measured, world.ranges, world.scanned, commands
            )
        step_episode(run.table, episode, robots, commands, mode != SENSES, mode != WAITS)
        if _ends(world, episode, robots, drives, rules, run.waiting, mode == DECIDES):
            break


@kernel
def run_serial(run: Run, drives: Drives, following: Following, rules: Rules, observed: Arrays, work: Work) -> None:
    """Run the episodes by their modes, in the order of the work's items.

    An episode's observations are written right after its run, while its maps are in the thread's cache.
    """
    # Arguments are not nested further: numba hands no tuples of tuples to threads.
    for _ in range(work.threads):
        place = take_next(work.taken)
        while place < work.items.shape[0]:
            episode = work.items[place]
            place = take_next(work.taken)
            if run.modes[episode] != WAITS:
                _run_episode(run, episode, drives, following, rules)
                for row in range(episode * run.robots, (episode + 1) * run.robots):
                    if run.seen[row]:
                        write_row(row, run.sources, observed)


@kernel(parallel=True)
def run_parallel(run: Run, drives: Drives, following: Following, rules: Rules, observed: Arrays, work: Work) -> None:
    """Run the episodes on threads; see ``run_serial``."""
    for thread in numba.prange(work.threads):
        run_serial(run, drives, following, rules, observed, share_of(work, thread))

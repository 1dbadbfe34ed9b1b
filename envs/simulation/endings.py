"""Why robots end: one rule for each reason, for kernels and for whole batches."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import BROKEN_PHYSICS, WorldArrays, world_at
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import arrays_at

REASONS = (
    "",
    "covered",
    "failed",
    "battery",
    "collision",
    "reached",
    "horizon",
    "no_frontier",
    "frontier_unreachable",
    "physics",
)
"""Reasons of endings, by number; 0 if the robot has not ended.

If several of the first six apply, the first counts; ``physics`` takes the place of ``failed`` if the world reports
`BROKEN_PHYSICS`.
"""

_, COVERED, FAILED, BATTERY, COLLISION, REACHED, HORIZON, NO_FRONTIER, FRONTIER_UNREACHABLE, PHYSICS = range(
    len(REASONS)
)


class Rules(NamedTuple):
    """Rules that end the robots of all episodes.

    Attributes
    ----------
    counted : (episodes,) int64
        Size of F.
    goals : (episodes, 2) float64
        Goal in the floor's frame [m], nan for none.
    bounds : (4,) float64
        Steps of the horizon and coverage at which all end (inf for none), radius of the goal [m], and whether
        a contact ends: see ``HORIZON_STEPS`` and the following.
    live : (rows,) bool
        Which robots have not ended.
    is_empty : (rows,) bool
        Which robots have no energy left.
    """

    counted: Annotated[NDArray[np.int64], np.int64, 1]
    goals: Annotated[NDArray[np.float64], np.float64, 2]
    bounds: Annotated[NDArray[np.float64], np.float64, 1]
    live: Annotated[NDArray[np.bool_], np.bool_, 1]
    is_empty: Annotated[NDArray[np.bool_], np.bool_, 1]


HORIZON_STEPS, STOP_COVERAGE, GOAL_RADIUS, STOPS_ON_CONTACT = range(4)
"""Places in ``Rules.bounds``."""


def make_rules(simulation: Simulation, settings: ExplorationSettings) -> Rules:
    """Return the rules of a simulation's episodes, with no goals and no live robots yet."""
    bounds = np.zeros(4)
    horizon, cover = settings.horizon_steps, settings.stop_coverage
    bounds[HORIZON_STEPS] = math.inf if horizon is None else horizon
    bounds[STOP_COVERAGE] = math.inf if cover is None else cover
    bounds[GOAL_RADIUS], bounds[STOPS_ON_CONTACT] = settings.goal_radius, settings.stop_on_contact
    rows = simulation.robots * simulation.episodes
    return Rules(
        simulation.score.counted,
        np.full((simulation.episodes, 2), np.nan),
        bounds,
        np.zeros(rows, np.bool_),
        np.zeros(rows, np.bool_),
    )


@kernel(forceinline=True)
def _is_near(x: float, y: float, goal_x: float, goal_y: float, radius: float) -> bool:
    """Whether a place is within a radius of the goal [m]; never of a goal that is nan."""
    return bool((x - goal_x) * (x - goal_x) + (y - goal_y) * (y - goal_y) <= radius * radius)


@kernel(nrt=False)
def ending_of(world: WorldArrays, row: int, episode: int, rules: Rules) -> int:
    """Return the reason for which a robot ends now, by number in ``REASONS``; 0 if it continues or has ended."""
    if not rules.live[row]:
        return 0
    bounds = rules.bounds
    if world.team_seen[episode] / max(rules.counted[episode], 1) >= bounds[STOP_COVERAGE]:
        return COVERED
    if world.failed[row] != 0:
        return PHYSICS if world.failed[row] == BROKEN_PHYSICS else FAILED
    if rules.is_empty[row]:
        return BATTERY
    if bounds[STOPS_ON_CONTACT] != 0.0 and world.contacts[row] != 0:
        return COLLISION
    goal = rules.goals[episode]
    if _is_near(world.poses[row, 0], world.poses[row, 1], goal[0], goal[1], bounds[GOAL_RADIUS]):
        return REACHED
    if world.steps[episode] >= bounds[HORIZON_STEPS]:
        return HORIZON
    return 0


@kernel
def note_endings(table: Array, robots: int, rules_table: Array, reasons: Array) -> int:
    """Write why each robot ends now into ``reasons`` (rows,) int8.

    Returns how many end. ``rules_table`` is the table of ``Rules``: handing over one array takes less time than
    five.
    """
    world, rules = world_at(table), arrays_at(rules_table, Rules)
    count = 0
    for row in range(reasons.shape[0]):
        reasons[row] = ending_of(world, row, row // robots, rules)
        count += reasons[row] != 0
    return count

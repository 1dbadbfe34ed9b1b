"""Reasons of the robots' ends, for all rows at once.

They follow the rules of ``ExplorationEnv``, to the letter.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation

REASONS = ("", "covered", "reached", "collision", "horizon", "no_frontier", "frontier_unreachable", "failed")
"""Why a robot ended, by number; 0 where it has not."""

COVERED, REACHED, COLLISION, HORIZON, NO_FRONTIER, FRONTIER_UNREACHABLE, FAILED = range(1, len(REASONS))


def endings(
    simulation: Simulation,
    settings: ExplorationSettings,
    goals: NDArray[np.float64] | None,
    live: NDArray[np.bool_],
    stopping: NDArray[np.int8] | None,
) -> NDArray[np.int8]:
    """Return why live robots end now, by number in ``REASONS``, shape (rows,).

    Parameters
    ----------
    simulation : Simulation
        What has happened.
    settings : ExplorationSettings
        What ends an episode.
    goals : (episodes, 2) float64 or None
        Goals in the floor's frame [m], nan for none; None where no episode has one.
    live : (rows,) bool
        Who has not ended and took part in the step.
    stopping : (rows,) int8 or None
        Why robots end of themselves, 0 where they do not; None where nobody does.
    """
    robots, world = settings.robots, simulation.world
    reasons = np.zeros(len(live), np.int8) if stopping is None else np.where(live, stopping, np.int8(0))
    if goals is not None:
        away = world.poses[:, :2] - np.repeat(goals, robots, axis=0)
        with np.errstate(invalid="ignore"):
            is_there = (
                away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1]
                <= settings.goal_radius * settings.goal_radius
            )
        reasons[live & is_there] = REACHED
    if settings.stop_on_contact:
        reasons[live & (world.contacts != 0)] = COLLISION
    if settings.may_fail:
        reasons[live & (world.failed != 0)] = FAILED
    horizon = settings.horizon_steps
    if horizon is not None:
        is_late = world.steps >= horizon
        if is_late.any():
            reasons[live & (reasons == 0) & np.repeat(is_late, robots)] = HORIZON
    if settings.stop_coverage is not None:
        is_covered = simulation.score.coverages() >= settings.stop_coverage
        if is_covered.any():
            reasons[live & np.repeat(is_covered, robots)] = COVERED
    return reasons

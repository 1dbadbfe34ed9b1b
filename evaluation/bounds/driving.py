"""Drives tours that were planned on a floor that the team knows."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.envs.faces.parallel import ExplorationEnv, Observation
from lidarium.envs.onboard.radio.messages import MOST_POINTS, DriveState, Route
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.evaluation.bounds.tours import TourPlan
from lidarium.evaluation.bounds.view_graph import ViewGraph
from lidarium.evaluation.episodes.runner import run_episode

PATIENCE, LEAST_PATIENCE_S = 4.0, 60.0
"""How many times as long as its walks take at cruising speed a drive may last, and more [s].

Robots that block each other would stand until the end of days.
"""

Looks = Mapping[tuple[int, int], float]
"""Headings to turn to, by the robot and the number of the place on its walk [rad]."""


@dataclass(frozen=True, slots=True)
class Walk:
    """A path that one robot drives.

    Attributes
    ----------
    points : (P, 2) float64
        x, y in the floor's frame, from the start on [m].
    room : (P,) float64
        Room beside the body on the piece that leads to each [m].
    headings : (P,) float64
        Heading to turn to there [rad]; nan for none.
    """

    points: NDArray[np.float64]
    room: NDArray[np.float64]
    headings: NDArray[np.float64]


def walks_of(graph: ViewGraph, plan: TourPlan, looks: Looks) -> list[Walk]:
    """Return the paths of a plan with places at which robots turn to something."""
    walks = []
    for robot, walk in enumerate(plan.walks):
        points, room = graph.places[walk], graph.room[walk]
        # A piece has no more room than either of its ends.
        least = np.maximum(np.minimum(room, np.concatenate([[room[0]], room[:-1]])), 0.0)
        headings = np.array([looks.get((robot, at), math.nan) for at in range(len(walk))])
        walks.append(Walk(points, least, headings))
    return walks


class WalkPolicy(Policy):
    """Robots that follow walks, one after the other piece; who has arrived stays.

    Parameters
    ----------
    walks : sequence of Walk
        One for each robot, in the floor's frame.
    offsets : (robots, 2) float64
        What positions in the robots' map frames lack to the floor's frame [m].
    """

    level = "waypoint"

    def __init__(self, walks: Sequence[Walk], offsets: NDArray[np.float64]) -> None:
        self._walks, self._offsets = walks, offsets

    def reset(self, team: Team, seed: int) -> None:
        """Start an episode."""
        self._team = team
        self._left = {
            agent: _pieces(walk, offset)
            for agent, walk, offset in zip(team.agents, self._walks, self._offsets, strict=True)
        }
        self._at: dict[str, Route | None] = dict.fromkeys(team.agents)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Let each robot follow its walk; all stop together at the ends."""
        for agent in observations:
            state = self._team.drive_state(agent)
            if self._at[agent] is None or state in (DriveState.ARRIVED, DriveState.NO_PATH):
                self._at[agent] = self._left[agent].pop(0) if self._left[agent] else None
        if all(self._at[agent] is None for agent in observations):
            return {agent: Stop("stopped") for agent in observations}
        return {agent: self._at[agent] for agent in observations}


def _pieces(walk: Walk, offset: NDArray[np.float64]) -> list[Route]:
    """Return a walk as routes.

    They end where the robot turns, and have no more points than routes may.
    """
    pieces, start, last = [], 0, len(walk.points) - 1
    for at in range(last + 1):
        heading = float(walk.headings[at])
        if math.isnan(heading) and at < last and at - start < MOST_POINTS - 1:
            continue
        part = np.s_[start : at + 1]
        pieces.append(
            Route(walk.points[part] - offset, walk.room[part], None if math.isnan(heading) else heading)
        )
        start = at
    return pieces


def drive(
    floor: object, settings: ExplorationSettings, starts: Sequence[Sequence[float]], walks: Sequence[Walk]
) -> tuple[float, float, NDArray[np.float64]]:
    """Drive walks with the robots' limits.

    Parameters
    ----------
    floor : Floor or str
        The floor.
    settings : ExplorationSettings
        The team; its ``stop_coverage`` is what has to be seen.
    starts : sequence of (x, y, theta)
        Where the robots start [m, rad].
    walks : sequence of Walk
        One for each.

    Returns
    -------
    (float, float, (n, 3) float64)
        Time at which that share was seen [s], inf where it never was; the share that was seen; poses that the
        robots had in the floor's frame [m, rad]. A drive ends where robots block each other for long.
    """
    allowed_s = PATIENCE * max(_seconds_of(walk, settings) for walk in walks) + LEAST_PATIENCE_S
    env = ExplorationEnv(floor, replace(settings, horizon_s=allowed_s))  # type: ignore[arg-type]
    options = {"starts": [list(start) for start in starts]}
    env.reset(seed=0, options=options)
    offsets = np.array([env.perception.poses.offset(row)[:2] for row in range(settings.robots)])
    run_episode(WalkPolicy(walks, offsets), env, 0, options)
    share = float(env.scorer.coverage)
    wanted = settings.stop_coverage
    is_reached = wanted is not None and share >= wanted
    poses = np.concatenate([at.reshape(-1, 3) for _, at in env.scorer.track])
    return (float(env.scorer.time) if is_reached else math.inf), share, poses


def _seconds_of(walk: Walk, settings: ExplorationSettings) -> float:
    """Return what a walk takes at cruising speed, with a whole turn where it has a heading [s]."""
    metres = float(np.hypot(*np.diff(walk.points, axis=0).T).sum())
    turns = int(np.isfinite(walk.headings).sum())
    return metres / settings.robot.cruise_speed + turns * 2.0 * math.pi / settings.robot.max_turn_rate

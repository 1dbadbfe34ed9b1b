"""Random walk: straight on until something is near, then a random turn.

It is the lower baseline of every comparison.
"""

import math
from collections.abc import Mapping

import numpy as np

from lidarium.agents.policy import Action, Policy, Team
from lidarium.envs.faces.parallel import Observation

NEAR = 0.35
"""A robot turns when something ahead is nearer than its radius and this [m]."""


class RandomWalk(Policy):
    """Drives straight on and turns by a random angle if something is near."""

    level = "velocity"
    observes = ("scan", "pose", "bumper")

    def __init__(self, speed: float = 0.43) -> None:
        if not 0.0 < speed <= 1.0:
            raise ValueError(f"speed of the random walk is {speed}; want a share in (0, 1]")
        self._speed = speed
        self._headings: dict[str, float | None] = {}

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        self._team = team
        self._generators = {
            agent: np.random.default_rng(child)
            for agent, child in zip(team.agents, np.random.SeedSequence(seed).spawn(len(team.agents)), strict=True)
        }
        self._headings = dict.fromkeys(team.agents)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Drive on, or turn towards the heading that was drawn."""
        return {agent: self._decide(agent, observation) for agent, observation in observations.items()}

    def _decide(self, agent: str, observation: Observation) -> Action:
        scan, heading = observation["scan"], float(observation["pose"][2])
        ahead = len(scan) // 2
        # The beams of the middle, whatever the field of view: a share of the scan about as wide as the body
        # near by.
        half = max(len(scan) // 7, 1)
        is_near = bool((scan[ahead - half : ahead + half + 1] < self._team.belief(agent).radius + NEAR).any())
        wanted = self._headings[agent]
        if wanted is None and (is_near or observation["bumper"].any()):
            wanted = heading + float(self._generators[agent].uniform(math.pi / 3, math.pi)) * float(
                self._generators[agent].choice([-1.0, 1.0])
            )
        if wanted is not None:
            error = math.remainder(wanted - heading, 2.0 * math.pi)
            if abs(error) > 0.1:
                self._headings[agent] = wanted
                return np.array([0.0, max(-0.5, min(0.5, error))], np.float32)
            wanted = None
        self._headings[agent] = wanted
        if is_near:
            return np.zeros(2, np.float32)
        belief = self._team.belief(agent)
        return np.array([self._speed * belief.yielding(self._speed * belief.robot.max_speed), 0.0], np.float32)

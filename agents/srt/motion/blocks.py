"""What a blocked robot does: gives up a goal, steps aside, or backs out."""

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.motion.drive import Limits
from lidarium.agents.srt.safe_region import safe_region, view_of
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SrtSettings
from lidarium.envs.settings.lidar import Lidar

TEAMMATE_NEAR = 1.5
"""A teammate within this distance may be what blocks a robot [m]."""

ASIDES = 6
"""How often in a row a robot steps aside on its way before it gives its target up."""

ASIDE_DISTANCES = 0.3, 1.2
"""Nearest and farthest place to which a robot steps aside [m]."""


class Remedy(Enum):
    """What a blocked robot does."""

    GIVE_GOAL_UP = "give_goal_up"
    STEP_ASIDE = "step_aside"
    BACK_OUT = "back_out"


class Blocks:
    """How often a robot was blocked, and stepped aside, without coming anywhere.

    Attributes
    ----------
    asides : int
        How often in a row it has stepped aside.
    failures : int
        How often in a row it was blocked.
    """

    def __init__(self) -> None:
        self.asides = self.failures = 0

    @property
    def are_hopeless(self) -> bool:
        """Whether the robot was blocked too often in a row."""
        return self.failures > ASIDES

    def remedy(self, senses: Senses, here: int, *, is_goal: bool) -> Remedy:
        """Return what to do now, and count.

        Parameters
        ----------
        senses : Senses
            What the robot senses.
        here : int
            How often in a row it was blocked at this place.
        is_goal : bool
            Whether it was on the last leg to the goal.
        """
        self.failures += 1
        steps_aside = here % 3 == 2 or any(
            senses.distance_to(teammate) < TEAMMATE_NEAR for teammate in senses.teammates
        )
        if is_goal and self.are_hopeless:
            # What stands there, such as teammates who have come to the same goal, does not go away.
            self.failures = 0
            return Remedy.GIVE_GOAL_UP
        if steps_aside and self.asides < ASIDES:
            self.asides += 1
            return Remedy.STEP_ASIDE
        self.asides = 0
        return Remedy.BACK_OUT


def place_aside(
    senses: Senses,
    lidar: Lidar,
    settings: SrtSettings,
    limits: Limits,
    perception: float,
    generator: np.random.Generator,
) -> NDArray[np.float64] | None:
    """Return a drawn place in sight to step aside to (2,) [m], None where there is none.

    Of two robots that block each other, one thus lets the other pass. What is farther than ``perception``
    [m] counts as unseen.
    """
    region = safe_region(
        senses.pose[:2],
        view_of(senses.scan, lidar, float(senses.pose[2])),
        float(senses.pose[2]),
        "radial",
        limits.radius,
        perception,
    )
    for _ in range(settings.tries):
        angle = float(generator.uniform(-math.pi, math.pi))
        distance = float(generator.uniform(*ASIDE_DISTANCES))
        if region.radius_at(angle) >= distance:
            return np.asarray(region.place + distance * np.array([math.cos(angle), math.sin(angle)]))
    return None

"""The inputs of one robot's decision.

They are pose, scan and goal in the frame of the team's graph, and its memory.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.memories import MapMemory, Memory, RegionMemory
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.onboard.belief import Belief
from lidarium.mapping.grids.scan_geometry import ScanGeometry

CONTACT_AGE_S = 1.0
"""Robots whose messages are at most this old are in contact [s]."""


@dataclass(frozen=True, slots=True)
class Senses:
    """Inputs of a robot's decision.

    Attributes
    ----------
    time_s : float
        Simulated time [s].
    pose : (3,) float64
        Its believed pose, in the frame of the map's first cell [m, rad].
    scan : (beams,) float32
        Ranges of the laser [m].
    is_pressed : bool
        Whether the bumper is pressed.
    goal : (2,) float64 or None
        Its goal [m].
    teammates : list of (2,) float64
        Positions of teammates that it heard from recently [m].
    """

    time_s: float
    pose: NDArray[np.float64]
    scan: NDArray[np.float32]
    is_pressed: bool
    goal: NDArray[np.float64] | None
    teammates: list[NDArray[np.float64]]

    def is_blind(self, geometry: ScanGeometry) -> bool:
        """Whether no beam measures anything."""
        with np.errstate(invalid="ignore"):
            return not bool((self.scan >= geometry.range_min).any())

    def distance_to(self, place: NDArray[np.float64]) -> float:
        """Return the distance to a place [m]."""
        return math.dist(self.pose[:2], place)


def senses_of(time_s: float, observation: Observation, belief: Belief) -> Senses:
    """Return the inputs of a robot's decision, from an observation and its belief."""
    origin = np.array(belief.map_origin)
    pose = np.asarray(belief.pose, np.float64)
    teammates = [
        teammate.pose[:2] - origin for teammate in belief.teammates.values() if teammate.age_s <= CONTACT_AGE_S
    ]
    return Senses(
        time_s,
        np.array([*(pose[:2] - origin), pose[2]]),
        observation["scan"],
        bool(np.any(observation.get("bumper", 0))),
        None if belief.goal is None else belief.goal - origin,
        teammates,
    )


def memory_of(belief: Belief, known: Iterable[Node], settings: SrtSettings) -> Memory:
    """Return the memory of a robot.

    This is the map that reached it, or the nodes that it knows.
    """
    if settings.memory == "regions":
        return RegionMemory(known)
    shared = belief.shared_map
    return MapMemory(belief.map if shared is None else shared, belief.radius)

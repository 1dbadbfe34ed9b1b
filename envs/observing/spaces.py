"""Spaces of observations, and of the actions that go with them."""

import math
import os

import numpy as np
from gymnasium import spaces

from lidarium.envs.observing.observables import computed
from lidarium.envs.observing.rows import FARTHEST
from lidarium.envs.settings.exploration import OBSERVABLES, ExplorationSettings
from lidarium.envs.settings.limits import GAINS, LEVEL_OBSERVABLES
from lidarium.envs.settings.observables import SENSED

KERNEL_SUMMARIES = {
    "scan": "ranges [m], (beams,)",
    "pose": "x, y [m], theta [rad] as the robot believes, in its map frame, (3,)",
    "velocity": "speed [m/s] and turn rate [rad/s] as the wheels measure, (2,)",
    "bumper": "1 where pressed: left, centre, right, (3,)",
    "map": "the map around the robot, (1, M, M)",
    "egocentric_map": "turned crops of the map around the robot, (scales, C, C)",
    GAINS: "unknown area in view at each frontier on offer [m2], (F,); at the level of frontiers",
}
"""One-line description of each observable of the kernel."""


_COPIES = 7
"""How many times as much as a batch observes is held: in buffers, copies, and bounds of its spaces."""

KEYS = (*OBSERVABLES, "goal")
"""All keys that the kernel writes, in the order in which it takes the arrays."""


def observed_keys(settings: ExplorationSettings, has_goal: bool) -> tuple[str, ...]:
    """Return the keys of an observation that the writer writes.

    They are the keys that the settings choose, except functions, and the goal if the floor has one.
    """
    functions = computed(settings)
    chosen = tuple(name for name in settings.observe if name not in (*functions, *LEVEL_OBSERVABLES))
    return (*chosen, "goal") if has_goal else chosen


def observation_space(settings: ExplorationSettings, has_goal: bool) -> spaces.Dict:
    """Return the space of one robot's observation; every box is bounded."""
    boxes = boxes_of(settings)
    return spaces.Dict({name: boxes[name] for name in (*observed_keys(settings, has_goal), *computed(settings))})


def boxes_of(settings: ExplorationSettings) -> dict[str, spaces.Box]:
    """Return the space of everything that can be observed."""
    cells, own_cells = settings.map_cells, settings.egocentric_cells
    pose_limit = np.array([FARTHEST, FARTHEST, math.pi], np.float32)
    # The largest float32 angle that is wrapped from float64 may round up to the float32 above pi.
    pose_limit[2] = np.nextafter(np.float32(math.pi), np.float32(4.0))
    velocity_limit = settings.speed_limits.max(axis=0).astype(np.float32)
    return {
        "scan": spaces.Box(0.0, np.float32(settings.lidar.range_max), (settings.lidar.beams,), np.float32),
        "pose": spaces.Box(-pose_limit, pose_limit, dtype=np.float32),
        "velocity": spaces.Box(-velocity_limit, velocity_limit, dtype=np.float32),
        "bumper": spaces.Box(0, 1, (3,), np.int8),
        "map": spaces.Box(0, 255, (1, cells, cells), np.uint8),
        "egocentric_map": spaces.Box(0, 255, (len(settings.egocentric_scales), own_cells, own_cells), np.uint8),
        "goal": spaces.Box(-FARTHEST, FARTHEST, (2,), np.float32),
        **{name: SENSED[name].box(settings) for name in settings.observe if name in SENSED},
    }


def action_space() -> spaces.Box:
    """Return the space of one robot's action.

    An action is speed and turn rate as shares of the robot's limits.
    """
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def check_memory(episodes: int, settings: ExplorationSettings, has_goal: bool) -> None:
    """Check that this machine has the memory for what a batch of episodes observes."""
    if not hasattr(os, "sysconf"):
        return
    boxes = observation_space(settings, has_goal).values()
    observed = settings.robots * sum(box.low.nbytes for box in boxes if isinstance(box, spaces.Box))
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if _COPIES * episodes * observed > memory:
        raise ValueError(
            f"the number of episodes is {episodes:,}, which observe {episodes * observed / 2**30:,.1f} GiB and hold "
            f"about {_COPIES} times as much; this machine has {memory / 2**30:,.1f} GiB: want at most "
            f"{memory // (_COPIES * observed):,}, or fewer map_cells or egocentric_cells"
        )

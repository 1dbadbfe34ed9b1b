"""The hash that identifies a re-run as the same.

It is of all that an episode leaves in its world.
"""

import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv

_ARRAYS = (
    "steps",
    "poses",
    "believed",
    "velocities",
    "ranges",
    "bumpers",
    "contacts",
    "travelled",
    "collisions",
    "seen",
    "team_seen",
    "counted",
)


def state_sha256(env: ExplorationEnv) -> str:
    """Return a hash of the state of an environment's world, to the bit.

    It covers the number of steps; true and believed poses, velocities, scans, bumpers and contacts; ways,
    collisions and counts of seen cells; the scorer's masks and the robots' maps; and why each robot ended. It
    does not cover what is made of these: observations, plans, clearance.
    """
    simulation = env.simulation
    owners = (simulation, simulation.world, simulation.beliefs, simulation.score)
    digest = hashlib.sha256()
    for name in _ARRAYS:
        _add(digest, name, next(getattr(owner, name) for owner in owners if hasattr(owner, name)))
    for name in ("masks", "team_masks", "counted_masks"):
        for mask in getattr(env.score, name):
            _add(digest, name, mask)
    for log_odds in env.beliefs.log_odds:
        _add_map(digest, log_odds)
    digest.update(json.dumps(env.scorer.ended_because, sort_keys=True).encode())
    return digest.hexdigest()


def _add(digest: "hashlib._Hash", name: str, array: NDArray[Any]) -> None:
    digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
    digest.update(np.ascontiguousarray(array).data)


def _add_map(digest: "hashlib._Hash", log_odds: NDArray[np.int8]) -> None:
    """Add the rows of a map from the first to the last that is not blank.

    Much of a large map was never touched.
    """
    used = np.flatnonzero(log_odds.view(np.uint64).any(axis=1))
    low, high = (int(used[0]), int(used[-1]) + 1) if used.size else (0, 0)
    digest.update(f"map {log_odds.shape} from row {low};".encode())
    _add(digest, "log_odds", log_odds[low:high])

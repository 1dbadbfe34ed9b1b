"""The robots' maps, overlaid on the lattice of the scorer's masks."""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.maps_on_floor import laid, map_on_floor


def maps_on_floor(env: ExplorationEnv) -> NDArray[np.int8]:
    """Return the robots' log-odds on the lattice of the scorer's masks.

    The shape is (robots, rows, columns) int8; 0 beyond a map.

    Maps of robots that do not know their starts are overlaid on it by their true starts: with true poses that is
    the best fit of the trajectories.
    """
    settings = env.settings
    rows, words = env.score.counted_masks[0].shape
    window = slice(0, rows), slice(0, words * 64)
    return np.stack([map_within(env, row, *window) for row in range(settings.robots)])


def map_within(env: ExplorationEnv, row: int, rows: slice, columns: slice) -> NDArray[np.int8]:
    """Return a robot's log-odds within a window of the lattice of the scorer's masks.

    As in `maps_on_floor`; the window has a start and a stop within the lattice.
    """
    return map_on_floor(env.simulation, env.settings, row, rows, columns)


def team_log_odds(env: ExplorationEnv) -> tuple[NDArray[np.int16], tuple[float, float]]:
    """Return the sum of the robots' maps and its lower left corner [m].

    The corner is that of cell (0, 0), in the floor's frame.

    The lattice is that of the scorer's masks; see `maps_on_floor`.
    """
    tables = env.world.floors[0]
    assert tables is not None
    return np.asarray(np.sum(maps_on_floor(env), axis=0, dtype=np.int16)), tables.laser.origin


def shares_one_map(env: ExplorationEnv) -> bool:
    """Return whether the robots' maps reach all of them.

    With known starts and the ideal radio each holds the sum of all.
    """
    return env.settings.known_starts and env.settings.robots > 1 and env.settings.radio.is_ideal


def held_maps(env: ExplorationEnv) -> list[NDArray[np.int8]]:
    """Return the summed map that each robot holds, on the masks' lattice.

    The radio is not ideal: the sum is of its own map and those that reached it.
    """
    held = [env.perception.shared_map(row) for row in range(env.settings.robots)]
    return [
        laid(env.simulation, row, 0, navigation.log_odds)
        for row, navigation in enumerate(held)
        if navigation is not None
    ]


def free_as_held(env: ExplorationEnv, maps: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return which cells each robot holds to be free.

    A cell is free by its own map or, if the team's map reaches it, by the team's.

    Parameters
    ----------
    maps : (robots, rows, columns) int8
        Log-odds of `maps_on_floor`.

    Returns
    -------
    (robots, rows, columns) bool
        If it is less than 0; read-only.
    """
    if env.perception.hears:
        return np.stack(held_maps(env)) < 0
    if not shares_one_map(env):
        return np.asarray(maps < 0)
    return np.broadcast_to(np.sum(maps, axis=0, dtype=np.int16) < 0, maps.shape)


def believed_on_floor(env: ExplorationEnv) -> NDArray[np.float64]:
    """Return the believed poses in the floor's frame, (robots, 3) [m, rad].

    Those of robots that do not know their starts are seen from their true starts.
    """
    believed = env.beliefs.believed.copy()
    if env.settings.known_starts:
        return believed
    starts = env.world.starts
    cosine, sine = np.cos(starts[:, 2]), np.sin(starts[:, 2])
    return np.stack(
        [
            starts[:, 0] + cosine * believed[:, 0] - sine * believed[:, 1],
            starts[:, 1] + sine * believed[:, 0] + cosine * believed[:, 1],
            starts[:, 2] + believed[:, 2],
        ],
        axis=1,
    )

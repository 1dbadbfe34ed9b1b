"""The true state of a team, of one size on every floor, for critics that are trained with it."""

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.arrays import ENDED, FRAME_X, FRAME_Y
from lidarium.envs.simulation.simulation import Simulation

ROBOT_NUMBERS = ("x", "y", "cos", "sin", "speed", "turn_rate", "live")
"""Numbers of each robot: position in the picture, heading, speeds as shares of the limits, 1 if live."""

TEAM_NUMBERS = ("side", "coverage", "time_left")
"""Numbers of the team: side of the picture [100 m], share of F seen, share of the horizon left."""

SIDE_UNIT_M = 100.0


def state_space(settings: ExplorationSettings) -> spaces.Box:
    """Return the space of `team_state`."""
    pictures = 2 * settings.state_cells**2
    size = settings.robots * len(ROBOT_NUMBERS) + len(TEAM_NUMBERS) + pictures
    low, high = np.full(size, -np.inf, np.float32), np.full(size, np.inf, np.float32)
    low[-pictures:], high[-pictures:] = 0.0, 1.0
    return spaces.Box(low, high, dtype=np.float32)


def team_state(simulation: Simulation, settings: ExplorationSettings, episode: int = 0) -> NDArray[np.float32]:
    """Return the true state of a team.

    Numbers of each robot (``ROBOT_NUMBERS``), then of the team (``TEAM_NUMBERS``), then two pictures of S x S
    cells, S = ``settings.state_cells``: the share of each cell that counts (F), and that the team has seen. A
    picture's row 0 is at the lowest y; its cells are the smallest whole number of map cells with which the whole floor
    fits. Places are shares of its side from its lower left corner.

    Returns
    -------
    (numbers,) float32
    """
    world, score = simulation.world, simulation.score
    counted, seen = score.counted_masks[episode], score.team_masks[episode]
    cells = settings.state_cells
    block = max(-(-max(_extent(counted)) // cells), 1)
    side = block * cells * settings.occupancy.resolution
    rows = slice(episode * settings.robots, (episode + 1) * settings.robots)
    poses, velocities = world.poses[rows], world.velocities[rows]
    limits = settings.speed_limits
    corner = simulation.frames[episode, [FRAME_X, FRAME_Y]]
    robots = np.column_stack(
        [
            (poses[:, :2] - corner) / side,
            np.cos(poses[:, 2]),
            np.sin(poses[:, 2]),
            velocities / limits,
            (world.flags[rows] & ENDED) == 0,
        ]
    )
    horizon = settings.horizon_steps
    left = 1.0 if horizon is None else 1.0 - world.steps[episode] / horizon
    team = (side / SIDE_UNIT_M, score.coverage(episode), left)
    pictures = [_shares(mask, block, cells).ravel() for mask in (counted, seen)]
    return np.concatenate([robots.ravel(), team, *pictures], dtype=np.float32, casting="unsafe")


def _extent(mask: NDArray[np.uint64]) -> tuple[int, int]:
    """Return the rows and columns of a mask up to its last cell; at least one each."""
    rows = np.flatnonzero(mask.any(axis=1))
    together = np.bitwise_or.reduce(mask, axis=0)
    columns = np.flatnonzero(unpack_bits(together[None], mask.shape[1] * 64)[0])
    return (int(rows[-1]) + 1, int(columns[-1]) + 1) if len(rows) else (1, 1)


def _shares(mask: NDArray[np.uint64], block: int, cells: int) -> NDArray[np.float64]:
    """Return the shares of blocks of a mask that are set, (cells, cells)."""
    side = block * cells
    whole = np.zeros((side, side), np.bool_)
    unpacked = unpack_bits(mask, min(mask.shape[1] * 64, side))[:side]
    whole[: unpacked.shape[0], : unpacked.shape[1]] = unpacked
    return np.asarray(whole.reshape(cells, block, cells, block).mean(axis=(1, 3)))

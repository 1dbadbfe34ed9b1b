"""Records as demonstrations: the observations of each robot before each step, and its action."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.record.episode_record import EpisodeRecord
from lidarium.evaluation.record.replay import drive_again, first_difference, is_same
from lidarium.mapping.files.output import write_arrays


def write_demonstrations(path: Path, record: EpisodeRecord, floor: str | Floor | None = None) -> None:
    """Write a recorded episode as a NumPy archive (.npz) to imitate, whole or not at all.

    Of each robot ``robot_0/actions`` (T, 2) float32 are the actions at the level ``velocity``, and ``robot_0/NAME``
    (T, ...) the observations before them, for the T steps until it ended.
    """
    kept: dict[str, list[NDArray[Any]]] = {}

    def keep(env: ExplorationEnv, observations: dict[str, Any], commands: NDArray[np.float64]) -> None:
        shares = (commands / env.settings.speed_limits).astype(np.float32)
        for row, agent in enumerate(env.possible_agents):
            if agent in env.agents and agent in observations:
                named = {**observations[agent], "actions": shares[row]}
                for name, value in named.items():
                    kept.setdefault(f"{agent}/{name}", []).append(np.array(value))

    env = drive_again(record, floor, before_step=keep)
    if not is_same(record, env):
        raise ValueError(f"the episode does not run as it was recorded: {first_difference(record, env)}")
    write_arrays(path, {name: np.stack(values) for name, values in kept.items()})

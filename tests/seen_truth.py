"""Episodes of a team that has its eyes open, beside the truth."""

import numpy as np

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings

NEAR = np.array([(2.5, 4.0, 0.0), (2.5, 4.6, 1.0)])
"""Starts of two robots in one room of the apartment."""


def begun(starts=NEAR, floor="apartment", **options):
    """Return an environment whose robots stand at given starts."""
    settings = make_settings(**{"robots": len(starts), "resolution": 0.05, **options})
    env = ExplorationEnv(floor, settings)
    env.reset(seed=0, options={"starts": np.asarray(starts)})
    return env


def scribbled(env, generator, half=20):
    """Write log-odds that contradict each other around each robot, and note them as changed."""
    for row, log_odds in enumerate(env.beliefs.log_odds):
        x, y = env.beliefs.believed[row, :2] - env.beliefs.origins[row]
        i, j = (int(side / env.settings.occupancy.resolution) for side in (y, x))
        log_odds[i - half : i + half, j - half : j + half] = generator.integers(-3, 4, (2 * half, 2 * half))
        env.beliefs.windows[row] = (0, log_odds.shape[0], 0, log_odds.shape[1])

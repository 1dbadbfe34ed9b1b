"""Shared parts of the wrappers of the levels of decision.

Everything but the decisions belongs to the environment.
"""

from typing import Any

from gymnasium import spaces
from gymnasium.vector import VectorEnv

from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.team_wrapper import TeamWrapper


class DecisionWrapper(TeamWrapper):
    """Lets another level of decision drive an environment.

    The environment remains the one that keeps the episode.

    Parameters
    ----------
    env : ExplorationEnv
        The environment to drive in.
    name : str
        Name of the wrapped environment.

    Raises
    ------
    ValueError
        Where ``env`` is another environment.
    """

    env: ExplorationEnv

    def __init__(self, env: ExplorationEnv, name: str) -> None:
        super().__init__(exploration_below(env, type(self).__name__))
        self.metadata = {**env.metadata, "name": name, "render_fps": 1.0 / env.settings.decision_period_s}


def exploration_below(env: Any, wrapper: str) -> ExplorationEnv:  # noqa: ANN401
    """Return the environment below a wrapper.

    Raises
    ------
    ValueError
        Where it is not one of a single team.
    """
    if not isinstance(env, ExplorationEnv):
        what = "a batch of many episodes" if isinstance(env, VectorEnv) else "no team's environment"
        raise ValueError(
            f"{wrapper} is put around {type(env).__name__}, {what}; want an environment of "
            "lidarium.parallel_env"
        )
    return env


def boxes_of(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """Return the parts of a space of observations, by key."""
    assert isinstance(space, spaces.Dict)
    return dict(space.spaces)

"""The forms that trainers want for the rows of a batch."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.conventions.conventions import Conventions
from lidarium.envs.conventions.number_infos import flat_row_infos
from lidarium.envs.conventions.observation_forms import ObservationForm
from lidarium.envs.conventions.team_rewards import TEAM, shared_rewards


class RowConventions:
    """Gives what a batch returns the forms of conventions.

    Parameters
    ----------
    space : Space
        Of the observations of a row as they are.
    conventions : Conventions
        The forms.
    robots, rows : int
        Robots of an episode, and rows of the batch.

    Attributes
    ----------
    space : Space
        Of the observations of a row in this form.

    Raises
    ------
    ValueError
        Where observations cannot take the form, or ended agents are to stay: rows do so in any case.
    """

    def __init__(self, space: spaces.Space[Any], conventions: Conventions, robots: int, rows: int) -> None:
        if conventions.ended_agents != "leave":
            raise ValueError(
                f"ended_agents is {conventions.ended_agents!r}; leave it out: rows of robots that have ended "
                'repeat their last observation, and infos["active"] says so'
            )
        self._form = ObservationForm(space, conventions)
        self._conventions, self._robots, self._rows = conventions, robots, rows
        self.space = self._form.space
        self.columns = self._form.columns

    def observations(self, arrays: Mapping[str, NDArray[Any]]) -> Any:  # noqa: ANN401
        """Return the observations of all rows."""
        return self._form.of(arrays, (self._rows,))

    def observation(self, arrays: Mapping[str, NDArray[Any]]) -> Any:  # noqa: ANN401
        """Return the observation of one row."""
        return self._form.of(arrays)

    def rewards(
        self, rewards: NDArray[np.float64], acted: NDArray[np.bool_], infos: dict[str, Any]
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Return rewards (rows,) with the team's share, and infos whose terms add up to them."""
        share = self._conventions.team_reward
        if not share:
            return rewards.copy(), infos
        teams = (-1, self._robots)
        mixed = shared_rewards(rewards.reshape(teams), acted.reshape(teams), share).ravel()
        return mixed, {**infos, "reward_terms": {**infos["reward_terms"], TEAM: mixed - rewards}}

    def infos(self, infos: dict[str, Any]) -> dict[str, Any]:
        """Return infos of all rows, arrays with their masks."""
        if self._conventions.infos == "full":
            return infos
        return {} if self._conventions.infos == "none" else flat_row_infos(infos, self._rows)

"""The forms that trainers want for the rows of a batch."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.batch.episodes import EpisodeBatch
from lidarium.envs.batch.merged_rows import MergedRows
from lidarium.envs.conventions.conventions import Conventions
from lidarium.envs.conventions.messages import MESSAGES, MessageBoard, split_action, talking_space
from lidarium.envs.conventions.number_infos import flat_row_infos
from lidarium.envs.conventions.observation_forms import MASK, ObservationForm
from lidarium.envs.conventions.team_rewards import TEAM, shared_rewards
from lidarium.envs.wrappers.team_exchange import MergingSettings


class RowConventions:
    """Gives what a batch takes and returns the forms of conventions.

    Parameters
    ----------
    batch : EpisodeBatch
        The episodes.
    conventions : Conventions
        The forms.
    merging : MergingSettings or None
        How robots merge their maps; they do not where None.

    Attributes
    ----------
    space, action_space : Space
        Of the observations and actions of a row in these forms.
    columns : tuple
        Where each key lies in the flat form; see ``flat_columns``.

    Raises
    ------
    ValueError
        Where observations cannot take the form, or ended agents are to stay: rows do so in any case.
    """

    def __init__(
        self, batch: EpisodeBatch, conventions: Conventions, merging: MergingSettings | None = None
    ) -> None:
        if conventions.ended_agents != "leave":
            raise ValueError(
                f"ended_agents is {conventions.ended_agents!r}; leave it out: rows of robots that have ended "
                'repeat their last observation, and infos["active"] says so'
            )
        self._batch, self._conventions = batch, conventions
        self._robots, self._rows = batch.robots, batch.rows
        self._board: MessageBoard | None = None
        self._merged = None if merging is None else MergedRows(batch, merging)
        self._seen = np.ones(batch.rows, np.bool_)
        space, self.action_space = batch.observation_space, batch.action_space
        if self._merged is not None:
            space = spaces.Dict({**space.spaces, **self._merged.boxes})
        if conventions.comm:
            self._board = MessageBoard(batch.perception, batch.settings, conventions.comm)
            space = spaces.Dict({**space.spaces, MESSAGES: self._board.box})
            self.action_space = talking_space(batch.action_space, conventions.comm)
            self._sent = np.zeros((self._rows, conventions.comm))
            self._messages = self._board.table()
        self._form = ObservationForm(space, conventions)
        self.space, self.columns = self._form.space, self._form.columns

    def actions(self, actions: Any) -> Any:  # noqa: ANN401
        """Return actions without their messages, which are kept to be sent."""
        if self._board is None:
            return actions
        has_vectors = isinstance(self._batch.action_space, spaces.Box)
        rest, message = split_action(actions, self._conventions.comm, has_vectors, "all rows")
        if message.shape != self._sent.shape:
            raise ValueError(
                f"messages have shape {message.shape}; want {self._sent.shape}: one for each row = episode * "
                "robots + robot"
            )
        self._sent = message
        return rest

    def exchange(self) -> None:
        """Let messages and maps be exchanged, after a run of the batch."""
        if self._board is None and self._merged is None:
            return
        batch = self._batch
        began = np.asarray(batch.world.steps <= 0)
        self._seen = batch.acted | np.repeat(began, batch.robots)
        if self._board is not None:
            self._board.exchange(self._sent, batch.acted)
            self._board.start(np.flatnonzero(began))
            self._messages = np.where(self._seen[:, None, None], self._board.table(), self._messages)
        if self._merged is not None:
            self._merged.exchange(self._seen, began)

    def observations(self, arrays: Mapping[str, NDArray[Any]]) -> Any:  # noqa: ANN401
        """Return the observations of all rows."""
        return self._form.of(self._with_more(arrays), (self._rows,))

    def observation(self, arrays: Mapping[str, NDArray[Any]], row: int) -> Any:  # noqa: ANN401
        """Return the observation of one row, its own arrays."""
        return self._form.of({name: array[row].copy() for name, array in self._with_more(arrays).items()})

    def _with_more(self, arrays: Mapping[str, NDArray[Any]]) -> Mapping[str, NDArray[Any]]:
        """Return the observations with what was exchanged."""
        more: dict[str, NDArray[Any]] = {} if self._merged is None else dict(self._merged.arrays)
        if self._board is not None:
            more[MESSAGES] = self._messages
        return {**arrays, **more} if more else arrays

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
        if self._merged is not None:
            infos = self._merged.infos(infos, self._seen)
        if self._conventions.infos != "full":
            infos = {} if self._conventions.infos == "none" else flat_row_infos(infos, self._rows)
        if not self._form.has_mask_apart:
            return infos
        masks = self._batch.observations[MASK].copy()
        return {**infos, MASK: masks, f"_{MASK}": self._batch.everyone}

"""Numbers that robots send each other with their actions, over the radio of their team."""

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.onboard.perception import Perception
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.geometry.bounds import shown

MESSAGES = "messages"
"""Key of the received messages in observations."""

ACTION, MESSAGE = "action", "message"
"""Keys of an action that is no vector."""

OLDEST_S = 3600.0
"""Bound of the age of messages in observations [s]."""


class _Sent(NamedTuple):
    """Messages sent with the actions of a step or decision.

    Attributes
    ----------
    first, last : (episodes,) int64
        It was sent in the steps behind the first one, to the last one.
    messages, acted : (episodes, 1, robots, floats) float64, (episodes, 1, robots) bool
        The messages, and the robots that sent one.
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    messages: NDArray[np.float64]
    acted: NDArray[np.bool_]


class MessageBoard:
    """The messages that the robots of all episodes have received from each other.

    A message goes with the poses that its sender reports in the steps of its action: over the links that work then,
    with their loss and latency. The last one is remembered, with its age.

    Parameters
    ----------
    perception : Perception
        Onboard software of all episodes, with their radio.
    settings : ExplorationSettings
        The team of every episode.
    floats : int
        Numbers of a message.

    Attributes
    ----------
    box : Box
        The space of the received messages of a robot, (robots - 1, floats + 2): from each of the others, in their
        order, the numbers within [-1, 1], their age [s], and 1 if a message has been received.

    Raises
    ------
    ValueError
        If a robot is alone.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings, floats: int) -> None:
        robots, episodes = settings.robots, perception.world.episodes
        if robots < 2:
            raise ValueError(f"comm is {floats} and robots is {robots}; want two robots or more to talk")
        self._perception, self._settings, self._floats = perception, settings, floats
        self._heard = np.zeros((episodes, robots, robots, floats))
        self._heard_at = np.full((episodes, robots, robots), -1, np.int64)
        self._last = np.zeros(episodes, np.int64)
        # Enough for the oldest message that may still arrive.
        on_the_way = round(settings.radio.latency_s / settings.time_step) + 2
        self._log: deque[_Sent] = deque(maxlen=on_the_way)
        high = np.concatenate([np.ones(floats), [OLDEST_S, 1.0]]).astype(np.float32)
        low = np.concatenate([-np.ones(floats), [0.0, 0.0]]).astype(np.float32)
        rows = (robots - 1, 1)
        self.box = spaces.Box(np.tile(low, rows), np.tile(high, rows), dtype=np.float32)

    def start(self, episodes: NDArray[np.int64]) -> None:
        """Begin episodes in which no message has been received."""
        self._heard[episodes], self._heard_at[episodes], self._last[episodes] = 0.0, -1, 0
        for entry in self._log:
            entry.first[episodes], entry.last[episodes] = 0, 0

    def exchange(self, sent: NDArray[np.float64], acted: NDArray[np.bool_]) -> None:
        """Let messages be heard that have arrived, after a step or decision.

        Parameters
        ----------
        sent : (rows, floats) float64
            The messages that robots sent with their actions.
        acted : (rows,) bool
            Rows that acted; all robots may receive.
        """
        episodes, robots = self._heard.shape[:2]
        now = self._perception.world.steps.copy()
        messages = np.clip(sent, -1.0, 1.0).reshape(episodes, 1, robots, -1)
        if (now > self._last).any():  # otherwise episodes have only begun, and messages on the way have to stay
            self._log.append(_Sent(self._last, now, messages, acted.reshape(episodes, 1, robots)))
        self._last = now.copy()
        arrived = self._arrived(now)
        for entry in self._log:
            first, last = entry.first[:, None, None], entry.last[:, None, None]
            is_heard = (arrived > first) & (arrived <= last) & entry.acted
            self._heard = np.where(is_heard[..., None], entry.messages, self._heard)
            self._heard_at = np.where(is_heard, arrived, self._heard_at)

    def _arrived(self, now: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return of which step each robot has last heard of each, (episodes, receivers, senders)."""
        exchanges = self._perception.exchanges
        if not exchanges:
            return np.broadcast_to(now[:, None, None], self._heard_at.shape)
        return np.stack([exchange.heard_at for exchange in exchanges])

    def table(self) -> NDArray[np.float32]:
        """Return the messages received by each robot, (rows, robots - 1, floats + 2), in a new array."""
        episodes, robots = self._heard.shape[:2]
        steps = self._perception.world.steps[:, None, None]
        is_known = self._heard_at >= 0
        age = np.where(is_known, (steps - self._heard_at) * self._settings.time_step, 0.0)
        table = np.concatenate([self._heard, np.minimum(age, OLDEST_S)[..., None], is_known[..., None]], axis=-1)
        others = ~np.eye(robots, dtype=np.bool_)
        return table[:, others].reshape(episodes * robots, robots - 1, -1).astype(np.float32)


class _TalkingSpace(spaces.Dict):
    """Actions with messages, which takes the mask of the actions as that of both, as trainers give it."""

    def sample(self, mask: Any = None, probability: Any = None) -> dict[str, Any]:  # noqa: ANN401
        """Draw an action and a message; a mask (actions,) is that of the action."""
        if mask is not None and not isinstance(mask, Mapping):
            mask = {ACTION: mask, MESSAGE: None}
        if probability is not None and not isinstance(probability, Mapping):
            probability = {ACTION: probability, MESSAGE: None}
        return super().sample(mask) if probability is None else super().sample(mask, probability)


def talking_space(space: spaces.Space[Any], floats: int) -> spaces.Space[Any]:
    """Return a space of actions with messages: a longer vector, or a ``Dict`` if actions are not vectors."""
    message = spaces.Box(-1.0, 1.0, (floats,), np.float32)
    if isinstance(space, spaces.Box):
        low, high = (np.concatenate(pair) for pair in ((space.low, message.low), (space.high, message.high)))
        return spaces.Box(low, high, dtype=np.float32)
    return _TalkingSpace({ACTION: space, MESSAGE: message})


def split_action(
    action: Any,  # noqa: ANN401
    floats: int,
    space: spaces.Space[Any],
    whose: str,
    acting: NDArray[np.bool_] | None = None,
) -> tuple[Any, NDArray[np.float64]]:
    """Return an action in a space, or those of many rows, without the message, and the message.

    Of many rows those that are ``acting`` (rows,) have to have messages; by default all have.

    Raises
    ------
    ValueError
        If there is no message of that many finite numbers.
    """
    rest, message = None, np.zeros(0)
    try:
        if isinstance(space, spaces.Box):
            numbers = np.asarray(action, np.float64)
            if numbers.shape[-1] == space.shape[0] + floats and (acting is not None or numbers.ndim == 1):
                rest, message = numbers[..., :-floats], numbers[..., -floats:]
        else:
            rest, message = action[ACTION], np.asarray(action[MESSAGE], np.float64)
    except (TypeError, ValueError, KeyError, IndexError):
        pass
    is_of_rows = acting is not None and message.shape[:1] == acting.shape
    if message.shape[-1:] != (floats,) or not np.isfinite(message[acting] if is_of_rows else message).all():
        form = (
            f"the action with {floats} numbers behind it"
            if isinstance(space, spaces.Box)
            else f"{{'{ACTION}': ..., '{MESSAGE}': {floats} numbers}}"
        )
        raise ValueError(f"the action of {whose} is {shown(action)}; want {form}, all finite")
    return rest, message

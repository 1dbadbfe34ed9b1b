"""An environment that shows every step of its world to watchers.

Watchers are cameras, histories and records.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.report import GivenUp
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.onboard.radio.messages import Orders
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import level_for


class Watcher:
    """Watches an episode; a watched episode is the same to the bit as one that is not.

    Every method does nothing: a watcher is a subclass that overrides those that it needs.
    """

    def begin(self, env: ExplorationEnv) -> None:
        """Observe an episode after its reset, when the scan at the start is taken."""

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Observe the world after a time step driven at ``commands`` (robots, 2) [m/s, rad/s]."""

    def outcome(self, env: ExplorationEnv) -> None:
        """Observe the episode after rewards and endings, when ended agents have left."""

    def decision(self, env: ExplorationEnv, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Observe a decision that has been carried out."""

    def note(self, kind: str, time_s: float, agent: str | None, **details: Any) -> None:  # noqa: ANN401
        """Take note of an event, such as a message or a merge."""


class WatchedExploration(ExplorationEnv):
    """An exploration environment with watchers, independent of what drives it."""

    def __init__(
        self,
        floor: Floors,
        settings: ExplorationSettings,
        image_resolution: float | None = None,
        watchers: Iterable[Watcher] = (),
    ) -> None:
        level = level_for(settings.observe)  # until a policy's level is used
        super().__init__(floor, settings, image_resolution=image_resolution, level=level)
        self.watchers: list[Watcher] = list(watchers)

    def on_begin(self) -> None:
        """Show the watchers an episode after its reset."""
        for watcher in self.watchers:
            watcher.begin(self)

    def on_step(self, commands: NDArray[np.float64]) -> None:
        """Show the watchers a time step."""
        for watcher in self.watchers:
            watcher.step(self, commands)

    def on_outcome(self) -> None:
        """Show the watchers rewards and endings."""
        for watcher in self.watchers:
            watcher.outcome(self)

    def decided(self, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Show the watchers a decision that has been carried out."""
        for watcher in self.watchers:
            watcher.decision(self, orders, given_up)

    def note_event(self, event: dict[str, Any]) -> None:
        """Show the watchers an event, such as a merge: ``kind``, ``time_s``, ``agent``, further details."""
        for watcher in self.watchers:
            watcher.note(**event)

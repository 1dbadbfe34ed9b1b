"""An environment that shows every step of its world to watchers.

Watchers are cameras, histories and records.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.report import GivenUp
from lidarium.envs.driving.team_driver import TeamDriver
from lidarium.envs.episode_start import EpisodeStart
from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.radio.messages import Orders
from lidarium.envs.settings.exploration import ExplorationSettings


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
    """An exploration environment with watchers, whatever drives it.

    Attributes
    ----------
    driver : TeamDriver or None
        The driver of the robots to their targets; None if a policy decides speeds, and before
        `run_episode`.
    """

    def __init__(
        self,
        floor: Floors,
        settings: ExplorationSettings,
        image_resolution: float | None = None,
        watchers: Iterable[Watcher] = (),
    ) -> None:
        super().__init__(floor, settings, image_resolution=image_resolution)
        self.watchers: list[Watcher] = list(watchers)
        self.driver: TeamDriver | None = None

    def start(self, beginning: EpisodeStart) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode, as ``ExplorationEnv.start``."""
        found = super().start(beginning)
        for watcher in self.watchers:
            watcher.begin(self)
        return found

    def drive_at(self, commands: NDArray[np.float64]) -> None:
        """Run one time step, as ``ExplorationEnv.drive_at``."""
        super().drive_at(commands)
        for watcher in self.watchers:
            watcher.step(self, commands)

    def outcome(
        self,
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Return the result of ``step``, as ``ExplorationEnv.outcome``."""
        found = super().outcome()
        for watcher in self.watchers:
            watcher.outcome(self)
        return found

    def decided(self, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Show the watchers a decision that has been carried out."""
        for watcher in self.watchers:
            watcher.decision(self, orders, given_up)

    def note_event(self, event: dict[str, Any]) -> None:
        """Show the watchers an event, such as a merge: ``kind``, ``time_s``, ``agent``, further details."""
        for watcher in self.watchers:
            watcher.note(**event)

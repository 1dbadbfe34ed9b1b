"""An environment that shows every step of its world to those who watch: cameras, histories, records."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import GivenUp
from lidarium.envs.episode_start import Beginning
from lidarium.envs.exploration import ExplorationEnv, Observation
from lidarium.envs.floors.floor import Floor
from lidarium.envs.radio.messages import Orders
from lidarium.envs.settings.exploration import ExplorationSettings


class Watcher(Protocol):
    """Who looks on. Looking changes nothing: a watched episode is the same to the bit as one that is not."""

    def begin(self, env: ExplorationEnv) -> None:
        """Look at an episode after its reset, when the scan at the start is taken."""

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Look at the world after a time step that was driven at ``commands`` (robots, 2) [m/s, rad/s]."""

    def outcome(self, env: ExplorationEnv) -> None:
        """Look after rewards and endings have been told, when ended agents have left."""


class DecisionWatcher(Watcher, Protocol):
    """Who looks on at decisions as well; a watcher with this method is shown them."""

    def decision(self, env: ExplorationEnv, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Look back at a decision that has been carried out.

        Parameters
        ----------
        env : ExplorationEnv
            The environment.
        orders : Orders or None
            Where the robots were sent; None at the level of velocities.
        given_up : sequence of GivenUp
            All that the policy leaves unexplored by now.
        """


class WatchedExploration(ExplorationEnv):
    """An exploration environment with watchers, whatever drives it.

    Parameters
    ----------
    floor, settings, image_resolution
        As for ``ExplorationEnv``.
    watchers : iterable of Watcher
        Who looks on, in this order; the list ``watchers`` may change between steps.
    """

    def __init__(
        self,
        floor: str | Path | Floor,
        settings: ExplorationSettings,
        image_resolution: float | None = None,
        watchers: Iterable[Watcher] = (),
    ) -> None:
        super().__init__(floor, settings, image_resolution=image_resolution)
        self.watchers: list[Watcher] = list(watchers)

    def start(self, beginning: Beginning) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode, as ``ExplorationEnv.start``."""
        told = super().start(beginning)
        for watcher in self.watchers:
            watcher.begin(self)
        return told

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
        """Return what ``step`` returns, as ``ExplorationEnv.outcome``."""
        told = super().outcome()
        for watcher in self.watchers:
            watcher.outcome(self)
        return told

    def decided(self, orders: Orders | None, given_up: Sequence[GivenUp]) -> None:
        """Show a decision that has been carried out to the watchers that look at them.

        See ``DecisionWatcher``.
        """
        for watcher in self.watchers:
            look = getattr(watcher, "decision", None)
            if look is not None:
                look(self, orders, given_up)

    def tell(self, event: dict[str, Any]) -> None:
        """Tell an event, such as a merge, to the watchers that take notes: ``kind``, ``time_s``, ``agent`` and whatever else is known."""
        for watcher in self.watchers:
            note = getattr(watcher, "note", None)
            if note is not None:
                note(**event)

"""Terms of the reward beside those of the kernels: users register them."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.backend import World
from lidarium.registry import Registry


class RewardTerm(Protocol):
    """A term that users add: an amount per robot, weighted by ``settings.reward.more[name]``."""

    def start(self, world: World, episode: int) -> None:
        """Start an episode, after its robots were placed."""
        ...

    def amounts(self, world: World) -> NDArray[np.float64]:
        """Return the amount of each robot since the last call, shape (rows,)."""
        ...


REWARD_TERMS: Registry[Callable[[], RewardTerm]] = Registry("reward term")
"""Terms that ``settings.reward.more`` can weigh, by name: what makes one."""


class Turning:
    """Amount: by how much a robot has turned [rad]."""

    def __init__(self) -> None:
        self._headings = np.zeros(0)

    def start(self, world: World, episode: int) -> None:
        """Start an episode at the headings of the starts."""
        if self._headings.shape != (len(world.poses),):
            self._headings = np.zeros(len(world.poses))
        rows = slice(episode * world.robots, (episode + 1) * world.robots)
        self._headings[rows] = world.poses[rows, 2]

    def amounts(self, world: World) -> NDArray[np.float64]:
        """Return the turns since the last call, each in [0, pi] [rad]."""
        turns = np.abs((world.poses[:, 2] - self._headings + np.pi) % (2.0 * np.pi) - np.pi)
        self._headings = world.poses[:, 2].copy()
        return np.asarray(turns)


class Failing:
    """Amount: 1 when a robot fails."""

    def __init__(self) -> None:
        self._failed = np.zeros(0, np.uint8)

    def start(self, world: World, episode: int) -> None:
        """Start an episode with nobody failed."""
        if self._failed.shape != world.failed.shape:
            self._failed = np.zeros_like(world.failed)
        self._failed[episode * world.robots : (episode + 1) * world.robots] = 0

    def amounts(self, world: World) -> NDArray[np.float64]:
        """Return 1 for each robot that has failed since the last call."""
        fell = (world.failed != 0) & (self._failed == 0)
        self._failed = world.failed.copy()
        return np.asarray(fell, np.float64)


REWARD_TERMS.register("turning", Turning, "radians turned since the last reward")
REWARD_TERMS.register("failing", Failing, "1 when a robot fails")


class ExtraTerms:
    """The registered terms that settings weigh.

    Parameters
    ----------
    weights : tuple of (str, float)
        ``settings.reward.more``.
    """

    def __init__(self, weights: tuple[tuple[str, float], ...]) -> None:
        self._terms = {name: (weight, REWARD_TERMS[name]()) for name, weight in weights}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the terms."""
        return tuple(self._terms)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is added."""
        return not self._terms

    def start(self, world: World, episode: int) -> None:
        """Start an episode, after its robots were placed."""
        for _, term in self._terms.values():
            term.start(world, episode)

    def earned(self, world: World) -> dict[str, NDArray[np.float64]]:
        """Return what each term has brought each robot since the last call, by name, (rows,) each."""
        return {name: weight * term.amounts(world) for name, (weight, term) in self._terms.items()}

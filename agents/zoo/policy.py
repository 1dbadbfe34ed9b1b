"""Teams of the zoo as policies: the networks that the package has, or those of a training of your own."""

from collections.abc import Mapping
from pathlib import Path

from lidarium.agents.policy import Action, Policy, Team
from lidarium.agents.zoo.network import MASK, NETWORKS, OBSERVED, network_shapes
from lidarium.envs.faces.parallel import Observation
from lidarium.mapping.files.weight_files import WeightFiles


def zoo_files(name: str, level: str = "frontier") -> WeightFiles:
    """Return the files of a team of the zoo at a level, such as ``ppo-2``."""
    return WeightFiles(
        network_shapes(level), "lidarium.agents.zoo", f"{name}.safetensors.xz", f"{name}.json", is_half=True
    )


class ZooTeam(Policy):
    """Robots that share one trained network, and each choose a frontier or a stop of tours by it.

    Parameters
    ----------
    name : str
        The team, such as ``ppo-2``; any team of at least two robots can use its network.
    weights : str or Path, optional
        File of weights of `lidarium train`. Those of the package by default.
    level : str, default "frontier"
        Level at which the network decides, or ``tour``.
    """

    def __init__(self, name: str, weights: str | Path = "", level: str = "frontier") -> None:
        self.level = level
        self.name = f"zoo:{name}"
        self.observes = (*OBSERVED[level][1:], MASK)  # the level adds the options and the mask
        self._network = NETWORKS[level](zoo_files(name, level).load(weights))

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Choose for each robot; one with nothing on offer stays."""
        return {agent: self._network.choose(observation) for agent, observation in observations.items()}


def ppo_2(weights: str | Path = "") -> ZooTeam:
    """Return the team of two that was trained by PPO."""
    return ZooTeam("ppo-2", weights)


def ppo_4(weights: str | Path = "") -> ZooTeam:
    """Return the team of four that was trained by PPO."""
    return ZooTeam("ppo-4", weights)


def mappo_2(weights: str | Path = "") -> ZooTeam:
    """Return the team of two that was trained by MAPPO."""
    return ZooTeam("mappo-2", weights)


def mappo_4(weights: str | Path = "") -> ZooTeam:
    """Return the team of four that was trained by MAPPO."""
    return ZooTeam("mappo-4", weights)


def signal_2(weights: str | Path = "") -> ZooTeam:
    """Return the team of two that was trained by PPO with a radio that breaks."""
    return ZooTeam("signal-2", weights)


def tours_2(weights: str | Path = "") -> ZooTeam:
    """Return the team of two that was trained by PPO at the level of tours."""
    return ZooTeam("tours-2", weights, "tour")

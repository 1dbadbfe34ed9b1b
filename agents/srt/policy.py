"""The policy: a team that explores by sensor-based random trees.

The trees (Oriolo, Vendittelli, Freda and Troso 2004) are joined to one graph.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.srt.explorer import Explorer
from lidarium.agents.srt.senses import CONTACT_AGE_S, memory_of, senses_of
from lidarium.agents.srt.settings import make_srt_settings
from lidarium.agents.srt.tree import Tree
from lidarium.agents.srt.tree_files import read_tree, write_tree
from lidarium.envs.faces.parallel import Observation


class SensorBasedRandomTree(Policy):
    """A policy that grows a tree of places with the safe regions seen there.

    It grows towards the goal if there is one.

    Each robot drives by its own scans. Robots that know each other's starts and are in contact share one
    graph, whose trees are joined by bridges, and leave each other their goals. A robot without work goes
    home; all stop when none has work.

    Parameters
    ----------
    mode : str
        ``default`` or ``thesis``.
    tree : str or Path
        File of the tree of an earlier run in the same place, which goes on growing; needs ``memory="regions"``.
    **settings
        Settings of `SrtSettings`.

    Attributes
    ----------
    tree : Tree
        The graph; places in the frame of the map's first cell.
    """

    level = "velocity"
    observes = ("scan",)

    def __init__(self, mode: str = "default", tree: str | Path = "", **settings: Any) -> None:  # noqa: ANN401
        self.settings = make_srt_settings(mode, **settings)
        if tree and self.settings.memory != "regions":
            raise ValueError(f"tree is {tree} and memory is 'map'; want memory=regions, as maps begin blank")
        self.tree, self._saved = Tree(), Path(tree) if tree else None
        self._explorers: dict[str, Explorer] = {}

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        self._team, self.tree = team, Tree() if self._saved is None else self._read(self._saved, team)
        saved = range(len(self.tree.nodes))
        children = np.random.SeedSequence(seed).spawn(len(team.agents))
        self._explorers = {}
        for agent, child in zip(team.agents, children, strict=True):
            belief = team.belief(agent)
            generator = np.random.default_rng(child)
            self._explorers[agent] = Explorer(agent, self.tree, self.settings, belief.robot, belief.lidar, generator)
            self._explorers[agent].known.update(saved)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Drive every robot for a step."""
        actions: dict[str, Action] = {}
        for agent, observation in observations.items():
            explorer, belief = self._explorers[agent], self._team.belief(agent)
            in_contact = [self._explorers[teammate] for teammate in self._contacts(agent) if teammate in observations]
            for teammate in in_contact:
                teammate.known.update(explorer.known)
                explorer.known.update(teammate.known)
            targets = [teammate.target for teammate in in_contact if teammate.target is not None]
            memory = memory_of(belief, [self.tree.nodes[number] for number in sorted(explorer.known)], self.settings)
            speed, turn_rate = explorer.step(senses_of(self._team.time_s, observation, belief), memory, targets)
            speed *= belief.yielding(speed)
            actions[agent] = _shares(speed / belief.robot.max_speed, turn_rate / belief.robot.max_turn_rate)
        explorers = [self._explorers[agent] for agent in observations]
        if all(explorer.is_home for explorer in explorers):
            return {explorer.agent: Stop(explorer.ending or "explored") for explorer in explorers}
        return actions

    def write_trees(self, folder: Path) -> list[str]:
        """Write the tree to a folder, one for each robot if they do not know their starts; return the names."""
        by_name = {"tree.npz": list(self._explorers)}
        if len(self._explorers) > 1 and not self._team.settings.known_starts:
            by_name = {f"{agent}_tree.npz": [agent] for agent in self._explorers}
        for name, agents in by_name.items():
            nodes = [node for node in self.tree.nodes if node.agent in agents]
            rules = {agent: explorer.rules for agent, explorer in self._explorers.items()}
            write_tree(folder / name, nodes, rules, _origin(self._team, agents[0]))
        return list(by_name)

    @staticmethod
    def _read(path: Path, team: Team) -> Tree:
        """Read the tree of an earlier run."""
        if len(team.agents) > 1 and not team.settings.known_starts:
            raise ValueError(
                f"tree is {path} and the {len(team.agents)} robots do not know their starts; want one robot, or known "
                "starts"
            )
        return read_tree(path, _origin(team, team.agents[0]))

    def _contacts(self, agent: str) -> list[str]:
        """Return the teammates that share a frame with a robot and were heard recently."""
        belief = self._team.belief(agent)
        if belief.shared_map is None:
            return []
        return [
            name
            for name, teammate in belief.teammates.items()
            if teammate.age_s <= CONTACT_AGE_S and name in self._explorers
        ]


def _origin(team: Team, agent: str) -> NDArray[np.float64]:
    """Return the origin of the graph's frame in that of the poses [m], (2,)."""
    belief = team.belief(agent)
    return belief.frame + belief.map_origin


def _shares(speed: float, turn_rate: float) -> NDArray[np.float32]:
    return np.clip(np.array([speed, turn_rate], np.float32), -1.0, 1.0)


def srt_thesis(**settings: Any) -> SensorBasedRandomTree:  # noqa: ANN401
    """Return the policy with the settings of the thesis as printed."""
    return SensorBasedRandomTree(mode="thesis", **settings)

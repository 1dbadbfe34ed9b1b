"""Sparse planning: robots drive along routes that are planned on their sparse maps.

It works with any policy: waypoints, chosen frontiers and orders of a station name the goals as usual.
"""

from typing import Any

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.parallel import Observation, Outcome
from lidarium.envs.faces.sparse_routes import SparseRouter, routed
from lidarium.envs.faces.wrapper import TeamWrapper, exploration_below
from lidarium.envs.onboard.radio.messages import DriveState


class SparsePlanning(TeamWrapper):
    """Lets robots drive to their goals along routes on their sparse maps, instead of paths on grids.

    A robot codes the images of its depth camera, and plans on the resulting graph; if the graph has no path to the
    goal, ground that the camera has not seen counts as free. The robot keeps a route until a new obstacle blocks it.
    Observations, actions and infos are those of the environment below; ``infos[agent]["route"]`` gives the reason if
    there is no route to a robot's goal: ``start in collision``, ``goal in collision`` or ``no path``; otherwise it is
    empty. In a batch: ``vector_env(plans_sparsely=True)``.

    Parameters
    ----------
    env : ParallelEnv
        The environment at the level of waypoints or frontiers, with ``camera`` set.
    shares_map : bool, optional
        Whether robots plan on the map of the whole team, if it reaches them at once. True by default.

    Raises
    ------
    ValueError
        If the robots have no depth camera, or one that sees no ground, or actions are speeds.
    """

    def __init__(self, env: Any, shares_map: bool = True) -> None:  # noqa: ANN401
        base = exploration_below(getattr(env, "unwrapped", env), "SparsePlanning")
        super().__init__(env)
        self.metadata = {**env.metadata, "name": str(env.metadata["name"]).replace("_v1", "_sparse_v1")}
        self._shares_map, self._tells = shares_map, base.conventions.infos == "full"
        self._use(base.engine)

    def _use(self, engine: Engine) -> None:
        self._engine, self._router = engine, SparseRouter(engine, self._shares_map)

    def use_level(self, name: str, shares_map: bool = True, decision_period_s: float | None = None) -> None:
        """Let actions be those of another action level; see ``ExplorationEnv.use_level``."""
        routed(name, self.unwrapped.engine.made_level(name, shares_map, decision_period_s))
        super().use_level(name, shares_map, decision_period_s)
        self._use(self.unwrapped.engine)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode; see ``ExplorationEnv.reset``."""
        observations, infos = super().reset(seed, options)
        if self.unwrapped.engine is not self._engine:  # of settings newly drawn
            self._use(self.unwrapped.engine)
        self._router.start()
        return observations, self._with_reasons(infos)

    def step(self, actions: Any) -> Outcome:  # noqa: ANN401
        """Drive for one decision."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        return observations, rewards, terminations, truncations, self._with_reasons(infos)

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of an agent's drive to its target."""
        return self.unwrapped.drive_state(agent)

    def _with_reasons(self, infos: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        for agent, info in infos.items() if self._tells else ():
            info["route"] = self._router.reasons[self.possible_agents.index(agent)]
        return infos

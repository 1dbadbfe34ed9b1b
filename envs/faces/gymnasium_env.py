"""One robot alone: the Gymnasium form of the environment."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import Observation
from lidarium.envs.faces.teams import make_team
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.onboard.radio.messages import Order
from lidarium.envs.settings.reset_options import Curriculum, checked_seed

AGENT = "robot_0"


class SoloExploration(gymnasium.Env[Observation, Any]):
    """One robot explores a floor (Gymnasium).

    Parameters
    ----------
    floor : Floors, optional
        As for ``lidarium.parallel_env``.
    level : str, optional
        Type of an action: ``velocity`` by default, ``waypoint`` or ``frontier``.
    render_mode : str, optional
        ``human`` or ``rgb_array``. Nothing is drawn by default.
    image_resolution : float, optional
        Side of a pixel [m] if the floor is a plain image.
    curriculum : callable, optional
        As for ``lidarium.parallel_env``.
    **options
        As for ``lidarium.parallel_env``, without ``robots``.

    Raises
    ------
    ValueError
        If an option has a bad value, or the options ask for more than one robot.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        floor: Floors = "apartment",
        level: str = "velocity",
        render_mode: str | None = None,
        image_resolution: float | None = None,
        curriculum: Curriculum | None = None,
        **options: Any,  # noqa: ANN401
    ) -> None:
        if options.setdefault("robots", 1) != 1:
            raise ValueError(
                f"robots is {options['robots']}; the Gymnasium form has one robot, use lidarium.parallel_env for a team"
            )
        self.parallel: Any = make_team(floor, options, None, level, render_mode, image_resolution, curriculum)
        self.metadata = {**type(self).metadata, "render_fps": self.parallel.metadata["render_fps"]}
        self.render_mode = render_mode
        self.observation_space = self.parallel.observation_space(AGENT)
        self.action_space = self.parallel.action_space(AGENT)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; options are those of ``ExplorationEnv.reset``."""
        super().reset(seed=checked_seed(seed))
        observations, infos = self.parallel.reset(seed=seed, options=options)
        return observations[AGENT], infos[AGENT]

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:  # noqa: ANN401
        """Take one step (velocity) or one decision (waypoint, frontier)."""
        if not self.parallel.agents:
            raise RuntimeError("the episode is over or was not started; call reset() before step()")
        observations, rewards, terminations, truncations, infos = self.parallel.step({AGENT: action})
        return observations[AGENT], rewards[AGENT], terminations[AGENT], truncations[AGENT], infos[AGENT]

    @property
    def drawn(self) -> dict[str, Any]:
        """The values that were drawn for this episode, by name; empty if no settings are drawn."""
        return getattr(self.parallel, "drawn", {})

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions may be chosen now, (frontiers + 1,), as sb3-contrib's MaskablePPO asks for.

        Raises
        ------
        AttributeError
            At other levels than that of frontiers.
        """
        masks: NDArray[np.bool_] = self.parallel.unwrapped.action_masks(AGENT)
        return masks

    def get_keys_to_action(self) -> dict[tuple[int, ...], NDArray[np.float32]]:
        """Return the actions of keys W, A, S and D, alone or two together, for ``gymnasium.utils.play``.

        Its ``noop`` has to be ``np.zeros(2, np.float32)``: no key is no action that can be listed.

        Raises
        ------
        AttributeError
            At other levels than that of velocities.
        """
        if self.parallel.unwrapped.level != "velocity":
            raise AttributeError("keys are speeds and turn rates; want level='velocity'")
        actions = {}
        for ahead, speed in ((ord("w"), 1.0), (ord("s"), -0.5), (None, 0.0)):
            for aside, turn in ((ord("a"), 0.5), (ord("d"), -0.5), (None, 0.0)):
                keys = tuple(sorted(key for key in (ahead, aside) if key is not None))
                if keys:
                    actions[keys] = np.array([speed, turn], np.float32)
        return actions

    def stop(self, reason: str) -> None:
        """End the episode at the next step, with a reason."""
        self.parallel.stop(AGENT, reason)

    def order(self, order: Order) -> None:
        """Give the robot an order, as ``ExplorationEnv.order``."""
        self.parallel.order(AGENT, order)

    def render(self) -> NDArray[Any] | None:
        """Draw the environment."""
        frame: NDArray[Any] | None = self.parallel.render()
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        self.parallel.close()

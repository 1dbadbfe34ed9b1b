"""Environments of teams as makers return them: at a level, in the forms of conventions, of drawn settings."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from lidarium.envs.conventions.conventional_env import conventional
from lidarium.envs.conventions.conventions import Conventions, split_options
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.levels.frontiers import FrontierExploration
from lidarium.envs.levels.randomized_team import RandomizedTeam
from lidarium.envs.levels.waypoints import WaypointExploration
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import check_level
from lidarium.envs.settings.making import makers_settings
from lidarium.envs.settings.reset_options import Curriculum


@dataclass(frozen=True, slots=True)
class TeamPlan:
    """What a team's environment is made of beside its settings.

    Attributes
    ----------
    floor : Floors
        As for ``ExplorationEnv``.
    level : str
        What an action is: ``velocity``, ``waypoint`` or ``frontier``.
    render_mode, image_resolution, curriculum
        As for ``ExplorationEnv``.
    """

    floor: Floors
    level: str = "velocity"
    render_mode: str | None = None
    image_resolution: float | None = None
    curriculum: Curriculum | None = None

    def environment(
        self, settings: ExplorationSettings, conventions: Conventions, episode: int | None = None
    ) -> Any:  # noqa: ANN401
        """Return the environment; with an episode's number the curriculum is asked for that one alone."""
        curriculum = self.curriculum
        if curriculum is not None and episode is not None:
            curriculum = partial(_of_episode, curriculum, episode)
        base = ExplorationEnv(self.floor, settings, self.render_mode, self.image_resolution, curriculum)
        return conventional(at_level(base, self.level), conventions)


def _of_episode(curriculum: Curriculum, episode: int, _number: int) -> Mapping[str, Any]:
    """Return the options of one episode, whichever number is asked for."""
    return curriculum(episode)


def make_team(plan: TeamPlan, options: Mapping[str, Any], settings: ExplorationSettings | None = None) -> Any:  # noqa: ANN401
    """Make the environment of a team.

    Parameters
    ----------
    plan : TeamPlan
        Floor, level and the like.
    options : mapping
        Those of ``make_settings``, conventions, and ``randomize``.
    settings : ExplorationSettings or None
        Where the options start from.

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        Where an option or the floor cannot be used.
    """
    conventions, others = split_options(options)
    randomize = others.pop("randomize", None)
    chosen = makers_settings(settings, others)
    if randomize is None:
        return plan.environment(chosen, conventions)
    return RandomizedTeam(partial(_environment, plan, conventions), chosen, randomize)


def _environment(
    plan: TeamPlan, conventions: Conventions, settings: ExplorationSettings, episode: int
) -> Any:  # noqa: ANN401
    return plan.environment(settings, conventions, episode)


def at_level(
    env: ExplorationEnv, level: str, shares_map: bool = True, decision_period_s: float | None = None
) -> ExplorationEnv | WaypointExploration | FrontierExploration:
    """Put the wrapper of a level of decision around an environment.

    ``decision_period_s`` is for the level of waypoints; None for that of the settings.

    Raises
    ------
    ValueError
        Where the level is unknown.
    """
    check_level(env.settings.observe, level)
    if level == "velocity":
        return env
    if level == "waypoint":
        return WaypointExploration(env, shares_map, decision_period_s)
    if level == "frontier":
        return FrontierExploration(env, shares_map)
    raise ValueError(f"level is {level!r}; want velocity, waypoint or frontier")

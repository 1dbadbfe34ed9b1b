"""Makers of environments, as `lidarium` offers them."""

from typing import TYPE_CHECKING, Any, cast

from lidarium.envs.faces.teams import make_team
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum

if TYPE_CHECKING:
    from pettingzoo import AECEnv

    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.faces.stable_baselines import ExplorationVecEnv
    from lidarium.envs.faces.vector_env import ExplorationVectorEnv


def parallel_env(
    floor: Floors = "apartment",
    *,
    level: str = "velocity",
    settings: ExplorationSettings | None = None,
    render_mode: str | None = None,
    image_resolution: float | None = None,
    curriculum: Curriculum | None = None,
    **options: Any,  # noqa: ANN401
) -> "ExplorationEnv":
    """Make the environment of a team (PettingZoo parallel API).

    Robots start at poses drawn by the seed, by default; ``starts="fixed"`` takes the starts of the floor.

    Parameters
    ----------
    floor : str, Path, Floor, sequence, mapping or callable, optional
        A catalogue name (``apartment`` by default), ``building:SEED``, ``set:NAME``, a file that the importers know, or
        a floor; many of them as a list, a folder, a mapping to weights, or a callable of a generator.
    level : str, optional
        Type of an action: ``velocity`` (shares of the maximum speed and turn rate, the default), ``waypoint`` (a point
        of the observed map), ``frontier`` (one of the frontiers in reach), or a level of your own.
    settings : ExplorationSettings, optional
        The settings that the options modify. The defaults of `ExplorationSettings` by default.
    render_mode : str, optional
        ``human`` or ``rgb_array``. Nothing is drawn by default.
    image_resolution : float, optional
        Side of a pixel [m] if the floor is a plain image.
    curriculum : callable, optional
        Takes the number of an episode, from 0 on, and returns options of ``reset`` for it.
    **options
        Any attribute of `ExplorationSettings`, such as ``robots=3`` or ``horizon_s=None``; ``robot`` and ``lidar`` by
        name; ``noise`` (none, datasheet, thesis), ``resolution`` of the maps [m], ``max_cycles`` [steps]; the
        conventions ``observation``, ``action_mask``, ``infos``, ``ended_agents``, ``team_reward``, ``comm``; and
        ``randomize``: distributions of settings by name, drawn for each episode.

    Returns
    -------
    ParallelEnv

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        If an option or the floor cannot be used.

    Examples
    --------
    >>> import lidarium
    >>> env = lidarium.parallel_env("apartment", robots=2)
    >>> observations, infos = env.reset(seed=0)
    >>> sorted(observations)
    ['robot_0', 'robot_1']
    """
    made = make_team(floor, options, settings, level, render_mode, image_resolution, curriculum)
    # One with drawn settings has the same face.
    return cast("ExplorationEnv", made)


def env(floor: Floors = "apartment", **options: Any) -> "AECEnv[str, Any, Any]":  # noqa: ANN401
    """Make the environment of a team (PettingZoo AEC API); options as for `parallel_env`.

    Examples
    --------
    >>> import lidarium
    >>> env = lidarium.env(robots=2)
    >>> env.reset(seed=0)
    >>> env.agent_selection
    'robot_0'
    """
    from pettingzoo.utils.conversions import parallel_to_aec

    converted: AECEnv[str, Any, Any] = parallel_to_aec(parallel_env(floor, **options))
    return converted


def vector_env(
    episodes: int,
    floor: Floors = "apartment",
    **options: Any,  # noqa: ANN401
) -> "ExplorationVectorEnv":
    """Make many episodes as one Gymnasium vector environment, stepped by one kernel call.

    Each episode draws its start poses by default, as `parallel_env` does.

    Parameters
    ----------
    episodes : int
        Number of episodes; ``num_envs`` is episodes x robots.
    floor : Floors, optional
        As for `parallel_env`; of a set such as ``set:train``, each beginning draws one.
    **options
        The options of `parallel_env`; ``copy=False`` for observations in two sets of arrays that take turns,
        ``merging`` (and ``can_talk``) for merged maps, ``plans_sparsely=True`` for routes on sparse maps,
        ``shares_map=False`` for paths on each robot's own map, ``reports=True`` for stations.
        With ``randomize`` each episode is an engine of its own.

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        If an option or the floor cannot be used.

    Examples
    --------
    >>> import lidarium
    >>> envs = lidarium.vector_env(2, "apartment", robots=2)
    >>> observations, infos = envs.reset(seed=0)
    >>> envs.num_envs
    4
    """
    from lidarium.envs.faces.vector_env import ExplorationVectorEnv

    return ExplorationVectorEnv(episodes, floor, **options)


def sb3_vec_env(
    episodes: int,
    floor: Floors = "apartment",
    **options: Any,  # noqa: ANN401
) -> "ExplorationVecEnv":
    """Make many episodes for stable-baselines3, with a row for each robot; it needs ``lidarium[rl]``.

    ``num_envs`` is episodes x robots: ``sb3_vec_env(16)`` has 48 rows, 16 episodes of the default team of three.
    An episode begins again in the step that ends it. Each draws its start poses by default.

    Raises
    ------
    ImportError
        If stable-baselines3 is not installed.
    ValueError, TypeError, FileNotFoundError
        If an option or the floor cannot be used.
    """
    from lidarium.envs.faces.stable_baselines import ExplorationVecEnv

    return ExplorationVecEnv(episodes, floor, **options)

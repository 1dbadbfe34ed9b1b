"""lidarium: teams of lidar robots explore unknown floors.

``parallel_env`` makes the PettingZoo environment, ``env`` its turn-based form, ``vector_env`` and
``sb3_vec_env`` many episodes at once, and after ``import lidarium`` Gymnasium knows
``lidarium/Exploration-v1``, ``lidarium/WaypointExploration-v1``, ``lidarium/FrontierExploration-v1`` and
``lidarium/Exploration3D-v1``.
"""

import sys
from typing import TYPE_CHECKING, Any

import gymnasium
import pettingzoo

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec

    from pettingzoo import AECEnv, ParallelEnv

    from lidarium.agents.policy import Policy
    from lidarium.envs.batch.stable_baselines import ExplorationVecEnv
    from lidarium.envs.batch.vector_env import ExplorationVectorEnv
    from lidarium.envs.floors.floor_choice import Floors
    from lidarium.envs.settings.exploration import ExplorationSettings
    from lidarium.envs.settings.reset_options import Curriculum

__version__ = "0.2.0"


class _MovedModules:
    """Asks ``lidarium.moved`` for modules of the package that no other finder has."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> "ModuleSpec | None":
        """Return the spec of a module by its old name, None for any other."""
        if not name.startswith("lidarium.") or name == "lidarium.moved":
            return None
        from lidarium.moved import MovedModules

        return MovedModules().find_spec(name, path, target)


if not any(getattr(finder, "__name__", "") == _MovedModules.__name__ for finder in sys.meta_path):
    sys.meta_path.append(_MovedModules)

_SEES = ("scan", "pose", "velocity", "bumper", "map")

_IDS: dict[str, dict[str, Any]] = {
    "Exploration": {"level": "velocity", "observe": _SEES},
    "WaypointExploration": {"level": "waypoint", "observe": _SEES},
    "FrontierExploration": {"level": "frontier", "observe": _SEES},
    "Exploration3D": {"level": "velocity", "camera": "xtion", "observe": (*_SEES, "depth")},
}
"""What each id means; options of the maker go before."""

_VERSIONS: dict[int, dict[str, Any]] = {
    0: {"starts": "fixed", "frontiers": 16, "least_frontier": 0.1, "frontiers_by_size": 0.0},
    1: {"starts": "drawn"},
}
"""Options of each version of the ids: those whose defaults have changed since, or that a seed needs."""

_UNSEEN: dict[int, tuple[str, ...]] = {0: (), 1: ("pose",)}
"""What each version shows only where ``observe`` asks for it: learners overfit to places."""


def _register(name: str, version: int, options: dict[str, Any]) -> None:
    """Make an environment known to Gymnasium and to PettingZoo, once."""
    registered = f"lidarium/{name}-v{version}"
    if registered in gymnasium.registry:
        return
    gymnasium.register(
        id=registered,
        entry_point="lidarium.envs.levels.gymnasium_env:SoloExploration",
        vector_entry_point="lidarium.envs.batch.vector_env:make_vector_env",
        kwargs=options,
    )
    # Versions of PettingZoo before 1.27 have no register of environments.
    if not hasattr(pettingzoo, "register"):
        return
    pettingzoo.register("parallel", registered, entry_point="lidarium:parallel_env", kwargs=options)
    pettingzoo.register("aec", registered, entry_point="lidarium:env", kwargs=options)


for _name, _options in _IDS.items():
    for _version, _more in _VERSIONS.items():
        _sees = tuple(each for each in _options["observe"] if each not in _UNSEEN[_version])
        _register(_name, _version, {**_options, **_more, "observe": _sees})


def parallel_env(
    floor: "Floors" = "apartment",
    *,
    level: str = "velocity",
    settings: "ExplorationSettings | None" = None,
    render_mode: str | None = None,
    image_resolution: float | None = None,
    curriculum: "Curriculum | None" = None,
    **options: Any,  # noqa: ANN401
) -> "ParallelEnv[str, Any, Any]":
    """Make a team's environment (PettingZoo parallel API).

    Parameters
    ----------
    floor : str, Path, Floor, sequence, mapping or callable
        A catalogue name, ``building:SEED``, ``set:NAME``, a file that the importers know, or a floor; many
        of them as a list, a folder, a mapping to weights, or a callable of a generator.
    level : str
        What an action is: ``velocity`` (shares of the greatest speed and turn rate), ``waypoint`` (a point of
        the observed map) or ``frontier`` (one of the frontiers in reach).
    settings : ExplorationSettings or None
        Where the options start from.
    render_mode : str or None
        ``human``, ``rgb_array`` or None.
    image_resolution : float or None
        Side of a pixel [m] where the floor is a plain image.
    curriculum : callable or None
        Takes the number of an episode, from 0 on, and returns options of ``reset`` for it.
    **options
        Any attribute of ``ExplorationSettings``, such as ``robots=3`` or ``horizon_s=None``; ``robot`` and
        ``lidar`` by name; ``noise`` (none, datasheet, thesis), ``resolution`` of the maps [m], ``max_cycles``
        [steps]; and ``Conventions``: ``observation``, ``action_mask``, ``infos``, ``ended_agents``,
        ``team_reward``, ``comm``; ``randomize``: distributions of settings by name, drawn for each episode.

    Returns
    -------
    ParallelEnv
        The environment.

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        Where an option or the floor cannot be used.
    """
    from lidarium.envs.levels.teams import TeamPlan, make_team

    plan = TeamPlan(floor, level, render_mode, image_resolution, curriculum)
    made: ParallelEnv[str, Any, Any] = make_team(plan, options, settings)
    return made


def env(floor: "Floors" = "apartment", **options: Any) -> "AECEnv[str, Any, Any]":  # noqa: ANN401
    """Make a team's environment in PettingZoo's turn-based form.

    Options as for ``parallel_env``.
    """
    from pettingzoo.utils.conversions import parallel_to_aec

    converted: AECEnv[str, Any, Any] = parallel_to_aec(parallel_env(floor, **options))
    return converted


def vector_env(
    episodes: int,
    floor: "Floors" = "apartment",
    **options: Any,  # noqa: ANN401
) -> "ExplorationVectorEnv":
    """Make many episodes as one Gymnasium vector environment.

    It is stepped by one kernel call and has a row for every robot.

    Parameters
    ----------
    episodes : int
        How many; ``num_envs`` is episodes x robots.
    floor : Floors
        As for ``parallel_env``; of a set such as ``set:train``, each beginning draws one.
    **options
        ``level``, ``image_resolution`` and the options of ``parallel_env``; ``copy=False`` for observations
        in two sets of arrays that take turns; with ``randomize`` each episode is a batch of its own.

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        Where an option or the floor cannot be used.
    """
    if options.get("randomize") is not None:
        from lidarium.envs.batch.randomized_rows import RandomizedVectorEnv

        # It has the same rows, and a batch for each episode.
        randomized: Any = RandomizedVectorEnv(episodes, floor=floor, **options)
        return randomized  # type: ignore[no-any-return]
    from lidarium.envs.batch.vector_env import ExplorationVectorEnv

    return ExplorationVectorEnv(episodes, floor, **options)


def sb3_vec_env(
    episodes: int,
    floor: "Floors" = "apartment",
    **options: Any,  # noqa: ANN401
) -> "ExplorationVecEnv":
    """Make the same rows as ``vector_env`` for stable-baselines3.

    It resets in the step that ends an episode, and needs ``lidarium[rl]``.

    Raises
    ------
    ImportError
        Where stable-baselines3 is not installed.
    ValueError, TypeError, FileNotFoundError
        Where an option or the floor cannot be used.
    """
    from lidarium.envs.batch.stable_baselines import ExplorationVecEnv

    return ExplorationVecEnv(episodes, floor, **options)


def policy(name: str, **settings: Any) -> "Policy":  # noqa: ANN401
    """Make a policy by name, such as ``nearest_frontier``, or your own by ``module:Class``.

    ``lidarium show policies`` lists them.

    Raises
    ------
    ValueError
        Where the name is unknown; the message suggests the nearest one.
    """
    from lidarium.agents import make_policy

    return make_policy(name, **settings)

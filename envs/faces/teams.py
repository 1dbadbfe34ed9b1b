"""Makers of environments: a team at a level, in the forms of conventions, with drawn settings, alone or in batches."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.conventions import split_options
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.faces.randomized import RandomizedRows, RandomizedTeam
from lidarium.envs.faces.team_exchange import MergingSettings
from lidarium.envs.faces.team_rows import TeamRows
from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import makers_settings
from lidarium.envs.settings.reset_options import Curriculum
from lidarium.mapping.kernels.compilation import available_threads


def make_team(
    floor: Floors,
    options: Mapping[str, Any],
    settings: ExplorationSettings | None = None,
    level: str = "velocity",
    render_mode: str | None = None,
    image_resolution: float | None = None,
    curriculum: Curriculum | None = None,
) -> ExplorationEnv | RandomizedTeam:
    """Make the environment of a team; parameters are those of ``lidarium.parallel_env``."""
    conventions, others = split_options(options)
    randomize = others.pop("randomize", None)
    chosen = makers_settings(settings, others)

    make = partial(_make_env, (floor, render_mode, image_resolution, curriculum, level, conventions))
    return make(chosen) if randomize is None else RandomizedTeam(make, chosen, randomize)


def _make_env(options: tuple[Any, ...], settings: ExplorationSettings, episode: int | None = None) -> ExplorationEnv:
    """Make the environment of an episode; a function of the module, so that environments can be pickled."""
    floor, render_mode, image_resolution, curriculum, level, conventions = options
    taught = _taught(curriculum, episode)
    return ExplorationEnv(floor, settings, render_mode, image_resolution, taught, level, conventions)


def make_rows(
    episodes: int,
    floor: Floors,
    options: Mapping[str, Any],
    level: str = "velocity",
    image_resolution: float | None = None,
    copy: bool = True,
    curriculum: Curriculum | None = None,
) -> TeamRows | RandomizedRows:
    """Make the rows of many episodes; parameters are those of ``lidarium.vector_env``.

    Kernels use all threads of the machine by default.
    """
    conventions, others = split_options(options)
    merging, plans_sparsely = others.pop("merging", None), others.pop("plans_sparsely", False)
    if isinstance(merging, bool):
        merging = MergingSettings() if merging else None
    randomize = others.pop("randomize", None)
    reports, settings = others.pop("reports", False), others.pop("settings", None)
    if settings is None and randomize is None:
        others.setdefault("threads", available_threads())
    chosen = makers_settings(settings, others)

    if randomize is not None:
        forms = (conventions, merging, plans_sparsely)
        make = partial(_make_episode, (floor, level, image_resolution, curriculum, reports, forms))
        return RandomizedRows(episodes, make, chosen, randomize)
    engine = Engine(episodes, floor, chosen, level, image_resolution, copy, curriculum, reports)
    return TeamRows(engine, conventions, merging, plans_sparsely)


def _make_episode(options: tuple[Any, ...], settings: ExplorationSettings, episode: int) -> TeamRows:
    floor, level, image_resolution, curriculum, reports, forms = options
    taught = _taught(curriculum, episode)
    engine = Engine(1, floor, settings, level, image_resolution, True, taught, reports)
    return TeamRows(engine, *forms)


def _taught(curriculum: Curriculum | None, episode: int | None) -> Curriculum | None:
    """Return the curriculum, or that of one episode, whichever number is asked for."""
    if curriculum is None or episode is None:
        return curriculum
    return partial(_of_episode, curriculum, episode)


def _of_episode(curriculum: Curriculum, episode: int, _number: int) -> Mapping[str, Any]:
    return curriculum(episode)

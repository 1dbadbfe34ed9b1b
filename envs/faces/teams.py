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
from lidarium.mapping.geometry.bounds import shown
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
    merging, can_talk = others.pop("merging", None), others.pop("can_talk", None)
    if isinstance(merging, bool):
        merging = MergingSettings() if merging else None
    if merging is None and can_talk is not None:
        raise ValueError("can_talk is given, but merging is not; want merging=True or MergingSettings as well")
    plans_sparsely, shares_map = others.pop("plans_sparsely", False), others.pop("shares_map", True)
    for name, value in (("plans_sparsely", plans_sparsely), ("shares_map", shares_map)):
        if not isinstance(value, bool):
            raise ValueError(f"{name} is {shown(value)}; want True or False")
    randomize = others.pop("randomize", None)
    reports, settings = others.pop("reports", False), others.pop("settings", None)
    if settings is None and randomize is None:
        others.setdefault("threads", available_threads())
    chosen = makers_settings(settings, others)

    forms = (conventions, merging, can_talk, plans_sparsely, shares_map)
    of_engine = (floor, level, image_resolution, reports, forms)
    if randomize is not None:
        return RandomizedRows(episodes, partial(_make_episode, of_engine, curriculum), chosen, randomize)
    return _make_rows(of_engine, curriculum, chosen, episodes, copy)


def _make_episode(
    options: tuple[Any, ...], curriculum: Curriculum | None, settings: ExplorationSettings, episode: int
) -> TeamRows:
    return _make_rows(options, _taught(curriculum, episode), settings)


def _make_rows(
    options: tuple[Any, ...],
    curriculum: Curriculum | None,
    settings: ExplorationSettings,
    episodes: int = 1,
    copy: bool = True,
) -> TeamRows:
    floor, level, image_resolution, reports, forms = options
    engine = Engine(episodes, floor, settings, level, image_resolution, copy, curriculum, reports)
    *_, shares_map = forms
    if not shares_map:
        engine.use_level(level, shares_map)
    return TeamRows(engine, *forms)


def _taught(curriculum: Curriculum | None, episode: int | None) -> Curriculum | None:
    """Return the curriculum, or that of one episode, whichever number is asked for."""
    if curriculum is None or episode is None:
        return curriculum
    return partial(_of_episode, curriculum, episode)


def _of_episode(curriculum: Curriculum, episode: int, _number: int) -> Mapping[str, Any]:
    return curriculum(episode)

"""How the episodes of a batch begin, each by draws of its own."""

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.episode_start import EpisodeStart, begin
from lidarium.envs.floors.floor_choice import FloorChoice
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.reset_options import Curriculum, ResetOptions, of_curriculum


class Beginnings:
    """The draws of all episodes, a generator for each.

    Parameters
    ----------
    choice : FloorChoice
        The floor, or a set of which one is drawn.
    settings : ExplorationSettings
        Of every episode.
    episodes : int
        How many.
    curriculum : callable or None
        Options of ``reset`` by the number of an episode, counted over all as they begin.
    """

    def __init__(
        self,
        choice: FloorChoice,
        settings: ExplorationSettings,
        episodes: int,
        curriculum: Curriculum | None = None,
    ) -> None:
        self._choice, self._settings, self._curriculum = choice, settings, curriculum
        self._begun = 0
        self._generators: list[np.random.Generator | None] = [None] * episodes

    def draw(
        self,
        beginning: NDArray[np.int64],
        seeds: Sequence[int | None] | None,
        options: Mapping[int, ResetOptions],
    ) -> dict[int, EpisodeStart]:
        """Draw how episodes begin, before anything of them is changed.

        Parameters
        ----------
        beginning : (K,) int64
            Which episodes.
        seeds : sequence of int or None
            A seed for each of them; None goes on with the episode's own generator.
        options : mapping
            Options by episode.

        Raises
        ------
        ValueError, FileNotFoundError
            Where the floor or an option cannot be used; the generators are as they were then.
        """
        drawn: dict[int, EpisodeStart] = {}
        generators = self._generators.copy()
        for k, episode in enumerate(int(episode) for episode in beginning):
            seed = None if seeds is None else seeds[k]
            # Drawn from a copy: where a later episode cannot begin, nothing has been drawn.
            generator = copy.deepcopy(generators[episode])
            if seed is not None or generator is None:
                generator = np.random.default_rng(seed)
            chosen = of_curriculum(
                self._curriculum,
                self._begun + k,
                options.get(episode, ResetOptions()),
                self._settings.robots,
            )
            drawn[episode] = begin(generator, self._choice, chosen, self._settings)
            generators[episode] = generator
        self._generators = generators
        self._begun += len(drawn)
        return drawn

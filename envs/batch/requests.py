"""What a batch may be asked for at a reset: seeds, a mask of episodes, and options for all or for each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.options import ResetOptions, read_options


def seeds_of(seed: int | Sequence[int | None] | NDArray[np.integer] | None, episodes: int) -> list[int | None]:
    """Return a seed for each episode.

    Parameters
    ----------
    seed : int, sequence or None
        ``s`` gives episode e the seed s + e; a sequence has one entry per episode; None goes on with the episodes' generators.
    episodes : int
        How many.

    Raises
    ------
    ValueError
        Where a sequence has another length, or a seed is not a whole number of zero or more.
    """
    if seed is None:
        return [None] * episodes
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        seeds: list[Any] = [int(seed) + episode for episode in range(episodes)]
    else:
        seeds = list(seed) if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str) else [seed]
        if len(seeds) != episodes:
            raise ValueError(f"seed has {len(seeds)} entries; want one number, or one entry for each of the {episodes} episodes")
    for one in seeds:
        if one is not None and (isinstance(one, bool) or not isinstance(one, int | np.integer) or one < 0):
            raise ValueError(f"seed {one!r} is not a whole number of zero or more")
    return [None if one is None else int(one) for one in seeds]


def episodes_of(options: dict[str, Any] | None, episodes: int) -> NDArray[np.int64]:
    """Return which episodes begin: those of the mask in option ``episodes``, or all.

    Raises
    ------
    ValueError
        Where the mask is not (episodes,) bool with at least one True.
    """
    mask = (options or {}).get("episodes")
    if mask is None:
        return np.arange(episodes)
    chosen = np.asarray(mask)
    if chosen.shape != (episodes,) or chosen.dtype != np.bool_ or not chosen.any():
        raise ValueError(f"option episodes is {mask!r}; want a mask of {episodes} booleans, at least one of them True")
    return np.flatnonzero(chosen)


def options_of(options: dict[str, Any] | None, chosen: NDArray[np.int64], episodes: int, robots: int) -> dict[int, ResetOptions]:
    """Return the options of each chosen episode.

    Each of ``floor``, ``starts`` and ``goal`` is one for all or a sequence with one for every episode of the batch.

    Raises
    ------
    ValueError
        Where an option has a bad value, or as many entries as there are not episodes.
    """
    if not options:
        return {}
    return {
        int(episode): read_options(
            {name: _entry(name, options[name], int(episode), episodes) for name in _KNOWN if name in options}, robots
        )
        for episode in chosen
    }


_KNOWN = {"floor": 0, "starts": 2, "goal": 1}
"""Known options, and the number of axes that one episode's has."""


def _entry(name: str, value: Any, episode: int, episodes: int) -> Any:  # noqa: ANN401
    """Return an option's entry for an episode."""
    if name == "floor":
        if isinstance(value, str | Path | Floor) or value is None:
            return value
        entries: Sequence[Any] = list(value)
    else:
        array = np.asarray(value, np.float64)
        if array.ndim <= _KNOWN[name]:
            return value
        entries = list(array)
    if len(entries) != episodes:
        raise ValueError(f"option {name} has {len(entries)} entries; want one for all, or one for each of the {episodes} episodes")
    return entries[episode]

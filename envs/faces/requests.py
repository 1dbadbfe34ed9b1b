"""Requests at the reset of a batch: seeds, a mask of episodes, and options for all or for each."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.reset_options import (
    OPTIONS,
    ResetOptions,
    check_options,
    checked_seed,
    read_options,
)


def seeds_of(seed: int | Sequence[int | None] | NDArray[np.integer] | None, episodes: int) -> list[int | None]:
    """Return a seed for each episode.

    Parameters
    ----------
    seed : int, sequence or None
        ``s`` gives episode e the seed s + e; a sequence has one entry per episode; None goes on with the
        episodes' generators.
    episodes : int
        Number of these.

    Raises
    ------
    ValueError
        If a sequence has another length, or a seed is not a whole number of zero or more.
    """
    if seed is None:
        return [None] * episodes
    if not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str):
        first = checked_seed(seed)
        assert first is not None
        return [first + episode for episode in range(episodes)]
    if len(seed) != episodes:
        raise ValueError(
            f"seed has {len(seed)} entries; want one number, or one entry for each of the {episodes} episodes"
        )
    return [checked_seed(one) for one in seed]


def episodes_of(options: dict[str, Any] | None, episodes: int, robots: int = 1) -> NDArray[np.int64]:
    """Return which episodes begin: those of the mask in option ``episodes``, or all.

    Gymnasium's ``reset_mask`` is a mask of rows, those of an episode alike.

    Raises
    ------
    ValueError
        If the mask is not (episodes,) bool with at least one True, or there are two.
    """
    check_options(options, (*OPTIONS, "episodes", "reset_mask"))
    options = options or {}
    mask = options.get("episodes")
    if (of_rows := options.get("reset_mask")) is not None:
        if mask is not None:
            raise ValueError("options episodes and reset_mask are given; want one of them")
        rows = np.asarray(of_rows)
        if rows.shape != (episodes * robots,) or (rows.reshape(episodes, robots) != rows[::robots, None]).any():
            raise ValueError(
                f"option reset_mask is {of_rows!r}; want {episodes * robots} booleans, one for each row, the same for "
                "all robots of an episode"
            )
        mask = rows[::robots]
    if mask is None:
        return np.arange(episodes)
    chosen = np.asarray(mask)
    if chosen.shape != (episodes,) or chosen.dtype != np.bool_ or not chosen.any():
        raise ValueError(f"option episodes is {mask!r}; want a mask of {episodes} booleans, at least one of them True")
    return np.flatnonzero(chosen)


def options_of(
    options: dict[str, Any] | None, chosen: NDArray[np.int64], episodes: int, robots: int
) -> dict[int, ResetOptions]:
    """Return the options of each chosen episode.

    Each of ``floor``, ``starts`` and ``goal`` is one for all or a sequence with one for every episode of the
    batch.

    Raises
    ------
    ValueError
        If an option has a bad value, or as many entries as there are not episodes.
    """
    if not options:
        return {}
    return {
        int(episode): read_options(
            {name: _entry(name, options[name], int(episode), episodes) for name in _KNOWN if name in options},
            robots,
        )
        for episode in chosen
    }


_KNOWN = {"floor": 0, "starts": 2, "goal": 1}
"""Known options, and the number of axes that one episode's has."""


def _entry(name: str, value: Any, episode: int, episodes: int) -> Any:  # noqa: ANN401
    """Return an option's entry for an episode."""
    if _is_for_all(name, value):
        return value
    if len(value) != episodes:
        raise ValueError(
            f"option {name} has {len(value)} entries; want one for all, or one for each of the {episodes} episodes"
        )
    return value[episode]


def _is_for_all(name: str, value: Any) -> bool:  # noqa: ANN401
    """Whether an option's value is that of all episodes.

    Otherwise it is a sequence with an entry, such as a word or None, for each.
    """
    has_words = isinstance(value, Sequence) and any(
        entry is None or (isinstance(entry, str) and not isinstance(value, str)) for entry in value
    )
    return _depth(value) <= _KNOWN[name] and not has_words


def _depth(value: Any) -> int:  # noqa: ANN401
    """Return how deep a value is nested.

    It is 2 for (robots, 3) numbers, in an array or in lists.
    """
    if isinstance(value, np.ndarray):
        return value.ndim
    is_nested = isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0
    return 1 + _depth(value[0]) if is_nested else 0

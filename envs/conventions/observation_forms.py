"""Observations as one vector, with the mask of actions inside, beside or apart."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.conventions.conventions import Conventions

MASK, REST = "action_mask", "observation"
"""Keys where the mask is beside the observation."""


class ObservationForm:
    """Puts observations of one robot, or those of many rows, into the form of a convention.

    Parameters
    ----------
    space : Dict
        Of the observations of one robot as they are.
    conventions : Conventions
        The form.

    Attributes
    ----------
    space : Space
        Of one robot's observations in this form.
    has_mask_apart : bool
        Whether the mask is in infos.

    Raises
    ------
    ValueError
        Where a mask is to be beside or apart from observations that have none, or nothing else is observed.
    """

    def __init__(self, space: spaces.Space[Any], conventions: Conventions) -> None:
        assert isinstance(space, spaces.Dict)
        boxes: dict[str, Any] = dict(space.spaces)
        place = conventions.action_mask
        self._is_flat, self._is_beside = conventions.observation == "flat", place == "beside"
        self.has_mask_apart = place == "infos"
        if place != "inside" and MASK not in boxes:
            raise ValueError(
                f"action_mask is {place!r}, but observations have none ({', '.join(boxes)}); masks are "
                "there at level='frontier'"
            )
        mask = boxes.pop(MASK) if place != "inside" else None
        self._boxes = {name: boxes[name] for name in sorted(boxes)}
        if not boxes:
            raise ValueError("nothing is observed beside the mask of actions; choose what in observe")
        self.columns = flat_columns(self._boxes) if self._is_flat else ()
        rest = flat_box(self._boxes) if self._is_flat else spaces.Dict(boxes)
        self.space: spaces.Space[Any] = rest
        if mask is not None and self._is_beside:
            self.space = spaces.Dict({REST: rest, MASK: mask})
        self._is_plain = not self._is_flat and place == "inside"

    def of(self, observation: Mapping[str, NDArray[Any]], rows: tuple[int, ...] = ()) -> Any:  # noqa: ANN401
        """Return an observation in this form.

        Parameters
        ----------
        observation : dict of arrays
            Each of the shape of its box; with ``rows`` of the shape rows + box.
        rows : tuple of int
            ``(rows,)`` for many at once.
        """
        if self._is_plain:
            return observation
        rest: Any = (
            np.concatenate(
                [observation[name].reshape(*rows, -1) for name in self._boxes], axis=-1, dtype=np.float32
            )
            if self._is_flat
            else {name: observation[name] for name in self._boxes}
        )
        return {REST: rest, MASK: observation[MASK]} if self._is_beside else rest


def flat_box(boxes: Mapping[str, spaces.Box]) -> spaces.Box:
    """Return the space of boxes one after the other, float32."""
    low = np.concatenate([box.low.ravel() for box in boxes.values()], dtype=np.float32, casting="unsafe")
    high = np.concatenate([box.high.ravel() for box in boxes.values()], dtype=np.float32, casting="unsafe")
    return spaces.Box(low, high, dtype=np.float32)


def flat_columns(boxes: Mapping[str, spaces.Box]) -> tuple[tuple[str, int, int], ...]:
    """Return where each key lies in the flat form: its name, its first column, and the one behind its last.

    Arrays lie in the order of C: the last axis first.
    """
    columns, first = [], 0
    for name in sorted(boxes):
        last = first + int(np.prod(boxes[name].shape))
        columns.append((name, first, last))
        first = last
    return tuple(columns)


def zeros_of(space: spaces.Space[Any]) -> Any:  # noqa: ANN401
    """Return an observation of zeros."""
    if isinstance(space, spaces.Dict):
        return {name: zeros_of(part) for name, part in space.spaces.items()}
    return np.zeros(space.shape or (), space.dtype)

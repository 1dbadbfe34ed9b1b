"""The forms in which trainers take observations, rewards, infos and the ends of agents."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.simulation.endings import REASONS
from lidarium.mapping.geometry.bounds import check_settings, share, shown, within

MOST_FLOATS = 4096
"""Maximum number of values of a message."""

FORMS: dict[str, tuple[str, ...]] = {
    "observation": ("dict", "flat"),
    "action_mask": ("inside", "beside", "infos"),
    "infos": ("full", "flat", "none"),
    "ended_agents": ("leave", "zeros"),
}
"""Possible values of each convention; the first is the default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conventions:
    """The forms of the results of ``reset`` and ``step``.

    Attributes
    ----------
    observation : str
        ``dict`` (default), or ``flat``: one float32 vector, with the keys in alphabetical order; see `flat_columns`.
    action_mask : str
        Location of the action mask: ``inside`` the observation (default); ``beside`` it, as in ``{"observation": ...,
        "action_mask": ...}``; or in ``infos`` of any form, as ``"action_mask"``. Only at the level of frontiers.
    infos : str
        ``full`` (default); ``flat``, numbers alone with the same keys at each step; or ``none``.
    ended_agents : str
        An agent that ends before its team may ``leave`` (default), or with ``zeros`` stay with observations of zeros
        and rewards of 0, and end with the last one.
    team_reward : float
        Share of the reward that is the team's: the mean over all robots that took part in the step. 0 by default.
    comm : int
        Number of values that each robot sends the others with its action, over their radio; 0 (default) for none.
    """

    observation: str = "dict"
    action_mask: str = "inside"
    infos: str = "full"
    ended_agents: str = "leave"
    team_reward: Annotated[float, share()] = 0.0
    comm: Annotated[int, within(0, MOST_FLOATS)] = 0

    def __post_init__(self) -> None:
        check_settings(self)
        for name, known in FORMS.items():
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {shown(getattr(self, name))}; want {_either(known)}")


def _either(names: tuple[str, ...]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"


PLAIN = Conventions()
"""The forms of a plain environment."""

NAMES = tuple(each.name for each in fields(Conventions))
"""Options of environments that are conventions."""


def split_options(options: Mapping[str, Any]) -> tuple[Conventions, dict[str, Any]]:
    """Return the conventions among the options of an environment, and the other options.

    Raises
    ------
    ValueError
        If a convention is unknown.
    """
    chosen = {name: value for name, value in options.items() if name in NAMES}
    return Conventions(**chosen), {name: value for name, value in options.items() if name not in NAMES}


MASK, REST = "action_mask", "observation"
"""Keys if the mask is next to the observation."""


class ObservationForm:
    """Converts observations of one robot, or those of many rows, into the form of a convention.

    Parameters
    ----------
    space : Dict
        Unconverted observations of one robot.
    conventions : Conventions
        The form.

    Attributes
    ----------
    space : Space
        One robot's observations in this form.
    has_mask_apart : bool
        Whether the mask is in infos.
    is_plain : bool
        Whether observations are left unchanged.

    Raises
    ------
    ValueError
        If the mask should be separate but does not exist, or nothing else is observed.
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
        self.is_plain = not self._is_flat and place == "inside"

    def of(self, observation: Mapping[str, NDArray[Any]], rows: tuple[int, ...] = ()) -> Any:  # noqa: ANN401
        """Return an observation in this form.

        Parameters
        ----------
        observation : dict of arrays
            Each of the shape of its box; with ``rows`` of the shape rows + box.
        rows : tuple of int
            ``(rows,)`` for many at once.
        """
        if self.is_plain:
            return observation
        rest: Any = (
            np.concatenate([observation[name].reshape(*rows, -1) for name in self._boxes], axis=-1, dtype=np.float32)
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
    """Return the columns of each key in the flat form: its name, its first column, and the one after its last.

    Arrays lie in the order of C: the last axis first.
    """
    columns, first = [], 0
    for name in sorted(boxes):
        last = first + int(np.prod(boxes[name].shape))
        columns.append((name, first, last))
        first = last
    return tuple(columns)


ENDED = "ended"
"""Number of a robot's ending in ``endings.REASONS``; 0 if it has not ended.

A policy's own words have the number after the last one.
"""


def ending_number(reason: str | None) -> int:
    """Return the number of a reason."""
    if reason is None:
        return 0
    return REASONS.index(reason) if reason in REASONS else len(REASONS)


def flat_row_infos(infos: Mapping[str, Any], rows: int) -> dict[str, Any]:
    """Return the numbers among the infos of a batch, with names joined by a point, (rows,) float32 each.

    Each comes with its mask, as in Gymnasium's vector environments; all rows have all.
    """
    found = _rows(infos, "")
    reasons = infos.get("ended_because")
    found[ENDED] = np.array([0.0] * rows if reasons is None else [float(ending_number(reason)) for reason in reasons])
    everyone = np.ones(rows, np.bool_)
    return {**found, **{f"_{name}": everyone for name in found}}


def _rows(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        if name.startswith("_"):
            continue
        if isinstance(value, Mapping):
            found.update(_rows(value, f"{prefix}{name}."))
        elif value.dtype.kind in "biuf" and value.ndim == 1:
            found[f"{prefix}{name}"] = value.astype(np.float64)
        elif value.dtype.kind in "biuf":
            flat = value.reshape(len(value), -1).astype(np.float64)
            found.update({f"{prefix}{name}.{k}": flat[:, k] for k in range(flat.shape[1])})
    return found


TEAM = "team"
"""The term of the reward due to the team's share, in addition to the terms of a robot's own reward."""


def shared_rewards(rewards: NDArray[np.float64], acted: NDArray[np.bool_], share: float) -> NDArray[np.float64]:
    """Return rewards (episodes, robots) of which a share, 0 to 1, is the mean over the robots that acted."""
    counts = np.maximum(acted.sum(axis=1, keepdims=True), 1)
    means = np.where(acted, rewards, 0.0).sum(axis=1, keepdims=True) / counts
    return np.where(acted, (1.0 - share) * rewards + share * means, 0.0)

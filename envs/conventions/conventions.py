"""What forms a trainer wants things in."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any

from lidarium.mapping.geometry.bounds import check_settings, share, shown, within

MOST_FLOATS = 4096
"""Most numbers of a message."""

FORMS: dict[str, tuple[str, ...]] = {
    "observation": ("dict", "flat"),
    "action_mask": ("inside", "beside", "infos"),
    "infos": ("full", "flat", "none"),
    "ended_agents": ("leave", "zeros"),
}
"""What each convention may be; the first is the default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conventions:
    """The forms of what ``reset`` and ``step`` return.

    Attributes
    ----------
    observation : str
        ``dict``, or ``flat``: one float32 vector, with the keys in the order of the alphabet; see
        `flat_columns`.
    action_mask : str
        Where the mask of actions is: ``inside`` the observation; ``beside`` it, as in ``{"observation": ...,
        "action_mask": ...}``; or in ``infos`` of any form, as ``"action_mask"``. Only at the level of
        frontiers.
    infos : str
        ``full``; ``flat``, numbers alone with the same keys at each step; or ``none``.
    ended_agents : str
        What becomes of an agent that ends before its team: it may ``leave``, or it stays with observations of
        ``zeros``, rewards of 0, and ends with the last one.
    team_reward : float
        Share of the reward that is the team's: the mean of all that took part in the step.
    comm : int
        How many numbers each robot sends the others with its action, over their radio; 0 for none.
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


NAMES = tuple(each.name for each in fields(Conventions))
"""Options of environments that are conventions."""


def split_options(options: Mapping[str, Any]) -> tuple[Conventions, dict[str, Any]]:
    """Return the conventions among the options of an environment, and the other options.

    Raises
    ------
    ValueError
        Where a convention is unknown.
    """
    chosen = {name: value for name, value in options.items() if name in NAMES}
    return Conventions(**chosen), {name: value for name, value in options.items() if name not in NAMES}

"""Weights of the reward."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import Rule, check_settings, shown, within

WEIGHT = Rule(float, bounds=within(-1e6, 1e6))
"""Rule for the weight of a registered term."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RewardSettings:
    """Weights of the terms of a robot's reward, which is the sum of all terms times their weights.

    Costs are terms that are negative themselves: a positive weight makes them cost.

    Attributes
    ----------
    area : float, default 1.0
        Per square metre of F that the team had not sensed, shared among the robots that sense it first
        [1/m2].
    time : float, default 0.01
        Weight of the time, a term of -1 per second [1/s].
    contact : float, default 0.1
        Weight of contacts, a term of -1 for each step in contact [1].
    energy : float, default 0.01
        Weight of the distance driven, a term of -1 per metre [1/m].
    more : tuple of (str, float)
        Registered terms (`lidarium show rewards`), which keep their own sign, with their weights; a mapping is also
        accepted.
    """

    area: Annotated[float, within(-1e6, 1e6)] = 1.0
    time: Annotated[float, within(-1e6, 1e6)] = 0.01
    contact: Annotated[float, within(-1e6, 1e6)] = 0.1
    energy: Annotated[float, within(-1e6, 1e6)] = 0.01
    more: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        check_settings(self, "the reward")
        # Settings can be compared and hashed, so a mapping becomes pairs.
        if not isinstance(self.more, Mapping | tuple | list):
            raise ValueError(f"more of the reward is {self.more!r}; want a mapping of names to weights")
        pairs = self.more.items() if isinstance(self.more, Mapping) else self.more
        if not all(isinstance(pair, tuple | list) and len(pair) == 2 for pair in pairs):
            raise ValueError(f"more of the reward is {shown(self.more)}; want a mapping of names to weights")
        object.__setattr__(self, "more", tuple((str(name), weight) for name, weight in pairs))
        for name, weight in self.more:
            if not WEIGHT.hold(weight):
                raise ValueError(f"weight {name} of the reward is {shown(weight)}; want {WEIGHT.wanted}")

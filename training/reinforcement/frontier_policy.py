"""Policies for sb3-contrib's PPO with masks that attend to what is on offer: frontiers, or stops of tours.

Their networks take any number of options and teammates in any order. They begin with a ranking, that of explore_lite
or that of `tour_frontier`, to which they add a correction that is zero until it is trained.

References
----------
A. Vaswani et al., "Attention is all you need", 2017. J. Horner, "Map-merging for multi-robot system", 2016:
the ranking of explore_lite, three times the path less the size.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from lidarium.agents.attention import LAYERS, WIDTH
from lidarium.agents.zoo.network import (
    FRONTIERS,
    GAINS,
    MASK,
    METRES,
    OFFERS,
    OPTION_NUMBERS,
    OTHER_STOPS,
    PATH_FACTOR,
    SQUARE_METRES,
    STAY,
    TEAMMATE_UNITS,
    TEAMMATES,
    TOUR_UNITS,
    TOURS,
)
from lidarium.training.reinforcement.masked_ppo import RankingPolicy
from lidarium.training.torch_network import AttentionLayer

SITUATION = ("time_left", "coverage", "velocity", "bumper")
"""Observables that are seen of the situation."""

STATE = "state"
"""True state of the team, which the critic alone sees; see `CentralState`."""

LEAST_GROUP = 32
"""Decisions are ranked in groups of like numbers of frontiers, of at least so many decisions."""

MOST_GROUPS = 4


class OptionRanking(BaseFeaturesExtractor):
    """Ranks what is on offer, and estimates the future gain.

    Attributes
    ----------
    level, table : str
        Level of decision, and the observable that has a row for each option.
    seen : tuple of str
        Observables that it sees, besides the situation.
    """

    level: ClassVar[str]
    table: ClassVar[str]
    seen: ClassVar[tuple[str, ...]]

    def __init__(self, observation_space: spaces.Space[dict[str, object]]) -> None:
        self._check_observed(observation_space)
        assert isinstance(observation_space, spaces.Dict)
        shapes = {name: space.shape or () for name, space in observation_space.spaces.items()}
        super().__init__(observation_space, shapes[MASK][0] + 1)
        self.situation_names = [name for name in SITUATION if name in shapes]
        self.add_module(self.level, nn.Linear(self._numbers(shapes), WIDTH))
        self.teammate = nn.Linear(shapes[TEAMMATES][1], WIDTH) if TEAMMATES in shapes else None
        self.situation = nn.Linear(1 + sum(shapes[name][0] for name in self.situation_names), WIDTH)
        self.layers = nn.ModuleList(AttentionLayer() for _ in range(LAYERS))
        self.last = nn.LayerNorm(WIDTH)
        self.correction = nn.Linear(WIDTH, 1)
        self.stay = nn.Linear(WIDTH, 1)
        known = WIDTH + (shapes[STATE][0] if STATE in shapes else 0)
        self.critic = nn.Sequential(nn.Linear(known, WIDTH), nn.ReLU(), nn.Linear(WIDTH, 1))
        self.steepness = nn.Parameter(torch.ones(1))
        for zero in (self.correction, self.stay, self.critic[2]):
            nn.init.zeros_(zero.weight)  # type: ignore[arg-type]
            nn.init.zeros_(zero.bias)  # type: ignore[arg-type]

    def forward(self, observations: Mapping[str, Tensor]) -> Tensor:
        """Return the preferences (N, actions), then the estimate, (N, actions + 1)."""
        return self._in_groups(observations, True)

    def preferences(self, observations: Mapping[str, Tensor]) -> Tensor:
        """Return the preferences (N, actions); no critic, so that no true state is needed."""
        return self._in_groups(observations, False)

    def _in_groups(self, observations: Mapping[str, Tensor], is_rated: bool) -> Tensor:
        offered = observations[MASK][:, :-1] > 0
        counts = offered.sum(dim=1)
        groups = max(min(len(counts) // LEAST_GROUP, MOST_GROUPS), 1)
        order = counts.argsort()
        found = [self._ranked(observations, offered, rows, is_rated) for rows in order.chunk(groups)]
        return torch.cat(found)[order.argsort()]

    def preferred(self, observations: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Return the action that each row of observations prefers, of those that the mask allows."""
        tensors = {name: torch.from_numpy(array.astype(np.float32)) for name, array in observations.items()}
        with torch.no_grad():
            preferences = self.preferences(tensors)
        return preferences.masked_fill(tensors[MASK] <= 0, -math.inf).argmax(dim=1).numpy()

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the weights as arrays, by name, but for the critic's."""
        state = {name: each for name, each in self.state_dict().items() if not name.startswith("critic.")}
        return {name: array.detach().cpu().numpy().copy() for name, array in state.items()}

    def set_weights(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        """Take weights over; the critic stays."""
        given = {name: torch.from_numpy(array.copy()) for name, array in weights.items()}
        self.load_state_dict({**self.state_dict(), **given})

    def _check_observed(self, space: spaces.Space[dict[str, object]]) -> None:
        """Check that the network supports the observations."""
        names = list(space.spaces) if isinstance(space, spaces.Dict) else []
        name = type(self).__name__.replace("Ranking", "Policy")
        if self.table not in names or MASK not in names:
            raise ValueError(
                f"{name} attends to {self.table}, and there are none to observe; make the environment with "
                f'level="{self.level}" and observe=["{self.seen[-1]}", "time_left"], its observations as a dict'
            )
        known = (*self.seen, *SITUATION)
        for each in names:
            if each not in (*known, MASK, STATE):
                raise ValueError(f"{name} does not see {each!r}; observe some of {', '.join(known)}")

    @abstractmethod
    def _numbers(self, shapes: Mapping[str, tuple[int, ...]]) -> int:
        """Return how many numbers of an option it sees."""

    @abstractmethod
    def _options(self, observations: Mapping[str, Tensor], rows: Tensor, offered: Tensor) -> tuple[Tensor, Tensor]:
        """Return the numbers of the first options of some decisions, and how these are ranked before a training."""

    def _ranked(self, observations: Mapping[str, Tensor], offered: Tensor, rows: Tensor, is_rated: bool) -> Tensor:
        """Rank the options of some decisions; no more of them are taken than the widest one has."""
        actions = offered.shape[1]
        offered = offered[rows]
        width = max(int(offered.any(dim=0).nonzero().max()) + 1, 1) if offered.any() else 1
        offered = offered[:, :width]
        tokens, is_there = [self._situation(observations, rows)[:, None]], [torch.ones_like(offered[:, :1])]
        if self.teammate is not None:
            teammates = observations[TEAMMATES][rows]
            tokens.append(self.teammate(_teammate_numbers(teammates)))
            is_there.append(teammates[..., -1] > 0)
        numbers, classic = self._options(observations, rows, offered)
        tokens.append(self.get_submodule(self.level)(numbers))
        mixed, seen = torch.cat(tokens, dim=1), torch.cat([*is_there, offered], dim=1)
        for layer in self.layers:
            mixed = layer(mixed, seen)
        mixed = self.last(mixed)
        ranked = self.steepness * classic + self.correction(mixed[:, -width:])[..., 0]
        ranked = nn.functional.pad(ranked.masked_fill(~offered, 0.0), (0, actions - width))
        last = ranked.min(dim=1, keepdim=True).values.clamp(max=0.0)
        stay = self.stay(mixed[:, 0]) + last + STAY[self.level]  # behind all, before a training
        found = [ranked, stay]
        if is_rated:
            known = [mixed[:, 0], *([observations[STATE][rows]] if STATE in observations else [])]
            found.append(self.critic(torch.cat(known, dim=1)))
        return torch.cat(found, dim=1)

    def _situation(self, observations: Mapping[str, Tensor], rows: Tensor) -> Tensor:
        parts = [observations[name][rows].to(torch.float32) for name in self.situation_names]
        count = observations[MASK][rows, :-1].to(torch.float32).sum(dim=1, keepdim=True) / OFFERS[self.level]
        tokens: Tensor = self.situation(torch.cat([count, *parts], dim=1))
        return tokens


class FrontierRanking(OptionRanking):
    """Ranks frontiers."""

    level, table, seen = "frontier", FRONTIERS, (FRONTIERS, GAINS, TEAMMATES)

    def _numbers(self, shapes: Mapping[str, tuple[int, ...]]) -> int:
        return OPTION_NUMBERS[self.level] - (GAINS not in shapes)

    def _options(self, observations: Mapping[str, Tensor], rows: Tensor, offered: Tensor) -> tuple[Tensor, Tensor]:
        width = offered.shape[1]
        frontiers = observations[FRONTIERS][rows, :width]
        numbers = [frontiers / METRES, torch.log1p(frontiers[..., 2:])]  # near 1, path and size as logarithms too
        if GAINS in observations:
            numbers.append(observations[GAINS][rows, :width, None] / SQUARE_METRES)
        return torch.cat(numbers, dim=2), frontiers[..., 3] / PATH_FACTOR - frontiers[..., 2]


class TourRanking(OptionRanking):
    """Ranks stops of tours, the first one of which is what `tour_frontier` does."""

    level, table, seen = "tour", TOURS, (TOURS, TEAMMATES)

    def _numbers(self, shapes: Mapping[str, tuple[int, ...]]) -> int:
        return OPTION_NUMBERS[self.level]

    def _options(self, observations: Mapping[str, Tensor], rows: Tensor, offered: Tensor) -> tuple[Tensor, Tensor]:
        stops = observations[TOURS][rows, : offered.shape[1]]
        is_first = (offered & (offered.cumsum(dim=1) == 1))[..., None].to(stops.dtype)
        numbers = [stops / torch.from_numpy(TOUR_UNITS), torch.log1p(stops[..., 2:5]), is_first]
        classic = torch.where(is_first[..., 0] > 0, 0.0, OTHER_STOPS - stops[..., 2] / METRES)
        return torch.cat(numbers, dim=2), classic


class FrontierPolicy(RankingPolicy):
    """Attends to frontiers and teammates; for ``MaskablePPO`` at the level of frontiers.

    ``MaskablePPO(FrontierPolicy, lidarium.sb3_vec_env(16, "set:train", level="frontier", ...))``, whose
    ``observe`` has ``frontiers`` and any of ``frontier_gains``, ``teammates``, ``time_left``, ``coverage``,
    ``velocity`` and ``bumper``.
    """

    ranking: type[OptionRanking] = FrontierRanking

    @property
    def network(self) -> OptionRanking:
        """The network, with the critic."""
        assert isinstance(self.features_extractor, OptionRanking)
        return self.features_extractor

    @property
    def critic(self) -> nn.Module:
        """The critic."""
        return self.network.critic


class TourPolicy(FrontierPolicy):
    """Attends to stops of tours and teammates; for ``MaskablePPO`` at the level of tours.

    ``MaskablePPO(TourPolicy, lidarium.sb3_vec_env(16, "set:train", level="tour", robots=2, observe=["teammates"]))``.
    """

    ranking = TourRanking


def _teammate_numbers(teammates: Tensor) -> Tensor:
    """Return rows of teammates near 1."""
    return teammates / torch.from_numpy(TEAMMATE_UNITS)

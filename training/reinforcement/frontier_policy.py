"""A policy for sb3-contrib's PPO with masks that attends to the frontiers on offer.

Its network takes any number of frontiers and teammates in any order. It begins with the ranking of
explore_lite, to which it adds a correction that is zero until it is trained.

References
----------
A. Vaswani et al., "Attention is all you need", 2017. J. Horner, "Map-merging for multi-robot system", 2016:
the ranking of explore_lite, three times the path less the size.
"""

import math
from collections.abc import Mapping
from typing import Any

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
    PATH_FACTOR,
    SQUARE_METRES,
    TEAMMATE_UNITS,
    TEAMMATES,
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


class FrontierRanking(BaseFeaturesExtractor):
    """Ranks the frontiers on offer, and estimates the future gain."""

    def __init__(self, observation_space: spaces.Space[dict[str, object]]) -> None:
        _check_observed(observation_space)
        assert isinstance(observation_space, spaces.Dict)
        shapes = {name: space.shape or () for name, space in observation_space.spaces.items()}
        super().__init__(observation_space, shapes[MASK][0] + 1)
        numbers = shapes[FRONTIERS][1] + 2 + (GAINS in shapes)
        self.situation_names = [name for name in SITUATION if name in shapes]
        self.frontier = nn.Linear(numbers, WIDTH)
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

    def _ranked(self, observations: Mapping[str, Tensor], offered: Tensor, rows: Tensor, is_rated: bool) -> Tensor:
        """Rank the frontiers of some decisions; no more of them are taken than the widest one has."""
        actions = offered.shape[1]
        offered = offered[rows]
        width = max(int(offered.sum(dim=1).max()), 1)  # offers come first
        offered = offered[:, :width]
        frontiers = observations[FRONTIERS][rows, :width]
        tokens, is_there = [self._situation(observations, rows)[:, None]], [torch.ones_like(offered[:, :1])]
        if self.teammate is not None:
            teammates = observations[TEAMMATES][rows]
            tokens.append(self.teammate(_teammate_numbers(teammates)))
            is_there.append(teammates[..., -1] > 0)
        numbers = [_frontier_numbers(frontiers)]
        if GAINS in observations:
            numbers.append(observations[GAINS][rows, :width, None] / SQUARE_METRES)
        tokens.append(self.frontier(torch.cat(numbers, dim=2)))
        mixed, seen = torch.cat(tokens, dim=1), torch.cat([*is_there, offered], dim=1)
        for layer in self.layers:
            mixed = layer(mixed, seen)
        mixed = self.last(mixed)
        classic = frontiers[..., 3] / PATH_FACTOR - frontiers[..., 2]
        ranked = self.steepness * classic + self.correction(mixed[:, -width:])[..., 0]
        ranked = nn.functional.pad(ranked.masked_fill(~offered, 0.0), (0, actions - width))
        stay = self.stay(mixed[:, 0]) + ranked.min(dim=1, keepdim=True).values  # behind all, at the start
        found = [ranked, stay]
        if is_rated:
            known = [mixed[:, 0], *([observations[STATE][rows]] if STATE in observations else [])]
            found.append(self.critic(torch.cat(known, dim=1)))
        return torch.cat(found, dim=1)

    def _situation(self, observations: Mapping[str, Tensor], rows: Tensor) -> Tensor:
        parts = [observations[name][rows].to(torch.float32) for name in self.situation_names]
        count = observations[MASK][rows, :-1].to(torch.float32).mean(dim=1, keepdim=True)
        tokens: Tensor = self.situation(torch.cat([count, *parts], dim=1))
        return tokens


class FrontierPolicy(RankingPolicy):
    """Attends to frontiers and teammates; for ``MaskablePPO`` at the level of frontiers.

    ``MaskablePPO(FrontierPolicy, lidarium.sb3_vec_env(16, "set:train", level="frontier", ...))``, whose
    ``observe`` has ``frontiers`` and any of ``frontier_gains``, ``teammates``, ``time_left``, ``coverage``,
    ``velocity`` and ``bumper``.
    """

    ranking = FrontierRanking

    @property
    def network(self) -> FrontierRanking:
        """The network, with the critic."""
        assert isinstance(self.features_extractor, FrontierRanking)
        return self.features_extractor

    @property
    def critic(self) -> nn.Module:
        """The critic."""
        return self.network.critic


def _check_observed(space: spaces.Space[dict[str, object]]) -> None:
    """Check that the network supports the observations."""
    seen = (FRONTIERS, GAINS, TEAMMATES, *SITUATION)
    names = list(space.spaces) if isinstance(space, spaces.Dict) else []
    if FRONTIERS not in names or MASK not in names:
        raise ValueError(
            "FrontierPolicy attends to frontiers, and there are none to observe; make the environment with "
            'level="frontier" and observe=["frontiers", "time_left"], its observations as a dict'
        )
    for name in names:
        if name not in (*seen, MASK, STATE):
            raise ValueError(f"FrontierPolicy does not see {name!r}; observe some of {', '.join(seen)}")


def _frontier_numbers(frontiers: Tensor) -> Tensor:
    """Return place, path and size of frontiers near 1, and path and size as logarithms."""
    return torch.cat([frontiers / METRES, torch.log1p(frontiers[..., 2:])], dim=2)


def _teammate_numbers(teammates: Tensor) -> Tensor:
    """Return rows of teammates near 1."""
    return teammates / torch.from_numpy(TEAMMATE_UNITS)

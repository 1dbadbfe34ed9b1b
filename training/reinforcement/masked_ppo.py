"""Networks that rank options as policies of sb3-contrib's PPO with masks."""

from typing import Any

import torch
from gymnasium import spaces
from sb3_contrib.common.maskable.policies import MaskableMultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import Schedule
from torch import Tensor, nn

from lidarium.agents.attention import WIDTH
from lidarium.training.decisions import MOST_OPTIONS
from lidarium.training.torch_network import ExplorerNetwork, Seen


class _PreferencesAndValue(BaseFeaturesExtractor):
    """The network's preferences, then the critic's estimate of the future gain.

    Gradients of values do not reach the network: it prefers, and nothing else.
    """

    def __init__(self, observation_space: spaces.Space[Any]) -> None:
        super().__init__(observation_space, MOST_OPTIONS + 1)
        self.network = ExplorerNetwork()
        self.critic = nn.Sequential(nn.Linear(WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, 1))
        nn.init.zeros_(self.critic[2].weight)  # type: ignore[arg-type]
        nn.init.zeros_(self.critic[2].bias)  # type: ignore[arg-type]

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        preferences, situation = self.network(Seen.of(observations))
        return torch.cat([preferences, self.critic(situation.detach())], dim=1)


class _Columns(nn.Module):
    """Some columns of a table."""

    def __init__(self, first: int, last: int) -> None:
        super().__init__()
        self.first, self.last = first, last

    def forward(self, table: Tensor) -> Tensor:
        return table[:, self.first : self.last]


class RankingPolicy(MaskableMultiInputActorCriticPolicy):
    """Chooses by the preferences that a network gives, one for each action.

    Attributes
    ----------
    ranking : type of BaseFeaturesExtractor
        Returns the preferences, then an estimate of the future gain.
    """

    ranking: type[BaseFeaturesExtractor]

    def __init__(self, observation_space: spaces.Dict, action_space: spaces.Discrete, lr_schedule: Schedule) -> None:
        super().__init__(
            observation_space,
            action_space,
            lr_schedule,
            net_arch=[],
            ortho_init=False,
            features_extractor_class=self.ranking,
            normalize_images=False,
        )

    def _build(self, lr_schedule: Schedule) -> None:
        assert isinstance(self.action_space, spaces.Discrete)
        actions = int(self.action_space.n)
        self._build_mlp_extractor()
        self.action_net: nn.Module = _Columns(0, actions)
        self.value_net: nn.Module = _Columns(actions, actions + 1)  # type: ignore[assignment]
        self.optimizer = torch.optim.Adam(self.parameters(), lr=lr_schedule(1), eps=1e-5)


class ExplorerPolicy(RankingPolicy):
    """Chooses by the explorer's preferences; nothing else is learned."""

    ranking = _PreferencesAndValue

    @property
    def critic(self) -> nn.Module:
        """The critic."""
        assert isinstance(self.features_extractor, _PreferencesAndValue)
        return self.features_extractor.critic

    @property
    def network(self) -> ExplorerNetwork:
        """The network."""
        assert isinstance(self.features_extractor, _PreferencesAndValue)
        return self.features_extractor.network

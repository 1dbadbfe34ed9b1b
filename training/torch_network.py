"""The network of ``agents/learned/network`` in PyTorch, for training: many decisions at once."""

import math
from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from lidarium.agents.attention import HEADS, INNER, LAYERS, WIDTH
from lidarium.agents.learned.decision import CROP_SIDE
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.agents.learned.network import CROP_WIDTH
from lidarium.mapping.planning.touring.map_crops import FREE, OCCUPIED
from lidarium.training.decisions import Decisions

FORBIDDEN = -1e9
"""Preference of masked options."""


class ExplorerNetwork(nn.Module):
    """Ranks options.

    Its correction of classic tours is zero until it is trained.
    """

    def __init__(self) -> None:
        super().__init__()
        self.option = nn.Linear(len(OPTION_FEATURES), WIDTH)
        self.crop = nn.Linear(2 * CROP_SIDE * CROP_SIDE, CROP_WIDTH)
        self.crop_out = nn.Linear(CROP_WIDTH, WIDTH)
        self.teammate = nn.Linear(len(TEAMMATE_FEATURES), WIDTH)
        self.situation = nn.Linear(len(SITUATION_FEATURES), WIDTH)
        self.layers = nn.ModuleList(AttentionLayer() for _ in range(LAYERS))
        self.last = nn.LayerNorm(WIDTH)
        self.correction = nn.Linear(WIDTH, 1)
        self.steepness = nn.Parameter(torch.ones(1))
        nn.init.zeros_(self.correction.weight)
        nn.init.zeros_(self.correction.bias)

    def forward(self, seen: "Seen") -> tuple[Tensor, Tensor]:
        """Return preferences (N, options), and features of the situation (N, WIDTH).

        Masked options are preferred far less than others.
        """
        teammates = seen.teammates.shape[1]
        tokens = torch.cat(
            [self.situation(seen.situation)[:, None], self.teammate(seen.teammates), self._options(seen)],
            dim=1,
        )
        for layer in self.layers:
            tokens = layer(tokens, seen.is_there)
        tokens = self.last(tokens)
        correction = self.correction(tokens[:, 1 + teammates :])[..., 0]
        preferences = self.steepness * seen.scores + correction
        return preferences.masked_fill(~seen.mask, FORBIDDEN), tokens[:, 0]

    def _options(self, seen: "Seen") -> Tensor:
        crops = seen.crops.flatten(start_dim=2)
        levels = torch.cat([crops == OCCUPIED, crops == FREE], dim=2).to(torch.float32)
        embedded: Tensor = self.option(seen.options) + self.crop_out(functional.relu(self.crop(levels)))
        return embedded

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the weights as arrays, by name."""
        return {name: array.detach().cpu().numpy().copy() for name, array in self.state_dict().items()}

    def set_weights(self, weights: dict[str, NDArray[np.float32]]) -> None:
        """Take weights over."""
        self.load_state_dict({name: torch.from_numpy(array.copy()) for name, array in weights.items()})


class AttentionLayer(nn.Module):
    """Attention among all tokens, then an inner layer for each."""

    def __init__(self) -> None:
        super().__init__()
        self.before_attention, self.before_inner = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.queries_keys_values = nn.Linear(WIDTH, 3 * WIDTH)
        self.attended = nn.Linear(WIDTH, WIDTH)
        self.inner, self.outer = nn.Linear(WIDTH, INNER), nn.Linear(INNER, WIDTH)

    def forward(self, tokens: Tensor, is_there: Tensor) -> Tensor:
        """Return the tokens (N, tokens, WIDTH).

        No token attends to those that are not there.
        """
        count, length = tokens.shape[:2]
        parts = self.queries_keys_values(self.before_attention(tokens))
        queries, keys, values = parts.view(count, length, 3, HEADS, -1).permute(2, 0, 3, 1, 4)
        alike = queries @ keys.transpose(-1, -2) / math.sqrt(WIDTH // HEADS)
        shares = alike.masked_fill(~is_there[:, None, None, :], FORBIDDEN).softmax(dim=-1)
        tokens = tokens + self.attended((shares @ values).transpose(1, 2).reshape(count, length, WIDTH))
        changed: Tensor = tokens + self.outer(functional.relu(self.inner(self.before_inner(tokens))))
        return changed


class Seen:
    """Decisions as tensors.

    Attributes
    ----------
    is_there : (N, 1 + teammates + options) bool
        Which tokens are.
    """

    def __init__(self, decisions: Decisions) -> None:
        self._take({field.name: torch.from_numpy(getattr(decisions, field.name)) for field in fields(decisions)})

    @classmethod
    def of(cls, tensors: Mapping[str, Tensor]) -> "Seen":
        """Return decisions given as tensors of any type, by the names of ``Decisions``."""
        seen = cls.__new__(cls)
        seen._take(tensors)
        return seen

    def _take(self, tensors: Mapping[str, Tensor]) -> None:
        self.options, self.crops, self.teammates = tensors["options"], tensors["crops"], tensors["teammates"]
        self.situation, self.scores = tensors["situation"], tensors["scores"]
        self.mask, counts = tensors["mask"] > 0, tensors["counts"]
        options, teammates = self.options.shape[1], self.teammates.shape[1]
        parts = [
            torch.ones(len(counts), 1, dtype=torch.bool),
            torch.arange(teammates) < counts[:, 1:],
            torch.arange(options) < counts[:, :1],
        ]
        self.is_there = torch.cat(parts, dim=1)

"""The network that predicts maps, in PyTorch: for training. See `lidarium.mapping.prediction.network`."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from lidarium.mapping.prediction.levels import FREE, OCCUPIED
from lidarium.mapping.prediction.network import DILATIONS, PIXEL, WIDTHS, shapes


class TorchMapNetwork(nn.Module):
    """Predicts whether squares are free: logits (N, WINDOW, WINDOW) of levels (N, WINDOW, WINDOW) int8."""

    def __init__(self) -> None:
        super().__init__()
        strides = {f"down{scale}": 2 for scale in range(len(WIDTHS))}
        dilations = {f"coarse{number}": dilation for number, dilation in enumerate(DILATIONS)}
        table = shapes()
        for name, shape in table.items():
            layer, _, part = name.rpartition(".")
            if part != "weight":
                continue
            outputs, inputs, side, _ = shape
            dilation = dilations.get(layer, 1)
            made = nn.Conv2d(
                inputs,
                outputs,
                side,
                stride=strides.get(layer, 1),
                padding=dilation * (side // 2),
                dilation=dilation,
                bias=f"{layer}.bias" in table,
            )
            nn.init.kaiming_normal_(made.weight, nonlinearity="relu")
            if made.bias is not None:
                nn.init.zeros_(made.bias)
            self.add_module(layer, made)
        nn.init.zeros_(self.get_parameter("out.weight"))

    def forward(self, levels: Tensor) -> Tensor:
        """Return the logits."""
        seen = torch.stack([levels == OCCUPIED, levels == FREE], dim=1).to(self.get_parameter("out.weight").dtype)
        x = functional.relu(self._layer("enter", functional.pixel_unshuffle(seen, PIXEL)))
        kept = []
        for scale in range(len(WIDTHS) - 1):
            x = x + functional.relu(self._layer(f"level{scale}", x))
            kept.append(x)
            x = functional.relu(self._layer(f"down{scale}", x))
        for number in range(len(DILATIONS)):
            x = x + functional.relu(self._layer(f"coarse{number}", x))
        for scale in reversed(range(len(WIDTHS) - 1)):
            deep = functional.interpolate(self._layer(f"deep{scale}", x), scale_factor=2.0, mode="nearest")
            x = functional.relu(deep + self._layer(f"skip{scale}", kept[scale]))
            x = x + functional.relu(self._layer(f"merge{scale}", x))
        return functional.pixel_shuffle(self._layer("out", x), PIXEL)[:, 0]

    def _layer(self, name: str, x: Tensor) -> Tensor:
        found: Tensor = self.get_submodule(name)(x)
        return found

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the weights as arrays, by name."""
        return {name: array.detach().cpu().float().numpy().copy() for name, array in self.state_dict().items()}

    def set_weights(self, weights: dict[str, NDArray[np.float32]]) -> None:
        """Take weights over."""
        self.load_state_dict({name: torch.from_numpy(array.copy()) for name, array in weights.items()})

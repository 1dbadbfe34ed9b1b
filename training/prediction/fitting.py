"""Fits a network to partial maps: windows at random places, turned and mirrored. Checkpoints resume it."""

import time
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save
from torch import Tensor
from torch.nn import functional

from lidarium.mapping.files.guarded_reading import read_bytes
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.prediction.levels import FREE, OCCUPIED, SIDE, UNKNOWN
from lidarium.mapping.prediction.network import WINDOW, load_weights
from lidarium.training.prediction.maps import FloorMaps
from lidarium.training.prediction.quality import NEAR_M, Quality, QualityTally
from lidarium.training.prediction.settings import SHIPPED, PredictionSettings
from lidarium.training.prediction.torch_map_network import TorchMapNetwork

JITTER = 40
"""Windows are up to so many squares away from a known one."""

FLIPPED_SHARE, MOST_FLIPPED = 0.3, 0.03
"""In so many windows, up to so many of the known squares are forgotten or made walls: maps are never perfect."""

MEAN_DECAY = 0.999
"""The weights that are kept are a running mean (B. Polyak and A. Juditsky, 1992) with this decay a step."""

WARM_STEPS = 200
"""The learning rate rises for so many steps."""

MOST_JUDGED = 400
"""Maximum number of windows that judge a network."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Partial maps to draw windows from.

    Attributes
    ----------
    floors : sequence of FloorMaps
        Maps of floors.
    numbers : (n, 2) int64
        Floor and map of each that has something known.
    """

    floors: Sequence[FloorMaps]
    numbers: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        found = [
            (k, number)
            for k, floor in enumerate(self.floors)
            for number in range(len(floor.levels))
            if (floor.levels[number] == FREE).any()
        ]
        object.__setattr__(self, "numbers", np.array(found, np.int64).reshape(-1, 2))

    def drawn(self, count: int, generator: np.random.Generator) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        """Return drawn windows and their truth, (count, WINDOW, WINDOW) each."""
        levels = np.zeros((count, WINDOW, WINDOW), np.int8)
        truth = np.zeros((count, WINDOW, WINDOW), np.bool_)
        for k, (floor, number) in enumerate(self.numbers[generator.integers(0, len(self.numbers), count)]):
            maps = self.floors[floor]
            seen = maps.levels[number]
            free = np.flatnonzero(seen.reshape(-1) == FREE)
            row, column = divmod(int(free[generator.integers(0, len(free))]), seen.shape[1])
            low = np.array([row, column]) - WINDOW // 2 + generator.integers(-JITTER, JITTER + 1, 2)
            turns, is_mirrored = int(generator.integers(0, 4)), generator.random() < 0.5
            for grid, out in ((seen, levels), (maps.is_free, truth)):
                piece = np.rot90(cut(grid, int(low[0]), int(low[1])), turns)
                out[k] = piece[:, ::-1] if is_mirrored else piece
            if generator.random() < FLIPPED_SHARE:
                _flip(levels[k], generator)
        return levels, truth


def cut(grid: NDArray[np.generic], row: int, column: int) -> NDArray[np.generic]:
    """Return the window of a grid that begins at a square, zeros beyond the grid."""
    window = np.zeros((WINDOW, WINDOW), grid.dtype)
    part = grid[max(row, 0) : max(row + WINDOW, 0), max(column, 0) : max(column + WINDOW, 0)]
    top, left = max(-row, 0), max(-column, 0)
    window[top : top + part.shape[0], left : left + part.shape[1]] = part
    return window


def _flip(levels: NDArray[np.int8], generator: np.random.Generator) -> None:
    """Forget some known squares, and make fewer of the free ones walls."""
    draws = generator.random(levels.shape, np.float32)
    share = generator.uniform(0.0, MOST_FLIPPED)
    levels[draws < share] = UNKNOWN
    levels[(draws > 1.0 - 0.1 * share) & (levels == FREE)] = OCCUPIED


@dataclass(frozen=True, slots=True)
class FitStep:
    """How far a fit has come: steps, seconds that all calls took, and the mean loss since the last checkpoint."""

    step: int
    seconds: float
    loss: float


class Fitting:
    """A fit that a file keeps."""

    def __init__(self, settings: PredictionSettings, path: Path, device: str) -> None:
        self._settings, self._path, self.device = settings, path, torch.device(device)
        torch.manual_seed(settings.seed)
        self.network = TorchMapNetwork().to(self.device)
        if settings.begin:
            self.network.set_weights(dict(load_weights("" if settings.begin == SHIPPED else settings.begin)))
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay
        )
        self._mean = {name: array.detach().clone() for name, array in self.network.state_dict().items()}
        self._step, self._seconds = 0, 0.0
        if path.exists():
            self._resume()

    def run(self, windows: Windows) -> Generator[FitStep, None, None]:
        """Go on to the end, and yield each checkpoint when it is on the disk."""
        if not len(windows.numbers):
            raise ValueError("no floor has a partial map to learn from; want more floors")
        settings, began, loss_sum = self._settings, time.monotonic() - self._seconds, 0.0
        with ThreadPoolExecutor(1) as ahead:
            drawn = ahead.submit(self._draw, windows, self._step)
            while self._step < settings.steps and not self._is_late():
                levels, truth = drawn.result()
                drawn = ahead.submit(self._draw, windows, self._step + 1)
                loss_sum += self._descend(levels, truth)
                self._step += 1
                self._seconds = time.monotonic() - began
                if self._step % settings.checkpoint == 0:
                    self._write()
                    yield FitStep(self._step, self._seconds, loss_sum / settings.checkpoint)
                    loss_sum = 0.0
            drawn.cancel()
        self._write()

    @property
    def step(self) -> int:
        """Steps so far."""
        return self._step

    @property
    def seconds(self) -> float:
        """Seconds that all calls took so far."""
        return self._seconds

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the running mean of the weights."""
        return {name: array.cpu().numpy().copy() for name, array in self._mean.items()}

    def _is_late(self) -> bool:
        minutes = self._settings.fit_minutes
        return minutes > 0.0 and self._seconds >= 60.0 * minutes

    def _draw(self, windows: Windows, step: int) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        return windows.drawn(self._settings.batch, np.random.default_rng([self._settings.seed, 7, step]))

    def _descend(self, levels: NDArray[np.int8], truth: NDArray[np.bool_]) -> float:
        """Take a step of gradients; return the loss."""
        share = self._step / self._settings.steps
        if self._settings.fit_minutes > 0.0:
            share = max(share, self._seconds / (60.0 * self._settings.fit_minutes))
        rate = 0.5 * (1.0 + np.cos(np.pi * min(share, 1.0))) * min((self._step + 1) / WARM_STEPS, 1.0)
        for group in self._optimizer.param_groups:
            group["lr"] = self._settings.learning_rate * float(rate)
        seen = torch.from_numpy(levels).to(self.device)
        is_free = torch.from_numpy(truth).to(self.device)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.device.type == "cuda"):
            logits = self.network(seen)
        found = functional.binary_cross_entropy_with_logits(logits.float(), is_free.float(), reduction="none")
        weights = self._square_weights(seen)
        loss = (found * weights).sum() / weights.sum().clamp(min=1.0)
        self._optimizer.zero_grad()
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self._optimizer.step()
        decay = min(MEAN_DECAY, (self._step + 1.0) / (self._step + 10.0))
        with torch.no_grad():
            for name, array in self.network.state_dict().items():
                self._mean[name].lerp_(array, 1.0 - decay)
        return float(loss.item())

    def _square_weights(self, levels: Tensor) -> Tensor:
        """Return the weight of each square: 1 if it is unknown and near a known one, less if it is far."""
        known = (levels != UNKNOWN).float()[:, None]
        reach = round(NEAR_M / SIDE)
        near = functional.max_pool2d(known, (2 * reach + 1, 1), 1, (reach, 0))
        near = functional.max_pool2d(near, (1, 2 * reach + 1), 1, (0, reach))
        far = self._settings.far_weight
        return ((1.0 - known) * (far + (1.0 - far) * near))[:, 0]

    def _write(self) -> None:
        """Keep the fit in its file; there is no pickle in it."""
        content = {f"network.{name}": array for name, array in self.network.weights().items()}
        content |= {f"mean.{name}": array for name, array in self.weights().items()}
        for name, parameter in self.network.named_parameters():
            state = self._optimizer.state[parameter]
            for moment in ("exp_avg", "exp_avg_sq"):
                content[f"{moment}.{name}"] = state[moment].cpu().numpy()
        content["step"], content["seconds"] = np.array([self._step], np.int64), np.array([self._seconds])
        write_whole(self._path, save({name: np.ascontiguousarray(array) for name, array in content.items()}))

    def _resume(self) -> None:
        """Go on from the file."""
        try:
            content = load(read_bytes(self._path, 1 << 26))
            parts = {name: torch.from_numpy(array.copy()).to(self.device) for name, array in content.items()}
            self.network.load_state_dict(_part(parts, "network."))
            self._mean = _part(parts, "mean.")
            self._step, self._seconds = int(content["step"][0]), float(content["seconds"][0])
            for name, parameter in self.network.named_parameters():
                self._optimizer.state[parameter] = {
                    "step": torch.tensor(float(self._step)),
                    "exp_avg": parts[f"exp_avg.{name}"],
                    "exp_avg_sq": parts[f"exp_avg_sq.{name}"],
                }
        except (SafetensorError, KeyError, IndexError, RuntimeError, ValueError) as error:
            raise ValueError(
                f"{self._path} is no checkpoint of this training, or is truncated ({error}); remove it, and the "
                "same command fits again"
            ) from error


def _part(parts: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): array for name, array in parts.items() if name.startswith(prefix)}


def judged(network: TorchMapNetwork, floors: Sequence[FloorMaps], seed: int) -> Quality:
    """Return how good a network is on windows of some floors, as the running mean judges it."""
    windows, tally = Windows(floors), QualityTally()
    if not len(windows.numbers):
        return tally.quality()
    device = network.get_parameter("out.weight").device
    levels, truth = windows.drawn(min(MOST_JUDGED, 4 * len(windows.numbers)), np.random.default_rng([seed, 8]))
    with torch.no_grad():
        for start in range(0, len(levels), 50):
            seen = torch.from_numpy(levels[start : start + 50]).to(device)
            found = network(seen).sigmoid().float().cpu().numpy()
            for k in range(len(found)):
                tally.add(found[k], levels[start + k], truth[start + k])
    return tally.quality()

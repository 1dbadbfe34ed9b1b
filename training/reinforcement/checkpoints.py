"""Checkpoints of a training by rewards: weights, the optimizer, and how far it has come. No pickle."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save
from torch import nn

from lidarium.mapping.files.guarded_reading import read_bytes, read_text, reading, shortened
from lidarium.mapping.files.output import write_json, write_whole
from lidarium.mapping.files.weight_files import WeightFiles
from lidarium.mapping.geometry.bounds import shown

MOMENTS = ("exp_avg", "exp_avg_sq")
"""Adam's state of each parameter, besides its step count."""

MOST_STATE = 1 << 20
"""Files that say how far a training has come are no larger."""

KEPT = 2
"""So many checkpoints are kept."""


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A checkpoint of a training by rewards.

    Attributes
    ----------
    decisions : int
        How many were made.
    curve : list of (int, float or None)
        How good it was, by the number of decisions: for explorers the mean reward of the episodes that ended, None
        if none ended; for teams what they reach on the validation floors.
    """

    decisions: int
    curve: list[tuple[int, float | None]]


class Trained(Protocol):
    """A network that is trained."""

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """Return the weights as arrays, by name, without the critic's."""

    def set_weights(self, weights: dict[str, NDArray[np.float32]]) -> None:
        """Take weights over."""


def _files_of(network: Trained) -> WeightFiles:
    """Return the files of a network's weights."""
    return WeightFiles({name: array.shape for name, array in network.weights().items()}, "", "", "")


@dataclass(frozen=True, slots=True)
class Learner:
    """The learner, besides the network.

    Attributes
    ----------
    critic : Module
        The critic.
    optimizer : Adam
        Of network and critic.
    """

    critic: nn.Module
    optimizer: torch.optim.Optimizer


def write_checkpoint(folder: Path, checkpoint: Checkpoint, network: Trained, learner: Learner) -> None:
    """Write a checkpoint, and remove all but the last two.

    The file that makes it one is written last and removed first: whenever the process is killed, the part that is
    found is whole.
    """
    name = _name(checkpoint.decisions)
    _files_of(network).save(folder / f"{name}.safetensors", network.weights())
    write_whole(folder / f"{name}.learner.safetensors", save(_state_of(learner)))
    write_json(folder / f"{name}.json", {"decisions": checkpoint.decisions, "curve": checkpoint.curve})
    kept = {path.stem for path in sorted(folder.glob("decisions-*.json"))[-KEPT:]}
    for path in sorted(folder.glob("decisions-*"), key=lambda path: path.suffix != ".json"):
        if path.name.partition(".")[0] not in kept:
            path.unlink(missing_ok=True)


def latest_checkpoint(folder: Path) -> Checkpoint | None:
    """Return the latest checkpoint of a folder, None if there is none."""
    found = sorted(folder.glob("decisions-*.json"))
    if not found:
        return None
    cure = f"remove {found[-1].with_suffix('')}.* to go on from the checkpoint before"
    with reading(found[-1], "how far a training has come", cure):
        content = json.loads(read_text(found[-1], MOST_STATE))
        curve = [(int(number), None if reward is None else float(reward)) for number, reward in content["curve"]]
        checkpoint = Checkpoint(int(content["decisions"]), curve)
        if not curve or curve[-1][0] != checkpoint.decisions:
            raise ValueError(f"its curve {shown(curve)} does not end at its {checkpoint.decisions:,} decisions")
        if not all(reward is None or math.isfinite(reward) for _, reward in curve):
            raise ValueError(f"its curve {shown(curve)} has values that are not finite")
        return checkpoint


def restore(folder: Path, checkpoint: Checkpoint, network: Trained, learner: Learner) -> None:
    """Bring network and learner to where they were at a checkpoint."""
    name = _name(checkpoint.decisions)
    path = weights_of(folder, checkpoint)
    try:
        weights = _files_of(network).load(path)
        path = folder / f"{name}.learner.safetensors"
        _set_state(learner, load(read_bytes(path)))
    except (OSError, SafetensorError, ValueError, KeyError, RuntimeError) as error:
        raise ValueError(
            f"{path} is missing, damaged or of another network: {shortened(str(error), 200)}; remove "
            f"{folder / name}.* to go on from the checkpoint before"
        ) from error
    network.set_weights(weights)


def weights_of(folder: Path, checkpoint: Checkpoint) -> Path:
    """Return the file of a checkpoint's weights."""
    return folder / f"{_name(checkpoint.decisions)}.safetensors"


def _name(decisions: int) -> str:
    return f"decisions-{decisions:09d}"


def _parameters(optimizer: torch.optim.Optimizer) -> list[torch.Tensor]:
    return [each for group in optimizer.param_groups for each in group["params"]]


def _state_of(learner: Learner) -> dict[str, NDArray[np.float32]]:
    arrays = {f"critic.{name}": array.numpy() for name, array in learner.critic.state_dict().items()}
    for k, parameter in enumerate(_parameters(learner.optimizer)):
        state = learner.optimizer.state[parameter]
        arrays |= {f"{k}.{moment}": state[moment].numpy() for moment in MOMENTS}
        arrays[f"{k}.step"] = np.array([float(state["step"])], np.float32)
    return arrays


def _set_state(learner: Learner, arrays: dict[str, NDArray[np.float32]]) -> None:
    """Take the critic and the moments of the optimizer over."""
    tensors = {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}
    state = {}
    for k, parameter in enumerate(_parameters(learner.optimizer)):
        moments = {moment: tensors[f"{k}.{moment}"].reshape(parameter.shape) for moment in MOMENTS}
        state[parameter] = {"step": tensors[f"{k}.step"][0], **moments}
    learner.critic.load_state_dict(
        {name.removeprefix("critic."): tensor for name, tensor in tensors.items() if "critic." in name}
    )
    learner.optimizer.state.update(state)

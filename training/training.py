"""A whole training in a folder: rounds of lessons, then rewards; the best weights are kept.

Finished parts are on the disk. The same call continues an interrupted one.
"""

import json
import time
from collections.abc import Generator
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from lidarium.agents.learned.network import load_weights, save_weights
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.output import clear_unfinished, only_writer, remove_unfinished, write_json
from lidarium.training.folder import asked_for, begin_folder, versions
from lidarium.training.places import place_of
from lidarium.training.progress import Progress
from lidarium.training.settings import MOST_BYTES, TrainingSettings
from lidarium.training.teaching.rounds import FIT, LESSONS, RoundFolder, run_round
from lidarium.training.validation import Validated, compared, validate, validation_suite

TRAINING_FILE, HOURS_FILE, WEIGHTS_FILE, CARD_FILE = (
    "training.json",
    "hours.json",
    "weights.safetensors",
    "card.json",
)
LIBRARIES = ("numpy", "numba", "torch", "stable-baselines3", "sb3-contrib")
"""Packages that weights may depend on; the card names their versions."""

MEAN, MEAN_FILE = "mean", "mean.safetensors"
"""Mean of the weights of the last two rounds."""

REWARDS, VALIDATION, TENSORBOARD = "rewards", "validation", "tensorboard"


@dataclass(frozen=True, slots=True)
class Training:
    """A training that runs into a folder."""

    settings: TrainingSettings
    folder: Path
    workers: int = 1

    def run(self) -> Generator[Progress, None, None]:
        """Run the missing parts, and yield each step when it is on the disk."""
        if self.workers < 1:
            raise ValueError(f"workers is {self.workers}; want at least 1")
        validation_suite(self.settings, {})  # hours of lessons are not for floors that are not there
        self._try_worlds()
        begin_folder(self.folder / TRAINING_FILE, self.settings.as_dict())
        with only_writer(self.folder / TRAINING_FILE):
            self._clear_unfinished()
            torch.set_num_threads(1)
            clock = time.monotonic()
            for step in self._steps():
                yield step
                clock = self._count_hours(clock)

    def _try_worlds(self) -> None:
        """Begin an episode to learn from and one of validation: some settings are first refused by an environment."""
        place = place_of(self.settings, self.settings.rounds[0], 0)
        settings = replace(place.settings, horizon_s=place.settings.time_step)
        for floor in (place.floor, self.settings.validation.floors[0]):
            with closing(ExplorationEnv(floor, settings)) as env:
                run_episode(TourFrontier(), env, place.seed)

    def _steps(self) -> Generator[Progress, None, None]:
        candidates: dict[str, Path] = {}
        for number in range(len(self.settings.rounds)):
            folder = RoundFolder(self.folder, number)
            for step in run_round(self.settings, folder, self.workers):
                self._log(step)
                yield step
            candidates[f"round-{number}"] = folder.weights
            yield from validate(self.settings, self.folder / VALIDATION, candidates, self.workers)
        if len(candidates) > 1:
            candidates[MEAN] = self._mean_of(list(candidates.values())[-2:])
            yield from validate(self.settings, self.folder / VALIDATION, candidates, self.workers)
        begin = candidates[self._best(candidates)]
        if self.settings.ppo.decisions:
            candidates[REWARDS] = yield from self._learn(begin)
            yield from validate(self.settings, self.folder / VALIDATION, candidates, self.workers)
        self._keep_best(candidates)
        yield Progress("best weights", 1, 1)

    def _mean_of(self, files: list[Path]) -> Path:
        """Write the mean of some weights, and return its file.

        Each round goes on from the one before; their mean is often better than either (P. Izmailov et al.,
        "Averaging weights leads to wider optima and better generalization", 2018).
        """
        path = self.folder / MEAN_FILE
        if path.exists():
            return path
        parts = [load_weights(file) for file in files]
        mean = {name: np.asarray(np.mean([part[name] for part in parts], axis=0), np.float32) for name in parts[0]}
        save_weights(path, mean, self.settings.predictor)
        return path

    def _learn(self, begin: Path) -> Generator[Progress, None, Path]:
        """Go on by rewards; return the file of the weights."""
        from lidarium.training.reinforcement.checkpoints import latest_checkpoint, weights_of
        from lidarium.training.reinforcement.learning import learn

        folder = self.folder / REWARDS
        yield from learn(self.settings, folder, begin, self.workers, self.folder / TENSORBOARD)
        last = latest_checkpoint(folder)
        if last is None:
            raise ValueError(f"{folder} has no checkpoint; run the training again")
        return weights_of(folder, last)

    def _clear_unfinished(self) -> None:
        """Remove unfinished files of killed writers."""
        rounds = [RoundFolder(self.folder, number).path for number in range(len(self.settings.rounds))]
        lessons = [each / LESSONS for each in rounds]
        for folder in (self.folder, self.folder / REWARDS, *rounds, *lessons):
            clear_unfinished(folder, ".json")
            remove_unfinished(folder, (".npz", ".safetensors"))

    def _best(self, candidates: dict[str, Path]) -> str:
        """Return the name of the weights with the least time in validation."""
        return min(candidates, key=lambda name: self._validated(name).ratio)

    def _validated(self, name: str) -> Validated:
        return compared(self.folder / VALIDATION, name, self.settings)

    def _keep_best(self, candidates: dict[str, Path]) -> None:
        """Write the best weights, and the card that says where they come from."""
        best = self._best(candidates)
        digest = save_weights(self.folder / WEIGHTS_FILE, load_weights(candidates[best]), self.settings.predictor)
        fits = {
            f"round-{number}": _fitted(RoundFolder(self.folder, number)) for number in range(len(self.settings.rounds))
        }
        card = {
            "sha256": digest,
            "best": best,
            "hours": self._hours(),
            "workers": self.workers,
            "versions": versions(LIBRARIES),
            "training": asked_for(self.settings.as_dict()),
            "validation": {name: asdict(self._validated(name)) for name in candidates},
            "fits": fits,
            "rewards": self._curve(),
        }
        write_json(self.folder / CARD_FILE, card)

    def _curve(self) -> list[tuple[int, float | None]]:
        if not self.settings.ppo.decisions:
            return []
        from lidarium.training.reinforcement.checkpoints import latest_checkpoint

        last = latest_checkpoint(self.folder / REWARDS)
        return [] if last is None else last.curve

    def _hours(self) -> float:
        path = self.folder / HOURS_FILE
        if not path.exists():
            return 0.0
        with reading(path, "the hours of a training"):
            return float(json.loads(read_text(path, MOST_BYTES))["hours"])

    def _count_hours(self, since: float) -> float:
        """Add the elapsed time to the hours of the training, from time to time.

        Returns since when to count.
        """
        now = time.monotonic()
        if now - since < COUNT_PERIOD_S:
            return since
        write_json(self.folder / HOURS_FILE, {"hours": self._hours() + (now - since) / 3600.0})
        return now

    def _log(self, step: Progress) -> None:
        """Write the figures of a fit for TensorBoard."""
        if not step.part.endswith("fit"):
            return
        from torch.utils.tensorboard import SummaryWriter

        with SummaryWriter(str(self.folder / TENSORBOARD)) as writer:
            for name, figure in step.figures.items():
                writer.add_scalar(f"{step.part}/{name}", figure, step.done)


COUNT_PERIOD_S = 5.0
"""The hours of a training are written so often [s]."""


def _fitted(folder: RoundFolder) -> dict[str, Any]:
    path = folder.path / FIT
    with reading(path, "how a fit went"):
        return dict(json.loads(read_text(path, MOST_BYTES)))
